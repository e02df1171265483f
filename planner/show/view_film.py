"""throw.gif's picture as a film."""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...problems import InputError
from ..check import SentThrow
from .moving_picture import SLOW, Pixels, frames
from .timeline import timeline

#: Frames a second; the last one stays for half a second.
FPS = 25


def save_film(throw: SentThrow, path: Path) -> None:
    """An MP4 at a fifth of the throw's speed, whole or not at all.

    InputError where ffmpeg or a place to write is missing.
    """
    if path.suffix != ".mp4":
        raise InputError(f"--mp4 {path}: must end in .mp4")
    if shutil.which("ffmpeg") is None:
        raise InputError("--mp4: needs ffmpeg, which is not installed")
    line = timeline(throw)
    shown = np.searchsorted(line.times, np.arange(0.0, line.times[-1], SLOW / FPS) - 1e-9)
    shown = np.concatenate([shown, np.full(FPS // 2, len(line.times) - 1)])
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
            whole = Path(scratch) / path.name
            encode(frames(throw, line, shown), whole)
            os.replace(whole, path)
    except OSError as error:
        raise InputError(f"--mp4 {path}: {error.strerror or error}") from None
    except subprocess.CalledProcessError as error:
        raise InputError(f"--mp4 {path}: ffmpeg failed with status {error.returncode}") from None


def encode(pictures: Iterable[Pixels], path: Path) -> None:
    """Pictures (H, W, 4) of one even size into an H.264 file that all players know."""
    pictures = iter(pictures)
    first = next(pictures)
    high, wide = first.shape[:2]
    command = [
        *("ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgba"),
        *("-s", f"{wide}x{high}", "-framerate", str(FPS), "-i", "pipe:"),
        *("-vcodec", "h264", "-pix_fmt", "yuv420p", "-y", str(path)),
    ]
    # If ffmpeg ends early, its status says so.
    with (
        contextlib.suppress(BrokenPipeError),
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as process,
    ):
        assert process.stdin is not None
        for picture in itertools.chain([first], pictures):
            process.stdin.write(picture.tobytes())
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
