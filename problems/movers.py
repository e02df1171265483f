"""What moves the hand: a free planar hand, an arm, or a motion that is given."""

from __future__ import annotations

import dataclasses
import itertools
import math

from ..models import Arm
from .errors import InputError
from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Hand(Section):
    """A hand that moves by itself in the plane, within boxes per axis.

    x, z [m] and theta [rad]: [lowest, highest] position; speed [m/s] and acceleration
    [m/s^2] per axis; angular_speed [rad/s], angular_acceleration [rad/s^2]. Without
    the angular keys the hand does not turn and keeps `theta[0]`. start: (x, z) or
    (x, z, theta in degrees in the file) at rest; free where absent.
    """

    x: tuple[float, float]
    z: tuple[float, float]
    speed: float = quantity(above=0, most=1e3)
    acceleration: float = quantity(above=0, most=1e5)
    theta: tuple[float, float] = quantity(degrees=True, default=(0.0, 0.0))
    angular_speed: float | None = quantity(above=0, most=1e3, default=None)
    angular_acceleration: float | None = quantity(above=0, most=1e5, default=None)
    start: tuple[float, float] | None = None
    start_theta: float | None = quantity(degrees=True, default=None)

    @property
    def turns(self) -> bool:
        """Whether the hand's angle is planned too."""
        return self.angular_speed is not None

    def check(self) -> None:
        """Ranges the right way round, both angular limits or none, start inside."""
        for name in ("x", "z", "theta"):
            low, high = getattr(self, name)
            if low > high or (low == high and name != "theta"):
                key, shown = name, [low, high]
                if name == "theta":
                    key, shown = "theta_deg", [round(math.degrees(v), 6) for v in (low, high)]
                raise InputError(f"{key} = {shown}: must be [lowest, highest]")
        if (self.angular_speed is None) != (self.angular_acceleration is None):
            raise InputError("angular_speed and angular_acceleration: give both or neither")
        if self.turns and self.theta[0] == self.theta[1]:
            raise InputError("theta_deg: a hand that turns needs [lowest, highest]")
        if (self.start_theta is not None) and (self.start is None or not self.turns):
            raise InputError("start_theta_deg: needs 'start' and a hand that turns")
        if self.start and self.turns and self.start_theta is None:
            raise InputError("key 'start_theta_deg' is missing beside 'start'")
        start = dict(zip("xz", self.start or (), strict=False)) | {"theta": self.start_theta}
        for name, value in start.items():
            low, high = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise InputError(_outside(name, value, low, high))


def _outside(name: str, value: float, low: float, high: float) -> str:
    """Words for a start outside a hand's range."""
    key = f"start: {name}"
    if name == "theta":
        key = "start_theta_deg"
        value, low, high = map(math.degrees, (value, low, high))
    return f"{key} = {value:g}: must be within [{low:g}, {high:g}]"


@dataclasses.dataclass(frozen=True)
class Robot(Section):
    """A serial arm that throws in a vertical plane through its base axis.

    arm: a shipped arm's name or an arm data file. start [rad]: the throwing joints at
    rest before the throw; free where absent. control: 'jerk' plans with continuous
    acceleration, 'acceleration' with steps that are smoothed afterwards. The margins
    are shares of the limits kept back for smoothing and correction; position_margin
    is in rad.
    """

    arm: str
    start: tuple[float, ...] | None = quantity(degrees=True, default=None)
    throwing_joints: tuple[int, ...] | None = None
    control: str = quantity(choices=("jerk", "acceleration"), default="jerk")
    position_margin: float = quantity(least=0, below=0.5, default=0.01)
    velocity_margin: float = quantity(least=0, below=0.9, default=0.01)
    acceleration_margin: float = quantity(least=0, below=0.9, default=0.02)
    jerk_margin: float = quantity(least=0, below=0.9, default=0.05)


def thrown_by(robot: Robot, arm: Arm) -> tuple[int, ...]:
    """The throwing joints: the scene's, else the arm's."""
    return arm.throwing_joints if robot.throwing_joints is None else robot.throwing_joints


def check_robot(robot: Robot, arm: Arm) -> None:
    """InputError for throwing joints or a start that the arm does not have."""
    joints = thrown_by(robot, arm)
    if not joints:
        raise InputError("[robot] throwing_joints = []: must name at least one joint")
    for joint in joints:
        if not 1 <= joint <= arm.joints or joint == arm.azimuth_joint or joints.count(joint) > 1:
            raise InputError(
                f"[robot] throwing_joints = {list(joints)}: each must be another of 1 to "
                f"{arm.joints} and not the azimuth joint {arm.azimuth_joint}"
            )
    if robot.start is None:
        return
    if len(robot.start) != len(joints):
        given = [round(math.degrees(angle), 6) for angle in robot.start]
        raise InputError(f"[robot] start_deg = {given}: must be a list of {len(joints)} angles")
    for joint, angle in zip(joints, robot.start, strict=True):
        low, high = (
            arm.limits.position_min[joint - 1],
            arm.limits.position_max[joint - 1],
        )
        if not low <= angle <= high:
            raise InputError(
                f"[robot] start_deg: joint {joint} at {math.degrees(angle):.1f} is outside "
                f"[{math.degrees(low):.1f}, {math.degrees(high):.1f}]"
            )


@dataclasses.dataclass(frozen=True)
class Motion(Section):
    """A given hand motion for `simulate`.

    Constant acceleration from the opening's start: position (x, z) [m], angle [rad],
    velocity [m/s], rate [rad/s], acceleration [m/s^2], angular_acceleration [rad/s^2].
    Or pieces of it: accelerations (a_x, a_z, alpha) from `times` [s] on, the first 0.
    Or samples: `table`, a CSV with columns t, x, z, theta; or `joints`, a CSV with t and
    q1, q2, ... of the `arm`, low-passed at `cutoff` [Hz] without phase shift; then
    opening_time is the time in the file at which the force starts to fall.
    """

    position: tuple[float, float] = (0.0, 0.0)
    angle: float = quantity(degrees=True, default=0.0)
    velocity: tuple[float, float] = quantity(least=-1e3, most=1e3, default=(0.0, 0.0))
    rate: float = quantity(least=-1e4, most=1e4, default=0.0)
    acceleration: tuple[float, float] = quantity(least=-1e5, most=1e5, default=(0.0, 0.0))
    angular_acceleration: float = quantity(least=-1e5, most=1e5, default=0.0)
    times: tuple[float, ...] = ()
    accelerations: tuple[tuple[float, float, float], ...] = ()
    table: str | None = None
    joints: str | None = None
    arm: str | None = None
    opening_time: float = 0.0
    cutoff: float = quantity(above=0, default=35.0)
    samples: tuple[tuple[float, ...], ...] = ()

    def check(self) -> None:
        """One kind of motion; as many pieces as times; samples that rise in time."""
        constant = any(self.acceleration) or self.angular_acceleration != 0.0
        sampled = self.table is not None or self.joints is not None
        if (constant and (self.accelerations or sampled)) or (self.accelerations and sampled):
            raise InputError("give one of acceleration, accelerations, table and joints")
        if self.table is not None and self.joints is not None:
            raise InputError("give one of 'table' and 'joints'")
        if (self.joints is None) != (self.arm is None):
            raise InputError("joints and arm: give both or neither")
        if len(self.times) != len(self.accelerations):
            raise InputError(
                f"times: has {len(self.times)} entries, accelerations has {len(self.accelerations)}"
            )
        rows = [row[0] for row in self.samples]
        if any(b <= a for a, b in itertools.pairwise(rows)):
            raise InputError(f"{'table' if self.table else 'joints'}: t must rise from row to row")
