"""A solved throw as a record of numbers and texts, and back; which records can be throws."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Flags
from ..ocp import Margins, Optimum, ReducedVariables, Refinement

Records = npt.NDArray[Any]

#: Largest landing [m; rad] of a record, and largest pose and twist [m, rad, m/s, rad/s] at detach.
FARTHEST = 1e4
#: Largest margin [m; share] of a record.
WIDEST = 1.0
#: Length [bytes] of a record's texts (guards, margins).
TEXT = 128
#: Fields of a record that are finite numbers.
NUMBERS = ("landing", "u", "slope", "detach", "effort", "smoothing", "quiet", "error95")


def record_type(controls: ReducedVariables, angle: bool) -> np.dtype[Any]:
    """The fields of a record, those of `Optimum` in single precision.

    landing: x [m], theta [rad]. error95 [m]: 95 % pose error under what is uncertain.
    """
    f, u = "<f4", controls.size
    fields: list[Any] = [
        ("landing", f, 2),
        ("u", f, u),
        ("slope", f, (u, 2 if angle else 1)),
        ("detach", f, 6),
        ("effort", f),
        ("smoothing", f, 2),
        ("nlp_size", "<i4", 2),
        ("quiet", f),
        ("error95", f),
        ("guards", f"S{TEXT}"),
        ("margins", f"S{TEXT}"),
    ]
    return np.dtype(fields)


def record_of(
    kind: np.dtype[Any], optimum: Optimum, landing: tuple[float, float], error95: float
) -> Records:
    """The record () of a throw that lands at `landing`."""
    row = np.zeros((), kind)
    row["landing"] = landing
    for name in ("u", "slope", "detach", "effort", "smoothing", "nlp_size"):
        row[name] = getattr(optimum, name)
    row["quiet"], row["error95"] = optimum.refinement.quiet, min(error95, FARTHEST)
    row["guards"] = " ".join(sorted(optimum.refinement.lazy)).encode()
    row["margins"] = _margins_text(optimum.refinement.margins)
    return row


def optimum_in(row: np.void) -> Optimum:
    """The throw of a record."""
    return Optimum(
        row["u"].astype(float),
        row["slope"].astype(float),
        row["detach"].astype(float),
        float(row["effort"]),
        (int(row["nlp_size"][0]), int(row["nlp_size"][1])),
        (float(row["smoothing"][0]), float(row["smoothing"][1])),
        _refinement(row["guards"], row["margins"], float(row["quiet"])),
    )


def are_valid(records: Records, controls: ReducedVariables) -> Flags:
    """Which records (N,) have numbers in range and readable texts."""
    numbers = [records[name].reshape(len(records), -1) for name in NUMBERS]
    good = np.isfinite(np.hstack(numbers)).all(axis=1)
    good &= (records["effort"] > 0) & (records["quiet"] >= 0)
    for name in ("landing", "detach"):
        good &= (np.abs(records[name]) < FARTHEST).all(axis=1)
    good &= (records["nlp_size"] > 0).all(axis=1)
    for name, read in (("guards", _guards), ("margins", _margins)):
        texts = records[name].reshape(len(records), -1)
        wrong = {text for text in set(texts.ravel().tolist()) if not _is_readable(read, text)}
        if wrong:
            good &= [wrong.isdisjoint(row) for row in texts.tolist()]
    good[good] &= controls.near_bounds(records["u"][good].astype(float))
    return np.asarray(good)


def _margins_text(margins: Margins) -> bytes:
    """Margins as JSON with six decimals, or with five or four if six do not fit."""
    for digits in (6, 5, 4):
        values = {name: round(value, digits) for name, value in margins.values}
        text = json.dumps(values, separators=(",", ":")).encode()
        if len(text) <= TEXT:
            break
    return text


def _text(text: bytes) -> str:
    """A printable text; ValueError for another."""
    words = text.decode()
    if not words.isprintable():
        raise ValueError(f"{words!r} is no name")
    return words


def _guards(text: bytes) -> frozenset[str]:
    """Names of lazy constraints; ValueError where there are others."""
    names = frozenset(_text(text).split())
    if not all(map(str.isidentifier, names)):
        raise ValueError(f"{text!r} has no names of lazy constraints")
    return names


@functools.lru_cache(maxsize=64)
def _refinement(guards: bytes, margins: bytes, quiet: float) -> Refinement:
    """The refinement of a record; few of a library differ."""
    return Refinement(_guards(guards), _margins(margins), quiet=quiet)


def _margins(text: bytes) -> Margins:
    """Margins from their JSON; ValueError for other text."""
    values = json.loads(text or b"{}")
    if not isinstance(values, dict) or not all(
        isinstance(value, float) and 0 <= value < WIDEST for value in values.values()
    ):
        raise ValueError(f"{text!r} has no margins")
    return Margins(**values)


def _is_readable(read: Callable[[bytes], object], text: bytes) -> bool:
    try:
        read(text)
    except ValueError:
        return False
    return True
