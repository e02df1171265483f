"""The limits that hold a throw short of its target, in words of the scene; bounds that prove that
nothing reaches it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

#: What the message of a plan without a throw says if its time ended before its starts.
CUT_SHORT = "patience cut the search"
#: Key of the scene, and what to do about it, by the end of a limit's name.
ADVICE = {
    "position": ("[limits] position", "another start, arm or target"),
    "velocity": ("[limits] velocity", "a nearer target or a faster arm"),
    "acceleration": ("[limits] acceleration", "a nearer target or a faster arm"),
    "jerk": ("[limits] jerk", "a nearer target or a faster arm"),
    "room to brake": ("[limits] position", "a start that swings the other way"),
    "tool speed": ("[robot] tool_speed", "raise [robot] tool_speed if the robot allows"),
    "torque": ("[torque] margin", "a lighter object or a smaller [torque] margin"),
    "torque rate": ("[torque] rate", "raise [torque] rate if the robot allows"),
    "grip while carrying": ("[gripper] force", "raise [gripper] force, or lower sticking_margin"),
    "release": ("[gripper] opening", "a shorter [gripper] opening"),
    "carry time": ("[nlp] carry_max", "raise [nlp] carry_max"),
    "flight time": ("[target] z", "a higher target"),
    "coming down": ("[target] z", "a lower target"),
    "no landing": ("[target] z", "a lower target"),
    "grazing": ("[target] z", "a target below the top of the flight"),
    "arrival": ("[target] arrival", "a later [target] arrival"),
    "landing": ("[target] theta", "another target"),
    "landing speed": ("[landing] speed_max", "wider bounds in [landing]"),
    "landing rate": ("[landing] rate_max", "wider bounds in [landing]"),
    "cup depth": ("[cup] insertion", "less [cup] insertion"),
    "cup clearance": ("[cup] clearance", "a wider cup, less [cup] clearance"),
    "bin": ("[bin] x", "a larger bin, a nearer or lower one"),
    "bin clearance": ("[bin] clearance", "a larger bin, less [bin] clearance"),
    "collision": ("[[obstacle]] clearance", "another angle, or move the obstacle"),
    "floor": ("[workspace] floor", "lower [workspace] floor"),
    "base column": ("[workspace] column_radius", "another angle, a smaller column"),
    "palm": ("[workspace] palm_clearance", "another angle, less palm_clearance"),
    "sent motion": ("[limits] jerk", "a nearer target or a faster arm"),
}


@dataclass(frozen=True)
class ActiveLimit:
    """A limit, the key of the scene (or of its arm's file) that sets it, and advice."""

    limit: str
    key: str
    advice: str

    @classmethod
    def of(cls, limit: str, own: Collection[str] = ()) -> ActiveLimit:
        """That of a limit's name, such as "joint 4 velocity"; `own`: names of own constraints."""
        known = [] if limit in own else sorted(ADVICE, key=len, reverse=True)
        end = next((name for name in known if limit.endswith(name)), "")
        key, advice = ADVICE.get(end, ("", "wider bounds of it"))
        if limit.startswith("hand "):
            key = key.replace("[limits]", "[hand]")
        return cls(limit, key, advice)

    def to_dict(self) -> dict[str, str]:
        """As JSON."""
        return asdict(self)


def binding_words(binding: Sequence[ActiveLimit]) -> str:
    """Limits with their advice; limits with one advice together."""
    alike: dict[str, list[str]] = {}
    for one in binding:
        alike.setdefault(one.advice, []).append(one.limit)
    return "; ".join(f"{', '.join(limits)}: {advice}" for advice, limits in alike.items())


@dataclass(frozen=True)
class Bound:
    """A bound that a target exceeds: the limit, its formula in words, its value [m]."""

    limit: str
    formula: str
    value: float

    @property
    def words(self) -> str:
        """The bound as a sentence."""
        return f"{self.limit} {self.value:.2f} m: {self.formula}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)
