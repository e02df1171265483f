"""A scene: what is thrown, what holds it, where it should land. Data only, SI units, radians.

A section that is None is left out of everything: no variable, no constraint.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path
from typing import Any

from ..models.arm import Arm
from ..models.contact import Body, Contact
from ..models.grip_force import GripProfile, LinearRelease, TableRelease
from .errors import InputError
from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Pose(Section):
    """A landing pose of the object's CoM.

    x, y, z [m]; theta [rad, unwrapped], None leaves it open. For a hand scene x is in
    the throw's plane and y is 0; for an arm x, y, z are in the base frame.
    """

    x: float = quantity(least=-1e4, most=1e4)
    z: float = quantity(least=-1e4, most=1e4)
    theta: float | None = quantity(degrees=True, least=-1e4, most=1e4, default=None)
    y: float = quantity(least=-1e4, most=1e4, default=0.0)

    def check(self) -> None:
        """All values finite."""

    @property
    def azimuth(self) -> float:
        """Angle [rad] about the base axis of the vertical plane through the pose."""
        return math.atan2(self.y, self.x) if self.y != 0.0 else 0.0

    @property
    def plane_x(self) -> float:
        """x [m] in that plane."""
        return math.hypot(self.x, self.y) if self.y != 0.0 else self.x

    def in_plane(self, x: float, theta: float | None) -> Pose:
        """The pose at `x` [m] and `theta` [rad] in the same plane and at the same height."""
        turn = self.azimuth
        return dataclasses.replace(self, x=x * math.cos(turn), y=x * math.sin(turn), theta=theta)

    def turned(self, angle: float) -> Pose:
        """The same pose with theta, if fixed, `angle` [rad] further."""
        return dataclasses.replace(self, theta=None if self.theta is None else self.theta + angle)


@dataclasses.dataclass(frozen=True)
class ThrownObject(Section):
    """The bar: a rigid body with its mass along a long axis.

    mass [kg]; inertia about the CoM [kg m^2]; length and width [m]; com [m], the CoM's
    distance from the end that is nearer the grasp.
    """

    mass: float = quantity(above=0, most=1e4)
    inertia: float = quantity(above=0, least=1e-12, most=1e6)
    length: float = quantity(above=0, most=100)
    com: float = quantity(least=0)
    width: float = quantity(least=0, most=100, default=0.0)

    def check(self) -> None:
        """CoM inside the bar; inertia not above the two-point-mass bound for that CoM."""
        if self.com > self.length:
            raise InputError(f"com = {self.com:g}: must be at most the length {self.length:g}")
        most = self.mass * (self.com * (self.length - self.com) + self.width**2 / 4)
        if self.inertia > most * (1 + 1e-9):
            raise InputError(
                f"inertia = {self.inertia:g}: must be at most {most:.4g} kg m^2, "
                "what mass, length, width and com allow"
            )


@dataclasses.dataclass(frozen=True)
class Grasp(Section):
    """Where and how the bar is held.

    offset [m] of the pads from the end nearer the grasp; angle [rad] of the bar's axis
    (grasp towards CoM) against the hand's approach axis.
    """

    offset: float = quantity(least=0, default=0.0)
    angle: float = quantity(degrees=True, default=0.0)


@dataclasses.dataclass(frozen=True)
class PadContact(Section):
    """Friction of the pads: friction mu, patch_radius r_p [m], torsion c, faces.

    pressure: how the meshed models `patch` and `lugre` spread the force over the pad.
    """

    friction: float = quantity(above=0, most=100)
    patch_radius: float = quantity(above=0, least=1e-6, most=1)
    torsion: float = quantity(above=0, least=1e-3, most=10, default=0.6)
    faces: int = quantity(least=1, most=100, default=2)
    pressure: str = quantity(choices=("uniform", "hertz"), default="uniform")


@dataclasses.dataclass(frozen=True)
class Gripper(Section):
    """Grip force of one pad.

    Either `force` [N], `dwell` [s] (command to the start of the fall) and `opening` [s]
    (the fall, linear), or `times` [s from the command] and `forces` [N], measured, in
    the file itself or as `table`, a CSV with the columns t and f_N.
    """

    force: float | None = quantity(above=0, most=1e6, default=None)
    dwell: float = quantity(least=0, most=100, default=0.0)
    opening: float | None = quantity(above=0, least=1e-5, most=100, default=None)
    times: tuple[float, ...] = ()
    forces: tuple[float, ...] = ()
    table: str | None = None

    def check(self) -> None:
        """Exactly one way of giving the force; a table that falls to zero."""
        linear = self.force is not None or self.opening is not None
        measured = bool(self.times or self.forces or self.table)
        if linear == measured:
            raise InputError("give either 'force' and 'opening', or a measured 'table'")
        if linear and (self.force is None or self.opening is None):
            missing = "force" if self.force is None else "opening"
            raise InputError(f"key '{missing}' is missing")
        self.profile()

    def profile(self) -> GripProfile:
        """The grip-force profile of the models."""
        if self.force is not None and self.opening is not None:
            return LinearRelease(self.force, self.dwell, self.opening)
        try:
            return TableRelease(self.times, self.forces)
        except ValueError as error:
            raise InputError(f"table = {self.table or 'times, forces'}: {error}") from None


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


@dataclasses.dataclass(frozen=True)
class Tolerance(Section):
    """Accepted landing error: position [m], angle [rad]."""

    position: float = quantity(above=0, default=0.002)
    angle: float = quantity(above=0, degrees=True, default=math.radians(0.5))


@dataclasses.dataclass(frozen=True)
class Cup(Section):
    """A cup, open above, that the bar enters with its lower end first.

    x [m] centre (in the throw's plane), rim [m] height, radius [m] inside, depth [m];
    the cup goes along when another target is asked for.
    clearance [m]: the bar's outline keeps it to the wall and the rim from the instant
    its lower end reaches the rim plane until that is `insertion` [m] below.
    """

    x: float
    rim: float
    radius: float = quantity(above=0)
    depth: float = quantity(above=0)
    clearance: float = quantity(least=0, default=0.0)
    insertion: float = quantity(above=0, default=0.05)

    def check(self) -> None:
        """The bar enters no deeper than the cup is."""
        if self.insertion > self.depth:
            raise InputError(
                f"insertion = {self.insertion:g}: must be at most the depth {self.depth:g}"
            )


@dataclasses.dataclass(frozen=True)
class Landing(Section):
    """Bounds at landing: speed [m/s] of the CoM and turning rate [rad/s]."""

    speed_min: float = quantity(least=0, default=0.0)
    speed_max: float | None = quantity(above=0, default=None)
    rate_max: float | None = quantity(above=0, default=None)

    def check(self) -> None:
        """speed_min below speed_max."""
        if self.speed_max is not None and self.speed_min >= self.speed_max:
            raise InputError(
                f"speed_min = {self.speed_min:g}: must be below speed_max = {self.speed_max:g}"
            )


@dataclasses.dataclass(frozen=True)
class Workspace(Section):
    """Where nothing may be. Heights and distances in m, in the throw's plane.

    floor: lowest height of hand, arm joints and held bar;
    column_radius, column_height: the robot's base, for the bar; palm_clearance: from
    the detached bar to the hand's body (arms only).
    """

    floor: float | None = None
    column_radius: float | None = quantity(above=0, default=None)
    column_height: float | None = quantity(above=0, default=None)
    palm_clearance: float | None = quantity(least=0, default=None)

    def check(self) -> None:
        """Both column values or none."""
        if (self.column_radius is None) != (self.column_height is None):
            raise InputError("column_radius and column_height: give both or neither")


@dataclasses.dataclass(frozen=True)
class Distribution(Section):
    """How a number is spread: one of `uniform` (half width), `normal` (standard deviation)
    and `samples` (a measured list), about `mean`; for samples the mean is their own.
    """

    uniform: float | None = quantity(above=0, default=None)
    normal: float | None = quantity(above=0, default=None)
    samples: tuple[float, ...] = ()
    mean: float = 0.0

    def check(self) -> None:
        """Exactly one kind."""
        kinds = [self.uniform is not None, self.normal is not None, bool(self.samples)]
        if sum(kinds) != 1:
            raise InputError("give exactly one of 'uniform', 'normal' and 'samples'")
        if self.samples and self.mean != 0.0:
            raise InputError("mean: not beside 'samples', which have their own")


@dataclasses.dataclass(frozen=True)
class Uncertainty(Section):
    """What is not known exactly. It does not change a plan.

    delay [s]: the gripper opens that much later than commanded (below zero: earlier). Read
    and checked here; no command uses it yet.
    """

    delay: Distribution | None = None

    def check(self) -> None:
        """Something is uncertain."""
        if self.delay is None:
            raise InputError("key 'delay' is missing")


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


@dataclasses.dataclass(frozen=True)
class Mesh(Section):
    """Numerical settings of the NLP.

    carry and opening: shooting intervals of the phases; substeps: Runge-Kutta steps
    per opening interval; epsilon: relative rounding width of the friction laws;
    sticking_margin: share of the full grip's friction limit kept free while carrying;
    carry_max [s]: longest carry.
    """

    carry: int = quantity(least=3, most=60, default=10)
    opening: int = quantity(least=2, most=60, default=10)
    substeps: int = quantity(least=1, most=20, default=2)
    epsilon: float = quantity(above=0, most=1, default=0.03)
    sticking_margin: float = quantity(least=0, below=1, default=0.05)
    carry_max: float = quantity(above=0, default=2.0)


@dataclasses.dataclass(frozen=True)
class Scene(Section):
    """A whole scene. `file` is where it came from, for messages."""

    name: str
    object: ThrownObject
    contact: PadContact
    gripper: Gripper
    description: str = ""
    gravity: float = quantity(least=0, most=1e3, default=9.81)
    grasp: Grasp = Grasp()
    hand: Hand | None = None
    robot: Robot | None = None
    motion: Motion | None = None
    target: Pose | None = None
    tolerance: Tolerance = Tolerance()
    cup: Cup | None = None
    landing: Landing | None = None
    workspace: Workspace | None = None
    uncertainty: Uncertainty | None = None
    mesh: Mesh = Mesh()
    arm: Arm | None = None
    file: str = ""

    def check(self) -> None:
        """Conditions between sections."""
        if self.grasp.offset > self.object.com:
            raise InputError(
                f"[grasp] offset = {self.grasp.offset:g}: must be at most [object] com = "
                f"{self.object.com:g} (count from the other end)"
            )
        movers = [n for n in ("hand", "robot", "motion") if getattr(self, n) is not None]
        if len(movers) != 1:
            raise InputError("give exactly one of [hand], [robot] and [motion]")
        moved_by_arm = self.robot is not None or (self.motion and self.motion.joints is not None)
        if bool(moved_by_arm) != (self.arm is not None):
            raise InputError("[robot] needs its arm data: use load_scene")
        if self.motion is None and self.target is None:
            raise InputError("section [target] is missing")
        if self.target is not None and self.robot is None and self.target.y != 0:
            raise InputError("[target] y: only for a scene with [robot]")
        if self.robot is not None and self.arm is not None:
            _check_robot(self.robot, self.arm)
        if self.cup is not None:
            self._check_cup(self.cup)
        dwell = self.gripper.profile().dwell
        if self.motion is None and dwell > self.mesh.carry_max - 0.05:
            raise InputError(
                f"[gripper] dwell = {dwell:g}: must be below [mesh] carry_max = "
                f"{self.mesh.carry_max:g} by 0.05 s"
            )

    def _check_cup(self, cup: Cup) -> None:
        # The bar is as thick as it is wide: a round cup is narrower beside its middle.
        half = self.object.width / 2
        need = math.hypot(half + cup.clearance + 0.001, half)
        if cup.radius <= need:
            raise InputError(
                f"[cup] radius = {cup.radius:g}: must be above {need:.4g}, for half the bar's "
                "width, the clearance and 1 mm"
            )
        if self.target is not None and self.target.theta is None:
            raise InputError("[cup] needs a target with theta_deg, to know which end goes in")

    def replace(self, **changes: Any) -> Scene:
        """A copy with the given sections changed, e.g. ``scene.replace(target=Pose(...))``."""
        return dataclasses.replace(self, **changes)

    def aimed_at(self, target: Pose) -> Scene:
        """The scene with another target; a cup goes with it by the same way in x and z."""
        cup, old = self.cup, self.target
        if cup is not None and old is not None:
            dx, dz = target.plane_x - old.plane_x, target.z - old.z
            cup = dataclasses.replace(cup, x=cup.x + dx, rim=cup.rim + dz)
        return dataclasses.replace(self, target=target, cup=cup)

    @property
    def com_offset(self) -> float:
        """h [m]: from the pads' centre to the CoM."""
        return self.object.com - self.grasp.offset

    @property
    def body(self) -> Body:
        """The body of the release models."""
        return Body(self.object.mass, self.object.inertia, self.com_offset)

    @property
    def patch(self) -> Contact:
        """The contact of the release models."""
        contact = self.contact
        return Contact(contact.friction, contact.patch_radius, contact.torsion, contact.faces)

    @property
    def place(self) -> str:
        """Name of the scene for messages: its file, or its name."""
        return Path(self.file).name if self.file else self.name


def _outside(name: str, value: float, low: float, high: float) -> str:
    """Words for a start outside a hand's range."""
    key = f"start: {name}"
    if name == "theta":
        key = "start_theta_deg"
        value, low, high = map(math.degrees, (value, low, high))
    return f"{key} = {value:g}: must be within [{low:g}, {high:g}]"


def _check_robot(robot: Robot, arm: Arm) -> None:
    joints = robot.throwing_joints
    if joints is None:
        joints = arm.throwing_joints
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
