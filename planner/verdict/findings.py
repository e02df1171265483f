"""Codes of what a throw may break, findings, verdicts, and their sentences."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from ...problems.files import plain


class Code(Enum):
    """The subject of a finding; the value is its name in JSON."""

    LANDING = "landing"
    NO_LANDING = "no_landing"
    GRAZING = "grazing"
    LANDING_SPEED = "landing_speed"
    LANDING_RATE = "landing_rate"
    ARRIVAL = "arrival"
    RELEASE = "release"
    SLIP_BEFORE_OPENING = "slip_before_opening"
    JOINT_POSITION = "joint_position"
    JOINT_VELOCITY = "joint_velocity"
    JOINT_ACCELERATION = "joint_acceleration"
    JOINT_JERK = "joint_jerk"
    TOOL_SPEED = "tool_speed"
    TORQUE = "torque"
    KINEMATICS = "kinematics"
    FLOOR = "floor"
    COLUMN = "column"
    PALM = "palm"
    COLLISION = "collision"
    CUP_MISSED = "cup_missed"
    CUP_WALL = "cup_wall"
    MODELS_DIFFER = "models_differ"
    UNCERTAIN = "uncertain"

    @property
    def cure(self) -> str:
        """What a user may change to avoid it."""
        return _CURES[self]

    @property
    def fate(self) -> str:
        """What throws that break it do, to follow "34 % ..."."""
        return _FATES[self]


#: Codes of a joint's limits by the names of `check.KINDS`.
JOINT_LIMITS = {
    "position": Code.JOINT_POSITION,
    "velocity": Code.JOINT_VELOCITY,
    "acceleration": Code.JOINT_ACCELERATION,
    "jerk": Code.JOINT_JERK,
}


@dataclass(frozen=True)
class Finding:
    """Something that a throw breaks, or a warning about it.

    value, limit: what was found and what is allowed, SI units. time [s]: on the motion's clock,
    None without an instant. body: joint, link or part of the throw; other: what a body meets.
    broken: False for a warning. note: the sentence, for codes that have none of their own.
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
        return _SENTENCES[self.code](self)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians."""
        found = {
            "code": self.code.value,
            "broken": self.broken,
            "value": self.value,
            "limit": self.limit,
            "time": self.time,
            "body": self.body or None,
            "other": self.other or None,
            "words": self.words,
        }
        made: dict[str, Any] = plain(found)
        return made


@dataclass(frozen=True)
class Verdict:
    """All findings about a throw; cup: whether a cup says where the object is to go."""

    findings: tuple[Finding, ...] = ()
    cup: bool = False

    @property
    def broken(self) -> tuple[Finding, ...]:
        """The findings that are not warnings."""
        return tuple(finding for finding in self.findings if finding.broken)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that break nothing."""
        return tuple(finding for finding in self.findings if not finding.broken)

    @property
    def ok(self) -> bool:
        """Whether nothing is broken: what `solved` means."""
        return not self.broken

    @property
    def succeeds(self) -> bool:
        """Whether the throw does its task; a sweep counts it.

        It breaks nothing; a throw into a cup may miss its target pose.
        """
        return self.without(Code.LANDING).ok if self.cup else self.ok

    @property
    def codes(self) -> frozenset[Code]:
        """The codes of what is broken."""
        return frozenset(finding.code for finding in self.broken)

    @property
    def words(self) -> str:
        """Sentences about what is broken; empty without any."""
        return "; ".join(finding.words for finding in self.broken)

    def without(self, *codes: Code) -> Verdict:
        """The verdict without findings of these codes."""
        return Verdict(tuple(f for f in self.findings if f.code not in codes), self.cup)


# Words.


def _at(finding: Finding) -> str:
    return "" if finding.time is None else f" at {1e3 * finding.time:.0f} ms"


def _landing(found: Finding) -> str:
    if found.body == "angle":
        off, most = (math.degrees(value) for value in (found.value, found.limit))
        return f"lands {off:.2f} deg off the target's angle, tolerance {most:g} deg"
    off, most = 1e3 * found.value, 1e3 * found.limit
    return f"lands {off:.2f} mm from the target, tolerance {most:g} mm"


def _bound(name: str, unit: str) -> Callable[[Finding], str]:
    """A value outside a lower or an upper bound."""

    def words(found: Finding) -> str:
        allowed = "at least" if found.value < found.limit else "at most"
        return f"{name}: {found.value:.2f} {unit}, must be {allowed} {found.limit:g} {unit}"

    return words


def _joint(name: str, unit: str) -> Callable[[Finding], str]:
    def words(found: Finding) -> str:
        value = f"{found.value:.4g} {unit}{_at(found)}"
        return f"{found.body} {name}: {value}, limit {found.limit:.4g} {unit}"

    return words


def _collision(found: Finding) -> str:
    away = found.value
    near = f"comes as near as {1e3 * away:.0f} mm" if away > 0 else "meets it"
    if found.other.startswith(("obstacle", "floor")):
        return f"{found.other}: {found.body} {near}{_at(found)}"
    return f"{found.body} meets {found.other}{_at(found)}"


def _distance(name: str, what: str) -> Callable[[Finding], str]:
    def words(found: Finding) -> str:
        away = f"comes as near as {1e3 * found.value:.1f} mm" if found.value > 0 else what
        return f"{name}: {found.body} {away}{_at(found)}"

    return words


_SENTENCES: dict[Code, Callable[[Finding], str]] = {
    Code.LANDING: _landing,
    Code.NO_LANDING: lambda f: "the object never comes down to the target's height",
    Code.GRAZING: lambda f: (
        f"the object comes down to the target's height at only {f.value:.3f} m/s: "
        "its landing place is uncertain"
    ),
    Code.LANDING_SPEED: _bound("landing speed", "m/s"),
    Code.LANDING_RATE: _bound("landing rate", "rad/s"),
    Code.ARRIVAL: lambda f: f"arrival: lands at {f.value:.3f} s, must be at most {f.limit:g} s",
    Code.RELEASE: lambda f: f.note,
    Code.SLIP_BEFORE_OPENING: lambda f: (
        f"slips in the full grip: {100 * f.value:.0f} % of its friction{_at(f)}, before it opens"
    ),
    Code.JOINT_POSITION: _joint("position", "rad"),
    Code.JOINT_VELOCITY: _joint("velocity", "rad/s"),
    Code.JOINT_ACCELERATION: _joint("acceleration", "rad/s^2"),
    Code.JOINT_JERK: _joint("jerk", "rad/s^3"),
    Code.TOOL_SPEED: lambda f: (
        f"tool speed: {f.value:.3f} m/s{_at(f)}, must be at most {f.limit:g} m/s"
    ),
    Code.TORQUE: lambda f: f"torque of {f.body}: {100 * f.value:.0f} % of its limit{_at(f)}",
    Code.KINEMATICS: lambda f: (
        f"the joints hold the hand {1e3 * f.value:.3g} mm off the planar model"
    ),
    Code.FLOOR: lambda f: f"floor: {f.body} {1e3 * (f.limit - f.value):.0f} mm below it{_at(f)}",
    Code.COLUMN: _distance("base column", "touches it"),
    Code.PALM: _distance("palm", "touches it"),
    Code.COLLISION: _collision,
    Code.CUP_MISSED: lambda f: "cup: the bar does not get deep enough into it",
    Code.CUP_WALL: lambda f: (
        f"cup clearance: {1e3 * f.value:.1f} mm, must be at least {1e3 * f.limit:g} mm"
    ),
    Code.MODELS_DIFFER: lambda f: f.note,
    Code.UNCERTAIN: lambda f: f.note,
}

_FATES: dict[Code, str] = {
    Code.LANDING: "land outside the tolerance",
    Code.NO_LANDING: "never come down to the target's height",
    Code.GRAZING: "only graze the target's height",
    Code.LANDING_SPEED: "land too fast or too slow",
    Code.LANDING_RATE: "land turning too fast",
    Code.ARRIVAL: "land too late",
    Code.RELEASE: "slide out of the pads",
    Code.SLIP_BEFORE_OPENING: "slip in the full grip before it opens",
    Code.JOINT_POSITION: "leave a joint's range",
    Code.JOINT_VELOCITY: "exceed a joint's velocity",
    Code.JOINT_ACCELERATION: "exceed a joint's acceleration",
    Code.JOINT_JERK: "exceed a joint's jerk",
    Code.TOOL_SPEED: "exceed the tool's speed",
    Code.TORQUE: "need more torque than a joint has",
    Code.KINEMATICS: "have joints that do not fit the planar model",
    Code.FLOOR: "touch the floor",
    Code.COLUMN: "touch the base column",
    Code.PALM: "touch the palm",
    Code.COLLISION: "meet an obstacle, or the arm itself",
    Code.CUP_MISSED: "miss the cup",
    Code.CUP_WALL: "touch the cup's wall or rim",
    Code.MODELS_DIFFER: "land elsewhere by another model",
    Code.UNCERTAIN: "use up a reserve",
}

_LESS = "a nearer or higher target, another angle, or a faster arm"
_CURES: dict[Code, str] = {
    Code.LANDING: "plan again, or a larger [tolerance]",
    Code.NO_LANDING: "a lower target",
    Code.GRAZING: "a target below the top of the flight",
    Code.LANDING_SPEED: "the bounds in [landing]",
    Code.LANDING_RATE: "the bounds in [landing]",
    Code.ARRIVAL: "a later [target] arrival",
    Code.RELEASE: "a stronger grip, a shorter [gripper] opening",
    Code.SLIP_BEFORE_OPENING: "raise [gripper] force or sticking_margin",
    Code.JOINT_POSITION: _LESS,
    Code.JOINT_VELOCITY: _LESS,
    Code.JOINT_ACCELERATION: _LESS,
    Code.JOINT_JERK: _LESS,
    Code.TOOL_SPEED: "a nearer target, or a larger [robot] tool_speed if the robot allows it",
    Code.TORQUE: "a lighter object, or larger limits in [torque] if the robot allows them",
    Code.KINEMATICS: "the arm's data: its planar model and its frames differ",
    Code.FLOOR: "a lower [workspace] floor, another start",
    Code.COLUMN: "another target angle, less [workspace] column",
    Code.PALM: "another target angle, less [workspace] palm_clearance",
    Code.COLLISION: "another target angle, less clearance of the obstacle",
    Code.CUP_MISSED: "a wider cup, less insertion, an angle nearer -90 deg",
    Code.CUP_WALL: "a wider cup, less clearance or insertion, an angle nearer -90 deg",
    Code.MODELS_DIFFER: "a quiet release (--robust quiet)",
    Code.UNCERTAIN: "the reserve that the finding names",
}
