"""Data sets of throws on disk: writes what `load_throws` reads, and prepares raw forces."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .arm_file import arm_names
from .errors import InputError
from .grip_recording import grip_samples
from .hold import ThrownObject
from .section import table_of
from .throw_data import LANDING, MeasuredThrow, ThrowData

Array = npt.NDArray[np.float64]

#: Digits of every number that is written.
FORMAT = "%.9g"
#: What a data set's folder holds.
NAMES = ("dataset.toml", "throws.csv", "motion", "grip", "track")
#: Comments of dataset.toml; keys without one say it all.
REMARKS = {
    "landing_height": "m, where landing poses are measured and predicted",
    "gravity": "m/s^2",
    "faces": "pads that rub on the object",
    "torsion": "torsional limit = torsion * patch radius * tangential limit",
    "arm": "whose joints the motions hold; left out: the hand's x, z, theta",
    "cutoff": "Hz, low-pass for the joints' positions",
    "position_noise": "m, standard deviation of a measured landing",
    "angle_noise_deg": "the same of its angle",
    "synthetic": "made by a program, not measured",
    "mass": "kg",
    "inertia": "kg m^2 about the CoM",
    "length": "m",
    "com": "m from the end nearer the grasp",
    "width": "m",
}


def write_throws(
    data: ThrowData, folder: str | Path, objects: Mapping[ThrownObject, str] | None = None
) -> None:
    """Write dataset.toml, throws.csv and the recordings into `folder`, made if need be.

    `load_throws` gives the same back to 9 digits; the grip force is sampled at 1 kHz.
    objects: their names in the files, else object1, object2 and so on. Raises InputError
    for a folder that cannot be written and an arm's file that `folder` does not hold.
    """
    folder = Path(folder)
    kinds = dict.fromkeys(throw.object for throw in data.throws)
    names = {one: f"object{i}" for i, one in enumerate(kinds, start=1)} | dict(objects or {})
    arm = data.shared.arm
    if arm is not None and arm not in arm_names() and not (folder / arm).is_file():
        raise InputError(f"{folder}: holds no {arm}: copy the arm's file there first")
    files = _file_names(data.throws)
    try:
        for kind in ("motion", "grip", "track"):
            if kind != "track" or any(throw.track is not None for throw in data.throws):
                (folder / kind).mkdir(parents=True, exist_ok=True)
        text = _head(data, {one: names[one] for one in kinds})
        (folder / "dataset.toml").write_text(text, encoding="utf-8")
        (folder / "throws.csv").write_text(_rows(data, names, files), encoding="utf-8")
        for throw, file in zip(data.throws, files, strict=True):
            _write_recordings(throw, folder, file, data.arm is not None)
    except OSError as error:
        raise InputError(f"{folder}: {error.strerror or error}") from None


def _head(data: ThrowData, objects: Mapping[ThrownObject, str]) -> str:
    """dataset.toml."""
    lines = [*_lines(table_of(data.shared))]
    for thrown, name in objects.items():
        lines += ["", f"[objects.{_key(name)}]", *_lines(table_of(thrown))]
    if data.truth:
        lines += ["", "# What made the throws: for comparison only, no fit reads it.", "[truth]"]
        lines += [f"{_key(key)} = {float(value)!r}" for key, value in data.truth.items()]
    return "\n".join(lines) + "\n"


def _lines(table: Mapping[str, Any]) -> list[str]:
    """A table's lines, each with its unit."""
    found = []
    for key, value in table.items():
        shown = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
        found.append(f"{key} = {shown}" + (f" # {REMARKS[key]}" if key in REMARKS else ""))
    return found


def _key(name: str) -> str:
    """A key of TOML, quoted if need be."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def _rows(data: ThrowData, objects: Mapping[ThrownObject, str], files: Sequence[str]) -> str:
    """throws.csv."""
    factors = list(data.factors)
    columns = ["throw", "object", *factors, "command", "grasp_offset", "grasp_angle_deg"]
    columns += [*LANDING, "motion", "grip", "track"]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for throw, file in zip(data.throws, files, strict=True):
        held = (throw.command, throw.grasp.offset, np.degrees(throw.grasp.angle))
        landing = throw.landing or ("", "", "")
        writer.writerow(
            [throw.name, objects[throw.object]]
            + [throw.factors.get(name, "") for name in factors]
            + [value if isinstance(value, str) else FORMAT % value for value in (*held, *landing)]
            + [f"motion/{file}", f"grip/{file}", "" if throw.track is None else f"track/{file}"]
        )
    return text.getvalue()


def _file_names(throws: Sequence[MeasuredThrow]) -> list[str]:
    """A file's name per throw: the throw's own, or its number where that makes none."""
    names = [throw.name for throw in throws]
    plain = all(re.fullmatch(r"[A-Za-z0-9_-]+", name) for name in names)
    if plain and len({name.lower() for name in names}) == len(names):
        return [f"{name}.csv" for name in names]
    return [f"{number:04d}.csv" for number in range(1, len(names) + 1)]


def _write_recordings(throw: MeasuredThrow, folder: Path, file: str, joints: bool) -> None:
    """The recordings of one throw."""
    if joints:
        columns = ["t", *(f"q{j + 1}" for j in range(throw.motion.shape[1]))]
    else:
        columns = ["t", "x", "z", "theta"]
    _write(folder / "motion" / file, columns, np.column_stack([throw.times, throw.motion]))
    _write(folder / "grip" / file, ["t", "f_N"], grip_samples(throw.grip))
    if throw.track is not None:
        _write(folder / "track" / file, ["t", "x", "z", "theta"], throw.track)


def _write(path: Path, columns: list[str], rows: Array) -> None:
    lines = [",".join(columns), *(",".join(FORMAT % value for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
