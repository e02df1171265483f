"""Measured throws: recordings in memory, and a folder with a file per recording.

`dataset.toml` has the shared properties; `throws.csv` has a row per throw with the names of its
files of motion and grip force. docs/throw-data.md describes the format.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..models import Array, Indices, PinchContact, ReadOnly, TableGrip
from ..problems import (
    Arm,
    Grasp,
    InputError,
    Object,
    Section,
    csv_lines,
    from_table,
    load_arm,
    load_gripper,
    optional,
    quantity,
    read_csv,
    read_text,
    table_number,
    toml_tables,
    unknown,
    within,
)

#: Required columns of throws.csv.
NEEDED = ("throw", "object", "motion", "grip", "command")
#: Columns of throws.csv with the landing.
LANDING = ("x", "z", "theta")
#: Optional columns of throws.csv; any other column is a factor, a label.
MORE = ("track", "grasp_offset", "grasp_angle_deg")


@dataclasses.dataclass(frozen=True)
class Shared(Section):
    """Properties shared by all throws of a data set.

    Faces and torsion of the pads are not identified. arm is None for motions of the hand;
    synthetic: origin of synthetic throws, empty for real ones.
    """

    landing_height: float = quantity(
        "m, where landing poses are measured and predicted", least=-1e3, most=1e3
    )
    description: str = quantity("", default="")
    synthetic: str = quantity("made by a program, not measured", default="")
    gravity: float = quantity("m/s^2", least=0, most=1e3, default=9.81)
    faces: int = quantity("pads that rub on the object", least=1, most=100, default=2)
    torsion: float = quantity(
        "torsional limit = torsion * patch radius * tangential limit",
        above=0,
        least=1e-3,
        most=10,
        default=0.6,
    )
    arm: str | None = quantity(
        "whose joints the motions hold; left out: the hand's x, z, theta", default=None
    )
    gripper: str | None = quantity(
        "the arm's gripper, as `file` in a scene's [gripper]; left out: its own hand", default=None
    )
    cutoff: float | None = optional(
        "Hz, low-pass for the joints' positions; left out: chosen by the landings", above=0
    )
    position_noise: float = quantity(
        "m, standard deviation of a measured landing", above=0, most=1, default=0.005
    )
    angle_noise: float = quantity(
        "degrees, the same of its angle", degrees=True, above=0, default=math.radians(2.0)
    )

    def check(self) -> None:
        """A gripper is on an arm."""
        if self.gripper is not None and self.arm is None:
            raise InputError(f"gripper = {self.gripper!r}: only with arm: motions are of the hand")

    def contact(self, friction: Any, patch_radius: Any) -> PinchContact:
        """The contact with these unknowns: numbers or arrays (N,)."""
        return PinchContact(friction, patch_radius, self.torsion, self.faces)


@dataclasses.dataclass(frozen=True)
class MeasuredThrow(ReadOnly):
    """The recording of one throw.

    motion: times (K,) [s] and columns (K, n): the hand's x, z, theta or the arm's joints; command
    [s]: time of the opening command on the motion's clock; grip: force of one pad from the command
    on; landing: x [m], z [m], theta [rad], None without a measured landing; track (K, 4): t on the
    motion's clock, x, z, theta of the CoM, None without a track. factors: the row's other columns.
    """

    name: str
    object: Object
    grasp: Grasp
    times: Array = dataclasses.field(repr=False)
    motion: Array = dataclasses.field(repr=False)
    command: float
    grip: TableGrip = dataclasses.field(repr=False)
    landing: tuple[float, float, float] | None
    track: Array | None = dataclasses.field(repr=False)
    factors: dict[str, str]

    @property
    def opening(self) -> float:
        """Time [s] on the motion's clock at which the grip force starts to fall."""
        return self.command + self.grip.dwell


@dataclasses.dataclass(frozen=True)
class ThrowData:
    """Throws, what they share, the arm of their joints, and a synthetic set's truth, to compare."""

    name: str
    shared: Shared
    throws: tuple[MeasuredThrow, ...] = dataclasses.field(repr=False)
    arm: Arm | None = dataclasses.field(default=None, repr=False)
    truth: dict[str, float] = dataclasses.field(default_factory=dict)

    def picked(self, numbers: Indices | list[int]) -> ThrowData:
        """The data set of some throws, by numbers from 0; InputError for others, and for none."""
        count = len(self.throws)
        # A boolean mask is no list of numbers.
        if (
            not len(numbers)
            or np.asarray(numbers).dtype.kind not in "iu"
            or not all(0 <= i < count for i in numbers)
        ):
            raise InputError(f"numbers: must be at least one, each from 0 to below {count}")
        return dataclasses.replace(self, throws=tuple(self.throws[i] for i in numbers))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about the defaults of keys that objects leave out."""
        words = [
            f"[objects] {words}" for t in self.throws for words in t.object.assumptions.values()
        ]
        return tuple(dict.fromkeys(words))

    @property
    def factors(self) -> dict[str, list[str]]:
        """Every factor's labels, in order of appearance."""
        found: dict[str, dict[str, None]] = {}
        for throw in self.throws:
            for name, label in throw.factors.items():
                found.setdefault(name, {})[label] = None
        return {name: list(labels) for name, labels in found.items()}


# Reading.


def load_throws(folder: str | Path) -> ThrowData:
    """The data set in `folder`.

    Raises InputError with one line: file, line or key, value and what is allowed.
    """
    folder = Path(folder)
    path = folder / "dataset.toml"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    tables = toml_tables(read_text(path), str(path))
    with within(str(path)):
        shared, objects, truth = _head(tables)
        with within(f"gripper = {shared.gripper!r}"):
            gripper = None if shared.gripper is None else load_gripper(shared.gripper, folder)
        with within(f"arm = {shared.arm!r}"):
            arm = None if shared.arm is None else load_arm(shared.arm, folder, gripper)
    throws, table = [], folder / "throws.csv"
    for number, row in _rows(table):
        with within(f"{table}: line {number}"):
            throws.append(_throw(row, folder, shared, objects, arm))
    return ThrowData(folder.name, shared, tuple(throws), arm, truth)


def _head(tables: Mapping[str, Any]) -> tuple[Shared, dict[str, Object], dict[str, float]]:
    own = {key: value for key, value in tables.items() if key not in ("objects", "truth")}
    shared: Shared = from_table(Shared, own)
    objects = {}
    given = tables.get("objects")
    if not isinstance(given, Mapping) or not given:
        raise InputError("section [objects.NAME] is missing")
    for name, table in given.items():
        if not isinstance(table, Mapping):
            raise InputError(f"objects: {name} = {table!r}: must be a section")
        with within(f"[objects.{name}]", " "):
            objects[name] = from_table(Object, table)
    truth = tables.get("truth", {})
    if not isinstance(truth, Mapping) or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < 1e300
        for v in truth.values()
    ):
        raise InputError(f"truth = {truth!r}: must be a section [truth] of numbers")
    return shared, objects, {key: float(value) for key, value in truth.items()}


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Line number and cells by column of throws.csv."""
    header, lines = csv_lines(path)
    for column in NEEDED:
        if column not in header:
            hint = ", parted by commas" if len(header) == 1 else ""
            raise InputError(f"{path}: the first line must name the column {column}{hint}")
    if not set(LANDING) <= set(header) and "track" not in header:
        raise InputError(
            f"{path}: no landing: the first line must name the columns x, z and theta, or track"
        )
    rows_read = []
    for number, line in lines:
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
    objects: Mapping[str, Object],
    arm: Arm | None,
) -> MeasuredThrow:
    """The throw of one row and its files."""
    if row["object"] not in objects:
        raise InputError(f"object: {unknown(row['object'], list(objects))}")
    motion = _recording("motion", row["motion"], folder, _motion_columns(arm))
    command = _number(row, "command")
    force = _recording("grip", row["grip"], folder, ("t", "f_N"))
    with within(f"grip = {row['grip']}", errors=ValueError):
        grip = TableGrip(list(force[:, 0]), list(force[:, 1]))
    grasp = Grasp(
        _number(row, "grasp_offset", 0.0), math.radians(_number(row, "grasp_angle_deg", 0.0))
    )
    bar = objects[row["object"]]
    if grasp.offset > bar.com:
        raise InputError(f"grasp_offset = {grasp.offset:g}: must be at most com = {bar.com:g}")
    landing = _landing(row, shared)
    track = None
    if row.get("track"):
        track = _recording("track", row["track"], folder, ("t", *LANDING))
    if landing is None and track is None:
        raise InputError("no landing: give x, z and theta, or a track")
    start, end = command + grip.dwell, command + grip.dwell + grip.opening
    # Filters err at the ends of a recording, and a late opening needs later motion.
    first, last, margin = motion[0, 0], motion[-1, 0], 0.03
    if not first <= start - margin or not end + margin <= last:
        raise InputError(
            f"motion = {row['motion']}: too short: the opening lasts from {start:.3f} to "
            f"{end:.3f} s, the samples cover {first:.3f} to {last:.3f} s, must cover {margin:g} s "
            "more at either end"
        )
    known = (*NEEDED, *LANDING, *MORE)
    factors = {key: value for key, value in row.items() if key not in known}
    times, rows = motion[:, 0], motion[:, 1:]
    return MeasuredThrow(
        row["throw"], bar, grasp, times, rows, command, grip, landing, track, factors
    )


def _motion_columns(arm: Arm | None) -> tuple[str, ...]:
    """Columns of a motion's file: of the hand, or of an arm's joints."""
    return ("t", *(LANDING if arm is None else (f"q{j + 1}" for j in range(arm.joints))))


def _landing(row: Mapping[str, str], shared: Shared) -> tuple[float, float, float] | None:
    """x, z [m] and theta [rad] of the row's landing; None without one."""
    if not all(row.get(name) for name in LANDING):
        return None
    x, z, theta = (_number(row, name) for name in LANDING)
    if abs(z - shared.landing_height) > 0.05:
        raise InputError(
            f"z = {z:g}: must be within 0.05 m of landing_height = {shared.landing_height:g}"
        )
    if abs(x) > 50:
        raise InputError(f"x = {x:g}: must be in m, at most 50 (is it in mm?)")
    if abs(theta) > 20 * math.pi:
        raise InputError(
            f"theta = {theta:g}: must be in rad, at most 62.8, which is ten turns (is it in "
            "degrees?)"
        )
    return x, z, theta


def _recording(key: str, name: str, folder: Path, columns: tuple[str, ...]) -> Array:
    """A recording's columns (K, n), its times rising."""
    rows = read_csv(key, name, folder, columns)
    if len(rows) < 2:
        raise InputError(f"{key} = {name}: needs at least 2 rows")
    falls = np.flatnonzero(np.diff(rows[:, 0]) <= 0)
    if falls.size:
        t = rows[falls[0] + 1, 0]
        raise InputError(f"{key} = {name}: t = {t:g}: must rise from row to row")
    return rows


def _number(row: Mapping[str, str], key: str, default: float | None = None) -> float:
    """A cell's number; empty or absent is the default, if there is one."""
    word = row.get(key, "")
    return default if not word and default is not None else table_number(key, word)
