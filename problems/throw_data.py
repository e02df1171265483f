"""Measured throws on disk: a folder with dataset.toml, throws.csv and a file per recording.

`dataset.toml` says what all throws share, `throws.csv` has a row per throw and names the
files of its motion and grip force. docs/throw-data.md says it in full.
"""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..models import Arm, TableRelease
from .arm_file import load_arm
from .errors import InputError
from .hold import Grasp, ThrownObject, held_object
from .section import Section, from_table, quantity, unknown
from .text_file import read_csv, read_text, toml_tables

Array = npt.NDArray[np.float64]

#: Columns of throws.csv that mean something here; any other is a factor, a label.
NEEDED = ("throw", "object", "motion", "grip", "command")
LANDING = ("x", "z", "theta")
MORE = ("track", "grasp_offset", "grasp_angle_deg")
#: A landing's z may be this far [m] from the height at which landings are compared.
HEIGHT_ERROR = 0.05
#: What a motion must cover [s] before the force falls and after it is gone: filters err at the
#: ends, and a late opening needs more.
MARGIN = 0.03
#: Fewest throws that parameters are fitted to.
FEWEST = 1


@dataclasses.dataclass(frozen=True)
class Shared(Section):
    """What all throws of a data set share.

    landing_height [m]: where a landing pose is measured or predicted; faces and torsion of
    the pads, which are not identified. arm: whose joints the motions hold, absent for
    motions of the hand; cutoff [Hz] of the low-pass for joints. synthetic: what made the
    throws, absent for real ones. position_noise [m], angle_noise [rad]: standard deviation
    of the measured landing.
    """

    landing_height: float = quantity(least=-1e3, most=1e3)
    description: str = ""
    synthetic: str = ""
    gravity: float = quantity(least=0, most=1e3, default=9.81)
    faces: int = quantity(least=1, most=100, default=2)
    torsion: float = quantity(above=0, least=1e-3, most=10, default=0.6)
    arm: str | None = None
    cutoff: float = quantity(above=0, default=35.0)
    position_noise: float = quantity(above=0, most=1, default=0.005)
    angle_noise: float = quantity(degrees=True, above=0, default=math.radians(2.0))


@dataclasses.dataclass(frozen=True)
class MeasuredThrow:
    """One throw as it was recorded.

    motion: times (K,) [s] and columns (K, n): the hand's x, z, theta or the arm's joints;
    command [s]: when the opening command went out, on the motion's clock; grip: force of
    one pad from the command on; landing: x [m], z [m], theta [rad], None if only the track
    was measured; track (K, 4): t on the motion's clock, x, z, theta of the CoM, None if
    only the landing was. factors: the row's other columns.
    """

    name: str
    object: ThrownObject
    grasp: Grasp
    times: Array
    motion: Array
    command: float
    grip: TableRelease
    landing: tuple[float, float, float] | None
    track: Array | None
    factors: dict[str, str]

    @property
    def opening(self) -> float:
        """When the grip force starts to fall, on the motion's clock [s]."""
        return self.command + self.grip.dwell


@dataclasses.dataclass(frozen=True)
class ThrowData:
    """A data set: its throws, what they share, the arm that its joints belong to, and what
    is known of the truth of synthetic ones (for comparison only)."""

    name: str
    shared: Shared
    throws: tuple[MeasuredThrow, ...]
    arm: Arm | None = None
    truth: dict[str, float] = dataclasses.field(default_factory=dict)

    def picked(self, numbers: npt.NDArray[np.int_] | list[int]) -> ThrowData:
        """Some of the throws."""
        return dataclasses.replace(self, throws=tuple(self.throws[i] for i in numbers))

    @property
    def factors(self) -> dict[str, list[str]]:
        """Every factor's labels, in order of appearance."""
        found: dict[str, list[str]] = {}
        for throw in self.throws:
            for name, label in throw.factors.items():
                labels = found.setdefault(name, [])
                if label not in labels:
                    labels.append(label)
        return found


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


def _head(
    tables: Mapping[str, Any],
) -> tuple[Shared, dict[str, ThrownObject], dict[str, float]]:
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
        isinstance(v, int | float) and not isinstance(v, bool) for v in truth.values()
    ):
        raise InputError(f"truth = {truth!r}: must be a section [truth] of numbers")
    return shared, objects, {key: float(value) for key, value in truth.items()}


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Line number and cells by column of throws.csv."""
    lines = list(csv.reader(read_text(path).splitlines()))
    header = [cell.strip() for cell in lines[0]] if lines else []
    for column in NEEDED:
        if column not in header:
            raise InputError(f"{path}: the first line must name the column {column}")
    if not set(LANDING) <= set(header) and "track" not in header:
        raise InputError(
            f"{path}: no landing: the first line must name the columns x, z and theta, or track"
        )
    found = []
    for number, line in enumerate(lines[1:], start=2):
        if not line:
            continue
        if len(line) != len(header):
            raise InputError(f"{path}: line {number} has {len(line)} cells, not {len(header)}")
        found.append((number, dict(zip(header, (cell.strip() for cell in line), strict=True))))
    if len(found) < FEWEST:
        raise InputError(f"{path}: holds no throw")
    return found


def _throw(
    row: Mapping[str, str],
    folder: Path,
    shared: Shared,
    objects: Mapping[str, ThrownObject],
    arm: Arm | None,
) -> MeasuredThrow:
    """One row with its files."""
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
    landing = None
    if all(row.get(name) for name in LANDING):
        x, z, theta = (_number(row, name) for name in LANDING)
        if abs(z - shared.landing_height) > HEIGHT_ERROR:
            raise InputError(
                f"z = {z:g}: must be within {HEIGHT_ERROR:g} m of landing_height = "
                f"{shared.landing_height:g}"
            )
        landing = (x, z, theta)
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
        objects[row["object"]],
        grasp,
        motion[:, 0],
        motion[:, 1:],
        command,
        grip,
        landing,
        track,
        factors,
    )


def _recording(key: str, name: str, folder: Path, columns: tuple[str, ...]) -> Array:
    """A recording's columns (K, n), its times rising."""
    rows = np.array(read_csv(key, name, folder, columns), float).reshape(-1, len(columns))
    if len(rows) < 2:
        raise InputError(f"{key} = {name}: needs at least 2 rows")
    falls = np.flatnonzero(np.diff(rows[:, 0]) <= 0)
    if falls.size:
        raise InputError(f"{key} = {name}: line {falls[0] + 3}: t must rise from row to row")
    return rows


def _number(row: Mapping[str, str], key: str, default: float | None = None) -> float:
    """A cell as a finite number; empty or absent is the default, if there is one."""
    word = row.get(key, "")
    if not word and default is not None:
        return default
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{key} = {word!r}: must be a finite number")
    return value
