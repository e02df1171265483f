"""Measured throws on disk: a folder with dataset.toml, throws.csv and a file per recording.

`dataset.toml` has the shared properties; `throws.csv` has a row per throw with the names of its
files of motion and grip force. docs/throw-data.md describes the format.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array
from ...models.release import TableRelease
from ...models.robot import Arm
from ..arms import load_arm
from ..files import (
    read_csv,
    read_text,
    table_number,
    toml_tables,
)
from ..grip import Grasp, ThrownObject, held_object
from ..section import InputError, from_table, unknown
from .data import MeasuredThrow, Shared, ThrowData

#: Columns of throws.csv with a meaning; any other column is a factor, a label.
NEEDED = ("throw", "object", "motion", "grip", "command")
LANDING = ("x", "z", "theta")
MORE = ("track", "grasp_offset", "grasp_angle_deg")
LARGEST_TRUTH = 1e300  # Whole numbers far beyond it have no float.
#: Largest distance [m] of a landing's z from the data set's landing_height.
HEIGHT_ERROR = 0.05
#: Largest x [m] of a landing; a larger value has another unit.
FARTHEST = 50.0
#: Largest theta [rad] of a landing, ten turns; a larger value has another unit.
MOST_TURNED = 20 * math.pi
#: Time [s] of recorded motion before the opening and after detach: filters err at the ends of a
#: recording, and a late opening needs later motion.
MARGIN = 0.03


def load_throws(folder: str | Path) -> ThrowData:
    """The data set in `folder`.

    Raises InputError with one line: file, line or key, value and what is allowed.
    """
    folder = Path(folder)
    path = folder / "dataset.toml"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    tables = toml_tables(read_text(path), str(path))
    try:
        shared, objects, truth = _head(tables)
        arm = None if shared.arm is None else load_arm(shared.arm, folder)
    except InputError as error:
        raise error.within(str(path)) from None
    rows = _rows(folder / "throws.csv")
    throws = []
    for number, row in rows:
        try:
            throws.append(_throw(row, folder, shared, objects, arm))
        except (InputError, ValueError) as error:
            raise InputError(f"{folder / 'throws.csv'}: line {number}: {error}") from None
    return ThrowData(folder.name, shared, tuple(throws), arm, truth)


def _head(tables: Mapping[str, Any]) -> tuple[Shared, dict[str, ThrownObject], dict[str, float]]:
    own = {key: value for key, value in tables.items() if key not in ("objects", "truth")}
    shared: Shared = from_table(Shared, own)
    objects = {}
    given = tables.get("objects")
    if not isinstance(given, Mapping) or not given:
        raise InputError("section [objects.NAME] is missing")
    for name, table in given.items():
        if not isinstance(table, Mapping):
            raise InputError(f"objects: {name} = {table!r}: must be a section [objects.{name}]")
        try:
            objects[name] = held_object(table)
        except InputError as error:
            raise InputError(f"[objects.{name}] {error}") from None
    truth = tables.get("truth", {})
    if not isinstance(truth, Mapping) or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < LARGEST_TRUTH
        for v in truth.values()
    ):
        raise InputError(f"truth = {truth!r}: must be a section [truth] of numbers")
    return shared, objects, {key: float(value) for key, value in truth.items()}


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Line number and cells by column of throws.csv."""
    try:
        lines = list(csv.reader(read_text(path).splitlines()))
    except csv.Error as error:
        raise InputError(f"{path}: {error}") from None
    header = [cell.strip() for cell in lines[0]] if lines else []
    for column in NEEDED:
        if column not in header:
            hint = ", parted by commas" if len(header) == 1 else ""
            raise InputError(f"{path}: the first line must name the column {column}{hint}")
    if not set(LANDING) <= set(header) and "track" not in header:
        raise InputError(
            f"{path}: no landing: the first line must name the columns x, z and theta, or track"
        )
    rows_read = []
    for number, line in enumerate(lines[1:], start=2):
        if not line:
            continue
        if len(line) != len(header):
            raise InputError(f"{path}: line {number} has {len(line)} cells, not {len(header)}")
        rows_read.append((number, dict(zip(header, (cell.strip() for cell in line), strict=True))))
    if not rows_read:
        raise InputError(f"{path}: holds no throw")
    return rows_read


def _throw(
    row: Mapping[str, str],
    folder: Path,
    shared: Shared,
    objects: Mapping[str, ThrownObject],
    arm: Arm | None,
) -> MeasuredThrow:
    """The throw of one row and its files."""
    if row["object"] not in objects:
        raise InputError(f"object: {unknown(row['object'], list(objects))}")
    columns = ("x", "z", "theta") if arm is None else tuple(f"q{j + 1}" for j in range(arm.joints))
    motion = _recording("motion", row["motion"], folder, ("t", *columns))
    command = _number(row, "command")
    force = _recording("grip", row["grip"], folder, ("t", "f_N"))
    try:
        grip = TableRelease(list(force[:, 0]), list(force[:, 1]))
    except ValueError as error:
        raise InputError(f"grip = {row['grip']}: {error}") from None
    grasp = Grasp(
        _number(row, "grasp_offset", 0.0), math.radians(_number(row, "grasp_angle_deg", 0.0))
    )
    bar = objects[row["object"]]
    if grasp.offset > bar.com:
        raise InputError(f"grasp_offset = {grasp.offset:g}: must be at most com = {bar.com:g}")
    landing = _landing(row, shared)
    track = None
    if row.get("track"):
        track = _recording("track", row["track"], folder, ("t", "x", "z", "theta"))
    if landing is None and track is None:
        raise InputError("no landing: give x, z and theta, or a track")
    start, end = command + grip.dwell, command + grip.dwell + grip.opening
    if not motion[0, 0] <= start - MARGIN or not end + MARGIN <= motion[-1, 0]:
        raise InputError(
            f"motion = {row['motion']}: too short: the opening lasts from {start:.3f} to "
            f"{end:.3f} s, the samples cover {motion[0, 0]:.3f} to {motion[-1, 0]:.3f} s, must "
            f"cover {MARGIN:g} s more at either end"
        )
    known = (*NEEDED, *LANDING, *MORE)
    factors = {key: value for key, value in row.items() if key not in known}
    return MeasuredThrow(
        row["throw"],
        bar,
        grasp,
        motion[:, 0],
        motion[:, 1:],
        command,
        grip,
        landing,
        track,
        factors,
    )


def _landing(row: Mapping[str, str], shared: Shared) -> tuple[float, float, float] | None:
    """x, z [m] and theta [rad] of the row's landing; None without one."""
    if not all(row.get(name) for name in LANDING):
        return None
    x, z, theta = (_number(row, name) for name in LANDING)
    if abs(z - shared.landing_height) > HEIGHT_ERROR:
        raise InputError(
            f"z = {z:g}: must be within {HEIGHT_ERROR:g} m of landing_height = "
            f"{shared.landing_height:g}"
        )
    if abs(x) > FARTHEST:
        raise InputError(f"x = {x:g}: must be in m, at most {FARTHEST:g} (is it in mm?)")
    if abs(theta) > MOST_TURNED:
        raise InputError(
            f"theta = {theta:g}: must be in rad, at most {MOST_TURNED:.1f}, which is ten turns "
            "(is it in degrees?)"
        )
    return x, z, theta


def _recording(key: str, name: str, folder: Path, columns: tuple[str, ...]) -> Array:
    """A recording's columns (K, n), its times rising."""
    rows = read_csv(key, name, folder, columns)
    if len(rows) < 2:
        raise InputError(f"{key} = {name}: needs at least 2 rows")
    falls = np.flatnonzero(np.diff(rows[:, 0]) <= 0)
    if falls.size:
        raise InputError(f"{key} = {name}: line {falls[0] + 3}: t must rise from row to row")
    return rows


def _number(row: Mapping[str, str], key: str, default: float | None = None) -> float:
    """A cell's number; empty or absent is the default, if there is one."""
    word = row.get(key, "")
    return default if not word and default is not None else table_number(key, word)
