"""throw.gif's picture as a film."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter

from ..problems.errors import InputError
from .picture import SLOW, animate
from .sent import SentThrow
from .timeline import timeline

#: Frames a second; the last one stays for half a second.
FPS = 25


def save_film(throw: SentThrow, path: Path) -> None:
    """An MP4 at a fifth of the throw's speed, whole or not at all.

    InputError where ffmpeg or a place to write is missing.
    """
    if path.suffix != ".mp4":
        raise InputError(f"--mp4 {path}: must end in .mp4")
    if not FFMpegWriter.isAvailable():
        raise InputError("--mp4: needs ffmpeg, which is not installed")
    line = timeline(throw)
    frames = np.searchsorted(line.times, np.arange(0.0, line.times[-1], SLOW / FPS) - 1e-9)
    frames = np.concatenate([frames, np.full(FPS // 2, len(line.times) - 1)])
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
            whole = Path(scratch) / path.name
            animate(throw, line, frames, FFMpegWriter(fps=FPS, codec="h264"), whole)
            os.replace(whole, path)
    except OSError as error:
        raise InputError(f"--mp4 {path}: {error.strerror or error}") from None
    except subprocess.CalledProcessError as error:
        raise InputError(f"--mp4 {path}: ffmpeg failed with status {error.returncode}") from None
