"""[calibration]: where measured throws say that a new one lands, and whether it is like them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ...problems import Calibration, Pose, Scene
from ..throw import Throw
from .findings import Code, Finding

#: Allowed difference of object, grip and contact from those of the measured throws, a share.
SAME = 0.01
#: Allowed speed beyond the measured throws', a share of their largest.
BEYOND = 0.05


@dataclass(frozen=True)
class CalibratedLanding:
    """What a scene's [calibration] says of a throw.

    aim: the pose that the release model's landing, without the bias, is aimed at. setup, speeds:
    what differs from the measured throws, each a text: object, grip and prediction; speeds at
    detach. With any of these the region does not hold.
    """

    calibration: Calibration
    aim: Pose
    setup: tuple[str, ...]
    speeds: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether the throw is like the measured ones."""
        return not self.setup and not self.speeds

    @property
    def words(self) -> str:
        """The region as a sentence; empty where it does not hold."""
        return region_words(self.calibration, self.aim.theta is not None) if self.holds else ""

    @property
    def aim_words(self) -> str:
        """The shifted aim as a sentence."""
        x, theta = self.calibration.bias
        turn = "" if self.aim.theta is None else f" and {math.degrees(theta):+.1f}°"
        return f"aimed at {self.aim.words}: your throws land {1e3 * x:+.1f} mm{turn} off it"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """A warning about a throw unlike the measured ones."""
        if self.holds:
            return ()
        here = "; ".join((*self.setup, *self.speeds))
        note = f"[calibration] does not hold here: {here}: {Code.CALIBRATION.cure}"
        return (Finding(Code.CALIBRATION, math.nan, math.nan, broken=False, note=note),)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians."""
        known = self.calibration
        return {
            "throws": known.throws,
            "level": known.level,
            "bias": dict(zip(("x", "theta"), known.bias, strict=True)),
            "region": {"position": known.position, "angle": known.angle},
            "aim": self.aim.table,
            "holds": self.holds,
        }


def calibrated_landing(throw: Throw, target: Pose) -> CalibratedLanding | None:
    """What [calibration] says of a throw by the deciding model; None without the section."""
    known = throw.scene.calibration
    if known is None:
        return None
    dx, dtheta = known.bias
    start = throw.deciding.release.detach
    speed = math.hypot(start.v_x, start.v_z)
    setup = tuple(unlike_setup(known, throw.scene))
    speeds = tuple(unlike_speeds(known, speed, start.omega))
    return CalibratedLanding(known, target.shifted(-dx, -dtheta), setup, speeds)


def region_words(known: Calibration, angle: bool = True) -> str:
    """The region as a sentence; angle: with that of the landing."""
    turn = f" and {_rounded_up(math.degrees(known.angle))}°" if angle else ""
    return (
        f"by {known.throws} of your throws {100 * known.level:g} % land within "
        f"{_rounded_up(1e3 * known.position)} mm{turn}"
    )


def unlike_setup(known: Calibration, scene: Scene) -> Iterator[str]:
    """Texts about object, grip and prediction that differ from the measured throws'."""
    grip = scene.gripper.profile()
    pairs = {
        "[object] mass": (scene.object.mass, known.mass, "kg"),
        "[object] com": (scene.object.com, known.com, "m"),
        "[gripper] force": (grip.full, known.force, "N"),
        "[gripper] opening": (grip.opening, known.opening, "s"),
        "[contact] friction": (scene.contact.friction, known.friction, ""),
        "[contact] patch_radius": (scene.contact.patch_radius, known.patch_radius, "m"),
        "[contact] torsion": (scene.contact.torsion, known.torsion, ""),
        "[contact] faces": (scene.contact.faces, known.faces, ""),
    }
    for name, (here, there, unit) in pairs.items():
        if abs(here - there) > SAME * there:
            yield f"{name} is {here:.4g} {unit}".rstrip() + f", there {there:.4g} {unit}".rstrip()
    if scene.tolerance.model != known.model:
        yield f"[tolerance] model is {scene.tolerance.model}, there {known.model}"


def unlike_speeds(known: Calibration, speed: float, rate: float) -> Iterator[str]:
    """Texts about speed [m/s] and turning rate [rad/s] at detach beyond the measured throws'."""
    degree = math.degrees(1.0)
    for name, value, (low, high), factor, unit in (
        ("speed", speed, known.speed, 1.0, "m/s"),
        ("turning rate", rate, known.rate, degree, "deg/s"),
    ):
        room = BEYOND * max(abs(low), abs(high))
        if not low - room <= value <= high + room:
            yield (
                f"{name} at detach {factor * value:.3g} {unit}, there {factor * low:.3g} to "
                f"{factor * high:.3g} {unit}"
            )


def _rounded_up(value: float) -> str:
    """A bound with two or more digits, not below it."""
    return f"{math.ceil(value):d}" if value >= 10.0 else f"{math.ceil(10.0 * value) / 10.0:g}"
