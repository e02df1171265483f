"""Codes of the limits on a throw, findings, verdicts, and their sentences."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from ...problems.files import plain

_EASIER_THROW = "a nearer or higher target, another angle, or a faster arm"


class Code(Enum):
    """The subject of a finding: its name in JSON, the failure of throws that break it (after
    "34 % ..."), and the change of the scene that avoids it."""

    fate: str
    cure: str

    LANDING = "landing", "land outside the tolerance", "plan again, or a larger [tolerance]"
    NO_LANDING = "no_landing", "never fall to the target's height", "a lower target"
    GRAZING = (
        "grazing",
        "fall through the target's height too slowly",
        "a target below the top of the flight",
    )
    LANDING_SPEED = "landing_speed", "land too fast or too slow", "the bounds in [landing]"
    LANDING_RATE = "landing_rate", "land turning too fast", "the bounds in [landing]"
    ARRIVAL = "arrival", "land too early or too late", "another [target] arrival"
    RELEASE = "release", "slide out of the pads", "a stronger grip, a shorter [gripper] opening"
    SLIP_BEFORE_OPENING = (
        "slip_before_opening",
        "slip under full grip before the opening",
        "raise [gripper] force or sticking_margin",
    )
    CARRY = (
        "carry",
        "turn or lose the object on the way to the swing",
        "raise [gripper] force, a larger [contact] patch_radius, a lighter object",
    )
    JOINT_POSITION = "joint_position", "leave a joint's range", _EASIER_THROW
    JOINT_VELOCITY = "joint_velocity", "exceed a joint's velocity", _EASIER_THROW
    JOINT_ACCELERATION = "joint_acceleration", "exceed a joint's acceleration", _EASIER_THROW
    JOINT_JERK = "joint_jerk", "exceed a joint's jerk", _EASIER_THROW
    TOOL_SPEED = (
        "tool_speed",
        "exceed the tool's speed",
        "a nearer target, or a larger [robot] tool_speed if the robot allows it",
    )
    TORQUE = (
        "torque",
        "need more torque than a joint has, less its margin",
        "a lighter object, a smaller [torque] margin",
    )
    TORQUE_RATE = (
        "torque_rate",
        "change a joint's torque too fast",
        "a larger [torque] rate, or a lighter object",
    )
    FLOOR = "floor", "touch the floor", "a lower [workspace] floor, another start"
    COLUMN = "column", "touch the base column", "another target angle, less [workspace] column"
    PALM = "palm", "touch the palm", "another target angle, less [workspace] palm_clearance"
    COLLISION = (
        "collision",
        "hit an obstacle or the arm itself",
        "another target angle, less clearance of the obstacle",
    )
    CUP_MISSED = (
        "cup_missed",
        "miss the cup",
        "a wider cup, less insertion, an angle nearer -90 deg",
    )
    CUP_WALL = (
        "cup_wall",
        "touch the cup's wall or rim",
        "a wider cup, less clearance or insertion, an angle nearer -90 deg",
    )
    BIN_MISSED = ("bin_missed", "miss the bin", "a larger bin, a nearer or lower one")
    BIN_WALL = (
        "bin_wall",
        "touch the bin's wall or rim",
        "a larger bin, less [bin] clearance, a shorter object",
    )
    MODELS_DIFFER = (
        "models_differ",
        "land elsewhere by another release model",
        "a throw with less load on the pads (--robust)",
    )
    REST = (
        "rest",
        "come to rest elsewhere",
        "a steeper or slower throw, a deeper or wider place, a shorter bar",
    )
    CALIBRATION = (
        "calibration",
        "are unlike the throws of [calibration]",
        "measure throws like this one and calibrate again",
    )
    OWN = "constraint", "break a constraint of the planner's own", "wider bounds of the constraint"
    UNCERTAIN = "uncertain", "use up a reserve", "the reserve that the finding names"

    def __new__(cls, name: str, fate: str, cure: str) -> Code:
        """A code whose value is its name in JSON."""
        code = object.__new__(cls)
        code._value_, code.fate, code.cure = name, fate, cure
        return code


#: Codes of a throw that does not go into its cup or bin without contact.
INTO = frozenset({Code.CUP_MISSED, Code.CUP_WALL, Code.BIN_MISSED, Code.BIN_WALL})


def excused(cup: bool) -> frozenset[Code]:
    """Codes that no success needs: with a cup or bin, a throw into it may miss its target pose."""
    return frozenset({Code.LANDING}) if cup else frozenset()


#: Codes of a joint's limits by the names of the limited quantities.
_KINDS = ("position", "velocity", "acceleration", "jerk")
JOINT_LIMITS = {kind: Code[f"JOINT_{kind.upper()}"] for kind in _KINDS}


@dataclass(frozen=True)
class Finding:
    """A limit that a throw breaks, or a warning.

    value, limit: the measured and the allowed value, SI units. time [s]: on the motion's clock,
    None without an instant. body: joint, link or part of the throw; other: the body that it
    touches. broken: False for a warning. note: the sentence, for codes without one.
    """

    code: Code
    value: float
    limit: float
    time: float | None = None
    body: str = ""
    other: str = ""
    broken: bool = True
    note: str = ""

    @property
    def words(self) -> str:
        """The finding as a sentence."""
        words = _SENTENCES.get(self.code)
        return self.note if words is None else words(self)

    @property
    def reserve(self) -> bool:
        """Whether it breaks a margin of the scene only, which the user may lower."""
        margins = Code.SLIP_BEFORE_OPENING, Code.TORQUE
        return self.broken and self.code in margins and self.value <= 1.0

    @property
    def limit_name(self) -> str:
        """The limit's name, as of limits that bind at an optimum."""
        kind = _LIMITS.get(self.code, self.code.value.removeprefix("joint_").replace("_", " "))
        if self.code is Code.OWN:
            return self.body
        return f"{self.body} {kind}" if self.code in _OF_A_JOINT else kind

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians."""
        entries = {
            "code": self.code.value,
            "broken": self.broken,
            "value": self.value,
            "limit": self.limit,
            "time": self.time,
            "body": self.body or None,
            "other": self.other or None,
            "words": self.words,
        }
        table: dict[str, Any] = plain(entries)
        return table


@dataclass(frozen=True)
class Verdict:
    """All findings about a throw; cup: the object must enter a cup or a bin."""

    findings: tuple[Finding, ...] = ()
    cup: bool = False

    @property
    def broken(self) -> tuple[Finding, ...]:
        """The findings of broken limits."""
        return tuple(finding for finding in self.findings if finding.broken)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings without a broken limit."""
        return tuple(finding for finding in self.findings if not finding.broken)

    @property
    def ok(self) -> bool:
        """Whether no limit is broken: the condition of status `solved`."""
        return not self.broken

    @property
    def succeeds(self) -> bool:
        """Whether a sweep counts the throw as a success.

        No limit is broken but those `excused`.
        """
        return self.without(*excused(self.cup)).ok

    @property
    def reserves(self) -> bool:
        """Whether it breaks margins only."""
        return not self.ok and all(finding.reserve for finding in self.broken)

    @property
    def codes(self) -> frozenset[Code]:
        """The codes of the broken limits."""
        return frozenset(finding.code for finding in self.broken)

    @property
    def words(self) -> str:
        """Sentences about the broken limits; empty without any."""
        return "; ".join(finding.words for finding in self.broken)

    def without(self, *codes: Code) -> Verdict:
        """The verdict without findings of these codes."""
        return Verdict(tuple(f for f in self.findings if f.code not in codes), self.cup)


# Words.


def _at(finding: Finding) -> str:
    return "" if finding.time is None else f" at {1e3 * finding.time:.0f} ms"


def _landing(finding: Finding) -> str:
    if finding.body == "angle":
        error, allowed = (math.degrees(value) for value in (finding.value, finding.limit))
        return f"lands {error:.2f} deg off the target's angle, tolerance {allowed:g} deg"
    error, allowed = 1e3 * finding.value, 1e3 * finding.limit
    return f"lands {error:.2f} mm from the target, tolerance {allowed:g} mm"


def _bound(name: str, unit: str, digits: int = 2) -> Callable[[Finding], str]:
    """A value outside a lower or an upper bound."""

    def words(finding: Finding) -> str:
        allowed = "at least" if finding.value < finding.limit else "at most"
        value = f"{finding.value:.{digits}f} {unit}"
        return f"{name} {value}, must be {allowed} {finding.limit:g} {unit}"

    return words


def _joint(name: str, unit: str) -> Callable[[Finding], str]:
    def words(finding: Finding) -> str:
        value = f"{finding.value:.4g} {unit}{_at(finding)}"
        return f"{finding.body} {name}: {value}, limit {finding.limit:.4g} {unit}"

    return words


def _slip(finding: Finding) -> str:
    """The grip's friction used up, or less of it left than the scene asks for."""
    if finding.reserve:
        left, asked = 100 * (1 - finding.value), 100 * (1 - finding.limit)
        return (
            f"grip before the opening: {left:.1f} % of its friction limit are left{_at(finding)}, "
            f"{asked:g} % are asked for, or lower [gripper] sticking_margin to accept it"
        )
    return (
        f"slips under full grip before the opening: {100 * finding.value:.0f} % of the friction "
        f"limit{_at(finding)}"
    )


def _collision(finding: Finding) -> str:
    if not finding.other.startswith(("obstacle", "floor", "bin wall")):
        return f"{finding.body} meets {finding.other}{_at(finding)}"
    if finding.value <= 0.0:
        return f"{finding.other}: {finding.body} meets it{_at(finding)}"
    distance = f"{finding.body} {1e3 * finding.value:.0f} mm away{_at(finding)}"
    return f"{finding.other}: {distance}, must be at least {1e3 * finding.limit:g} mm"


def _distance(name: str) -> Callable[[Finding], str]:
    def words(finding: Finding) -> str:
        if finding.value <= 0.0:
            return f"{name}: {finding.body} touches it{_at(finding)}"
        distance = f"{finding.body} {1e3 * finding.value:.1f} mm away{_at(finding)}"
        return f"{name}: {distance}, must be at least {1e3 * finding.limit:g} mm"

    return words


#: Names of limits that differ from their code's.
_LIMITS = {
    Code.CARRY: "grip while carrying",
    Code.SLIP_BEFORE_OPENING: "grip while carrying",
    Code.COLUMN: "base column",
    Code.CUP_MISSED: "cup depth",
    Code.CUP_WALL: "cup clearance",
    Code.BIN_MISSED: "bin",
    Code.BIN_WALL: "bin clearance",
}
_OF_A_JOINT = {*JOINT_LIMITS.values(), Code.TORQUE}
#: Sentences of the codes; a finding of another code has its sentence in its note.
_SENTENCES: dict[Code, Callable[[Finding], str]] = {
    Code.LANDING: _landing,
    Code.NO_LANDING: lambda f: "the object never falls to the target's height",
    Code.GRAZING: lambda f: (
        f"the object falls through the target's height at only {f.value:.3f} m/s, must be at least "
        f"{f.limit:g} m/s: its landing place is uncertain"
    ),
    Code.LANDING_SPEED: _bound("landing speed:", "m/s"),
    Code.LANDING_RATE: _bound("landing rate:", "rad/s"),
    Code.ARRIVAL: _bound("arrival: lands at", "s", 4),
    Code.SLIP_BEFORE_OPENING: _slip,
    Code.CARRY: lambda f: (
        f"grip on the way, {f.body}: {100 * f.value:.0f} % of what the pads' force holds{_at(f)}"
    ),
    Code.JOINT_POSITION: _joint("position", "rad"),
    Code.JOINT_VELOCITY: _joint("velocity", "rad/s"),
    Code.JOINT_ACCELERATION: _joint("acceleration", "rad/s^2"),
    Code.JOINT_JERK: _joint("jerk", "rad/s^3"),
    Code.TOOL_SPEED: lambda f: (
        f"tool speed: {f.value:.3f} m/s{_at(f)}, must be at most {f.limit:g} m/s"
    ),
    Code.TORQUE: lambda f: (
        f"torque of {f.body}: {100 * f.value:.1f} % of its limit{_at(f)}, must be at most "
        f"{100 * f.limit:g} %" + (", or lower [torque] margin to accept it" if f.reserve else "")
    ),
    Code.TORQUE_RATE: lambda f: (
        f"torque rate of the motion's commands: {f.value:,.0f} N m/s, must be at most "
        f"{f.limit:,.0f} N m/s"
    ),
    Code.FLOOR: lambda f: f"floor: {f.body} {1e3 * (f.limit - f.value):.0f} mm below it{_at(f)}",
    Code.COLUMN: _distance("base column"),
    Code.PALM: _distance("palm"),
    Code.COLLISION: _collision,
    Code.CUP_MISSED: lambda f: "cup: the bar does not get deep enough into it",
    Code.CUP_WALL: lambda f: (
        f"cup clearance: {1e3 * f.value:.1f} mm, must be at least {1e3 * f.limit:g} mm"
    ),
    Code.BIN_MISSED: lambda f: "bin: the object does not come down through its rim",
    Code.BIN_WALL: lambda f: (
        f"bin clearance: {1e3 * f.value:.1f} mm, must be at least {1e3 * f.limit:g} mm"
    ),
}
