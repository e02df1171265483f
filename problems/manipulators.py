"""Motion of the hand: a free planar hand, an arm with its torques, or a given motion."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import ClassVar

from ..models.robot import Arm
from .checks import InputError
from .section import Section, optional, quantity


@dataclasses.dataclass(frozen=True)
class Hand(Section):
    """A hand that moves by itself in the plane, within boxes per axis. Exactly one of [hand],
    [robot] and [motion] is given.
    """

    x: tuple[float, float] = quantity("m, lowest and highest position")
    z: tuple[float, float] = quantity("m, lowest and highest position")
    speed: float = quantity("m/s, each axis", above=0, most=1e3)
    acceleration: float = quantity("m/s², each axis", above=0, most=1e5)
    theta: tuple[float, float] = quantity(
        "degrees, lowest and highest; of a hand without rotation one angle, twice",
        degrees=True,
        default=(0.0, 0.0),
    )
    angular_speed: float | None = optional(
        "rad/s; left out: no rotation of the hand", above=0, most=1e3
    )
    angular_acceleration: float | None = optional("rad/s²; with `angular_speed`", above=0, most=1e5)
    jerk: float | None = optional(
        "m/s³, each axis; left out: 100 1/s times `acceleration`", above=0, most=1e9
    )
    angular_jerk: float | None = optional(
        "rad/s³; left out: 100 1/s times `angular_acceleration`", above=0, most=1e9
    )
    start: tuple[float, float] | None = optional(
        "m, x and z at rest before the throw; left out: free"
    )
    start_theta: float | None = optional(
        "degrees, at rest; with `start`, for a hand with rotation", degrees=True
    )

    @property
    def turns(self) -> bool:
        """Whether the hand's angle is a coordinate."""
        return self.angular_speed is not None

    def check(self) -> None:
        """Low limits are below high ones, angular limits are complete, the start is inside."""
        for name in ("x", "z", "theta"):
            low, high = getattr(self, name)
            if low > high or (low == high and name != "theta"):
                key, ends = name, [low, high]
                if name == "theta":
                    key, ends = "theta_deg", [round(math.degrees(v), 6) for v in (low, high)]
                raise InputError(f"{key} = {ends}: must be [lowest, highest]")
        if (self.angular_speed is None) != (self.angular_acceleration is None):
            raise InputError("angular_speed and angular_acceleration: give both or neither")
        if self.angular_jerk is not None and not self.turns:
            raise InputError("angular_jerk: only with angular_speed")
        if self.turns and self.theta[0] == self.theta[1]:
            raise InputError("theta_deg: a hand that turns needs [lowest, highest]")
        if not self.turns and self.theta[0] != self.theta[1]:
            ends = [round(math.degrees(v), 6) for v in self.theta]
            raise InputError(f"theta_deg = {ends}: must be one angle twice without angular_speed")
        if (self.start_theta is not None) and (self.start is None or not self.turns):
            raise InputError("start_theta_deg: needs 'start' and a hand that turns")
        if self.start and self.turns and self.start_theta is None:
            raise InputError("key 'start_theta_deg' is missing beside 'start'")
        start = dict(zip("xz", self.start or (), strict=False)) | {"theta": self.start_theta}
        for name, value in start.items():
            low, high = getattr(self, name)
            if value is not None and not low <= value <= high:
                turn = name == "theta"
                key, unit = ("start_theta_deg", math.degrees(1)) if turn else (f"start: {name}", 1)
                raise InputError(
                    f"{key} = {unit * value:g}: must be within [{unit * low:g}, {unit * high:g}]"
                )


@dataclasses.dataclass(frozen=True)
class Robot(Section):
    """A serial arm that throws in a vertical plane through its base axis. Exactly one of [hand],
    [robot] and [motion] is given.
    """

    arm: str = quantity(
        "name of a shipped arm, or an arm data file (.toml, seen from the scene's folder)"
    )
    start: tuple[float, ...] | None = optional(
        "degrees, the throwing joints at rest before the throw; left out: free, and the least "
        "effort may be a mere drop",
        degrees=True,
    )
    throwing_joints: tuple[int, ...] | None = optional(
        "joints that throw; the arm's own where left out"
    )
    tool_speed: float | None = optional(
        "m/s, highest speed of the arm's flange and of the pads' centre; the arm's own where left "
        "out",
        above=0,
        most=1e3,
    )
    position_margin: float = quantity(
        "rad, margin at both ends of a joint's range", least=0, below=0.5, default=0.01
    )
    velocity_margin: float = quantity(
        "margin for smoothing and correction, as a share of the limit",
        least=0,
        below=0.9,
        default=0.01,
    )
    acceleration_margin: float = quantity(
        "margin as for velocity, as a share of the limit", least=0, below=0.9, default=0.02
    )
    jerk_margin: float = quantity(
        "margin as for velocity, as a share of the limit", least=0, below=0.9, default=0.05
    )


def thrown_by(robot: Robot, arm: Arm) -> tuple[int, ...]:
    """The throwing joints: the scene's, else the arm's.

    InputError for joints or a start that the arm does not have.
    """
    joints = arm.throwing_joints if robot.throwing_joints is None else robot.throwing_joints
    if not joints:
        raise InputError("[robot] throwing_joints = []: must name at least one joint")
    for joint in joints:
        if not 1 <= joint <= arm.joints or joint == arm.azimuth_joint or joints.count(joint) > 1:
            raise InputError(
                f"[robot] throwing_joints = {list(joints)}: each must be another of 1 to "
                f"{arm.joints} and not the azimuth joint {arm.azimuth_joint}"
            )
    if robot.start is not None:
        check_angles("[robot] start_deg", robot.start, joints, arm)
    return joints


def check_angles(key: str, angles: Sequence[float], joints: Sequence[int], arm: Arm) -> None:
    """InputError for another number of angles [rad] than of these joints, and outside their
    range."""
    if len(angles) != len(joints):
        given = [round(math.degrees(angle), 6) for angle in angles]
        raise InputError(f"{key} = {given}: must be a list of {len(joints)} angles")
    for joint, angle in zip(joints, angles, strict=True):
        low, high = arm.limits.position_min[joint - 1], arm.limits.position_max[joint - 1]
        if not low <= angle <= high:
            raise InputError(
                f"{key}: joint {joint} at {math.degrees(angle):.1f} is outside "
                f"[{math.degrees(low):.1f}, {math.degrees(high):.1f}]"
            )


@dataclasses.dataclass(frozen=True)
class Torque(Section):
    """Limits of the throwing joints' torques, by inverse dynamics, with the object in the hand and
    without, in place of the arm's own. Only with [robot], and an arm whose data hold link masses.

    Limits of the arm enter the NLP after a throw has broken them; with this section they are in the
    NLP from the start. The torques neglect friction and rotors of the drives, and the joints that
    hold the posture. The rate lowers the jerk limits of all throwing joints by one factor, by which
    the inertia of the arm takes 85 % of it at the worst of 500 random poses; the verdict
    checks the rate itself.
    """

    #: Margin where neither scene nor arm gives one.
    MARGIN: ClassVar[float] = 0.1

    limits: tuple[float, ...] | None = optional(
        "N m, one per throwing joint; the arm's own where left out", above=0, most=1e6
    )
    rate: float | None = optional(
        "N m/s, most change of any throwing joint's torque by the motion's commands, the object's "
        "load fading linearly as the pads open; the arm's own where left out",
        above=0,
        most=1e9,
    )
    margin: float | None = optional(
        "share of the limits that no throw uses; left out: the arm's own, else 0.1",
        least=0,
        below=0.9,
    )

    def of(self, arm: Arm, throwing_joints: tuple[int, ...]) -> tuple[float, ...]:
        """Limits of the throwing joints [N m], without margin."""
        if self.limits is not None:
            return self.limits
        return tuple(arm.limits.torque[joint - 1] for joint in throwing_joints)


def check_torque(torque: Torque | None, robot: Robot | None, arm: Arm | None) -> None:
    """InputError for a scene without arm, an arm without masses, too few or many limits."""
    if torque is None:
        return
    if robot is None or arm is None:
        raise InputError("[torque]: only for a scene with [robot]")
    if not arm.links:
        raise InputError(f"[torque]: arm {arm.name} has no link masses ('links' in its data file)")
    count = len(arm.throwing_joints)
    if torque.limits is not None and len(torque.limits) != count:
        raise InputError(f"[torque] limits = {list(torque.limits)}: must be a list of {count}")


@dataclasses.dataclass(frozen=True)
class Motion(Section):
    """A given hand motion for `simulate`. Exactly one of [hand], [robot] and [motion] is given.
    One of `acceleration` (with `angular_acceleration`), `accelerations` (with `times`), `table`
    and `joints` (with `arm`); none of them is constant velocity.
    """

    position: tuple[float, float] = quantity(
        "m, x and z of the hand at the start of the opening", default=(0.0, 0.0)
    )
    angle: float = quantity("degrees, angle of the hand at that time", degrees=True, default=0.0)
    velocity: tuple[float, float] = quantity(
        "m/s, x and z at that time", least=-1e3, most=1e3, default=(0.0, 0.0)
    )
    rate: float = quantity(
        "rad/s, angular velocity at that time", least=-1e4, most=1e4, default=0.0
    )
    acceleration: tuple[float, float] = quantity(
        "m/s², x and z, constant", least=-1e5, most=1e5, default=(0.0, 0.0)
    )
    angular_acceleration: float = quantity("rad/s², constant", least=-1e5, most=1e5, default=0.0)
    times: tuple[float, ...] = quantity(
        "s, start of each row of `accelerations`; the first is 0", default=()
    )
    accelerations: tuple[tuple[float, float, float], ...] = quantity(
        "rows a_x, a_z [m/s²], alpha [rad/s²]", default=()
    )
    table: str | None = optional("a CSV file with the columns t, x, z, theta (s, m, rad)")
    joints: str | None = optional("a CSV file with the columns t, q1, q2, ... (s, rad) of `arm`")
    arm: str | None = optional("as in [robot]; with `joints`")
    opening_time: float = quantity(
        "s, time in `table` or `joints` at which the force starts to fall", most=1e10, default=0.0
    )
    cutoff: float = quantity(
        "Hz, low-pass of the samples, without phase shift", above=0, default=35.0
    )
    samples: tuple[tuple[float, ...], ...] = quantity(
        "the rows of `table` or `joints`, in the file itself", default=()
    )

    def check(self) -> None:
        """There is one kind of motion, a piece for each time, and samples rise in time."""
        constant = any(self.acceleration) or self.angular_acceleration != 0.0
        sampled = self.table is not None or self.joints is not None
        if (constant and (self.accelerations or sampled)) or (self.accelerations and sampled):
            raise InputError("give one of acceleration, accelerations, table and joints")
        if self.table is not None and self.joints is not None:
            raise InputError("give one of 'table' and 'joints'")
        if sampled and any((*self.position, self.angle, *self.velocity, self.rate)):
            raise InputError("position, angle, velocity and rate: not beside 'table' or 'joints'")
        for key in ("opening_time", "cutoff"):
            if not (sampled or self.samples) and getattr(self, key) != getattr(Motion, key):
                raise InputError(f"{key}: only with 'table' or 'joints'")
        if (self.joints is None) != (self.arm is None):
            raise InputError("joints and arm: give both or neither")
        if len(self.times) != len(self.accelerations):
            raise InputError(
                f"times: has {len(self.times)} entries, accelerations has {len(self.accelerations)}"
            )
        rows = [row[0] for row in self.samples]
        if any(b <= a for a, b in itertools.pairwise(rows)):
            raise InputError(f"{'table' if self.table else 'joints'}: t must rise from row to row")
