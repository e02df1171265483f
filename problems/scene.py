"""A scene: object, grip, manipulator, target and limits, as data in SI units and radians.

A section that is None adds no variable and no constraint.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..models import Body, FlightLaw, PinchContact
from ..models.release import SlidingPivot
from ..models.robot import Arm
from .arm_files import arm_table, load_arm, load_gripper
from .bins import Bin
from .calibration import Calibration
from .checks import InputError, Mistakes, checked, within
from .constraint import Constraint
from .grip import Contact, Grasp, Gripper, Object
from .manipulators import Hand, Motion, Robot, Torque, check_torque, thrown_by
from .poses import Pose
from .section import Section, hints_of, part_of, quantity, rules, table_of, unit_of, unknown
from .targets import Choice, Cost, Cup, Landing, Nlp, Obstacle, Rest, Tolerance, Workspace
from .uncertainty import Robust, Uncertainty

#: Poses along each range of a region at which a bar may be in the cup: odd, with the middle.
GRID = 21
#: Sections for the motion of the hand; a scene has exactly one of them.
MOVERS = ("hand", "robot", "motion")
#: Sections that only a planned throw follows.
PLANNED = (
    *("tolerance", "cost", "choice", "cup", "bin", "landing", "workspace", "obstacle"),
    *("uncertainty", "robust", "rest", "calibration", "nlp"),
)
#: Bounds of a scene without [workspace].
UNBOUNDED = Workspace()


@dataclasses.dataclass(frozen=True, repr=False)
class Scene(Section):
    """A scene. `file` is its origin, for messages; `arm` has the robot's data. `constraints` and
    the law of the `release` are a user's own.

    Sections are given by their names: ``Scene(name="mine", object=Object(...), ...)``; a section
    that is None adds nothing. `replace` makes a variant.
    """

    name: str = dataclasses.field(
        metadata=rules("name of the scene; a file's own name where left out")
    )
    object: Object
    contact: Contact
    gripper: Gripper
    description: str = quantity("one line for `throwplan scenes`", default="")
    gravity: float = quantity("m/s², along −z", least=0, most=1e3, default=9.81)
    grasp: Grasp = dataclasses.field(default_factory=Grasp)
    hand: Hand | None = None
    robot: Robot | None = None
    motion: Motion | None = None
    target: Pose | None = None
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)
    cost: Cost | None = None
    choice: Choice | None = None
    cup: Cup | None = None
    bin: Bin | None = None
    landing: Landing | None = None
    workspace: Workspace | None = None
    obstacle: tuple[Obstacle, ...] = ()
    torque: Torque | None = None
    uncertainty: Uncertainty | None = None
    robust: Robust | None = None
    rest: Rest | None = None
    calibration: Calibration | None = None
    nlp: Nlp = dataclasses.field(default_factory=Nlp)
    arm: Arm | None = None
    file: str = ""
    constraints: tuple[Constraint, ...] = ()
    release: type[SlidingPivot] | None = None

    def __repr__(self) -> str:
        """One line; `table` has all values."""
        bar, target = self.object, "" if self.target is None else f", to {self.target.words}"
        manipulator = "hand" if self.hand else self.arm.name if self.arm else "given motion"
        return f"Scene({self.name}: {manipulator}, {bar.mass:g} kg bar of {bar.length:g} m{target})"

    @functools.cached_property
    def weights(self) -> Cost:
        """The weights in the optimisation."""
        return self.cost or Cost()

    def check(self) -> None:
        """Conditions between sections."""
        manipulators = [name for name in MOVERS if getattr(self, name) is not None]
        if len(manipulators) != 1:
            raise InputError("give exactly one of [hand], [robot] and [motion]")
        self._load_arm(manipulators[0])
        self._aim_at_bin()
        if self.motion is None and self.target is None:
            raise InputError("section [target] is missing")
        if self.target is not None and self.robot is None and self.target.y != 0:
            raise InputError("[target] y: only for a scene with [robot]")
        if self.robot is not None and self.arm is not None:
            joints = thrown_by(self.robot, self.arm)
            if joints != self.arm.throwing_joints:
                arm = dataclasses.replace(self.arm, throwing_joints=joints)
                object.__setattr__(self, "arm", arm)
            object.__setattr__(self, "target", self.aim.with_lateral(self.arm.lateral))
        self._place_cup()
        self._place_bin()
        mistakes = Mistakes()
        for words in self._void():
            mistakes.lines.append(words)
        for check in (
            self._check_shape,
            self._check_grasp,
            self._check_dwell,
            functools.partial(check_torque, self.torque, self.robot, self.arm),
            self._check_cup,
            self._check_spread,
            self._check_rest,
        ):
            with mistakes.kept():
                check()
        mistakes.refuse()

    def _void(self) -> Iterator[str]:
        """Sections and keys that do nothing in a scene of this kind."""
        if self.motion is not None:
            plain = {"tolerance": Tolerance(), "nlp": Nlp()}
            for key in PLANNED:
                if getattr(self, key) not in (None, (), plain.get(key)):
                    yield f"[{key}]: only for a scene with [hand] or [robot]"
            if self.target is not None and not self.target.is_fixed:
                yield "[target] velocity and arrival: only for a scene with [hand] or [robot]"
            if self.gripper.sticking_margin != Gripper.sticking_margin:
                yield "[gripper] sticking_margin: only for a scene with [hand] or [robot]"
        if self.hand is not None and self.bounds.palm_clearance is not None:
            yield "[workspace] palm_clearance: only for a scene with [robot]; a [hand] has no palm"

    def _check_shape(self) -> None:
        if self.motion is None:
            self.contact.check_plain()

    def _check_grasp(self) -> None:
        if self.grasp.offset > self.object.com:
            raise InputError(
                f"[grasp] offset = {self.grasp.offset:g}: must be at most [object] com = "
                f"{self.object.com:g} (count from the other end)"
            )

    def _check_dwell(self) -> None:
        dwell = self.gripper.profile().dwell
        if self.motion is None and dwell > self.nlp.carry_max - 0.05:
            raise InputError(
                f"[gripper] dwell = {dwell:g}: must be below [nlp] carry_max = "
                f"{self.nlp.carry_max:g} by 0.05 s"
            )
        # The command is earlier by the known mean of the delay.
        delay, longest = self.mean_delay, self.nlp.carry_max - 0.05 - dwell
        if self.motion is None and not -dwell <= delay <= longest:
            raise InputError(
                f"[uncertainty] delay: its mean = {delay:g}: must be {-dwell:g} to {longest:g} s: "
                "the command, earlier by it and the [gripper] dwell, must be inside the motion"
            )

    def _check_spread(self) -> None:
        if self.uncertainty is not None:
            with within("[uncertainty]", " "):
                self.uncertainty.check_possible(self.values, self.ranges)

    def _check_rest(self) -> None:
        if self.rest is None:
            return
        if self.target is None:
            raise InputError("[rest]: only for a scene with [target]")
        with within("[rest]", " "):
            self.rest.check_place(self.cup, self.bin, self.obstacle)

    def _load_arm(self, manipulator: str) -> None:
        """The data of the arm named by [robot] or [motion], unless given."""
        name = getattr(getattr(self, manipulator), "arm", None)
        if name is None and self.arm is not None:
            raise InputError("arm: only for a scene with [robot]")
        if name is None or self.arm is not None:
            return
        folder, gripper = Path(self.file).parent if self.file else None, self.gripper.file
        with within(f"[gripper] file = {gripper!r}"):
            own = None if gripper is None else load_gripper(gripper, folder)
        with within(f"[{manipulator}] arm = {name!r}"):
            object.__setattr__(self, "arm", load_arm(name, folder, own))

    def _place_cup(self) -> None:
        """A cup without x stands at the target's middle."""
        cup = self.cup
        if cup is None or not math.isnan(cup.x):
            return
        if self.target is None:
            raise InputError("[cup] key 'x' is missing: there is no target to stand at")
        object.__setattr__(self, "cup", cup.changed(x=self.target.plane_x))

    def _aim_at_bin(self) -> None:
        """Without [target] the landings in the bin are the target."""
        if self.bin is None:
            return
        if self.cup is not None:
            raise InputError("[cup] and [bin]: give only one of them")
        with within("[bin]", " "):
            self.bin.check_fits(self.object)
            if self.bin.y and self.robot is None:
                raise InputError("y: only for a scene with [robot]")
        if self.target is None and self.motion is None:
            object.__setattr__(self, "target", self.bin.target(self.object))

    def _place_bin(self) -> None:
        """The bin in the plane of the throw to the target."""
        if self.bin is None or self.target is None:
            return
        with within("[bin]", " "):
            object.__setattr__(self, "bin", self.bin.placed(self.target.plane))
        self.bin.check_target(self.target)

    @property
    def opening(self) -> Cup | Bin | None:
        """The cup or the bin that the object enters."""
        return self.cup or self.bin

    @property
    def aims_at_bin(self) -> bool:
        """Whether the target is that of [bin] without [target]."""
        if self.bin is None or self.target is None:
            return False
        return self.target == self.bin.target(self.object).with_lateral(self.target.lateral)

    @functools.cached_property
    def bodies_around(self) -> tuple[Obstacle, ...]:
        """The obstacles, and the bin's walls."""
        if self.bin is None:
            return self.obstacle
        return (*self.obstacle, *self.bin.plates(self.aim.plane.azimuth))

    def _check_cup(self) -> None:
        cup = self.cup
        if cup is None:
            return
        need, what = self.object.least_cup(cup.clearance + 0.001)
        if cup.radius <= need:
            raise InputError(
                f"[cup] radius = {cup.radius:g}: must be above {need:.4g}, for {what}, "
                "the clearance and 1 mm"
            )
        if self.target is not None:
            cup.check_target(self.target)

    def check_target_in_cup(self) -> None:
        """InputError if no flight through the target's pose can have entered the cup.

        If the lower end at the target is below the rim, that end and the point of the axis in the
        rim plane must be inside the cup for some pose within the tolerance, of a region for any of
        a grid. `aimed_at` does not check this: it moves the cup, and the plan finds whether an
        angle fits.
        """
        if self.cup is None or self.target is None or self.target.theta is None:
            return
        grid = self.target.grid(GRID).T.tolist()
        most = self.tolerance.position + self.object.length * self.tolerance.angle
        reasons = [
            self.cup.why_missed(self.object, (x, self.target.z, theta), most) for x, theta in grid
        ]
        if all(reasons):
            why = reasons[len(reasons) // 2]
            raise InputError(f"[cup] at the [target] the bar is not in the cup: {why}")

    def replace(self, **changes: Any) -> Scene:
        """A copy with the given sections changed, e.g. ``scene.replace(target=Pose(...))``.

        Another arm or gripper than before is loaded, unless `arm` is given.
        """
        names = [field.name for field in dataclasses.fields(self)]
        mistakes = [unknown(name, names) for name in changes if name not in names]
        if mistakes:
            raise InputError(*mistakes)
        if self._sources(changes) != self._sources({}):
            changes = {"arm": None} | changes
        if self.aims_at_bin and changes.get("bin", self.bin) is not None:
            changes = {"target": None} | changes
        scene = dataclasses.replace(self, **changes)
        if "cup" in changes or "target" in changes:
            scene.check_target_in_cup()
        return scene

    def _sources(self, changes: dict[str, Any]) -> list[str | None]:
        """Names of the arm and of the gripper's file, with sections changed."""
        robot, motion, gripper = (
            changes.get(name, getattr(self, name)) for name in ("robot", "motion", "gripper")
        )
        return [robot and robot.arm, motion and motion.arm, gripper and gripper.file]

    def aimed_at(self, target: Pose) -> Scene:
        """The scene with another target; cup and bin move in x and z with the target's middle."""
        target = checked("target", target, Pose, {})
        cup, bin_, old = self.cup, self.bin, self.target
        if old is not None:
            dx, dz = target.plane_x - old.plane_x, target.z - old.z
            if cup is not None:
                cup = cup.changed(x=cup.x + dx, rim=cup.rim + dz)
            if bin_ is not None and target != old:
                bin_ = bin_.moved(bin_.plane_x + dx, dz, target.plane)
        return self.changed(target=target, cup=cup, bin=bin_)

    def fits(self, other: Scene) -> bool:
        """Whether another scene differs at most in its target, in the place of cup or bin, in names
        and in places of files."""
        here = {"x": 0.0, "rim": 0.0}
        mine, others = (
            scene.unnamed.changed(
                target=None,
                cup=scene.cup and scene.cup.changed(**here),
                bin=scene.bin and scene.bin.changed(**here, y=0.0, plane_x=0.0),
            )
            for scene in (self, other)
        )
        return mine == others

    @property
    def unnamed(self) -> Scene:
        """The scene without names and places of files, whose data it has: they change no throw."""
        return self.changed(
            name="",
            description="",
            file="",
            object=self.object.changed(mesh=None),
            gripper=self.gripper.changed(file=None, table=None),
            robot=self.robot and self.robot.changed(arm=""),
        )

    def without_reserves(self) -> Scene:
        """The scene without the reserves that a plan keeps: clearances, and the margins of grip and
        torque, are zero, and the torque rate, which limits what a motion commands, is unlimited."""
        changes = dict[str, Any]()
        if self.arm is not None and self.arm.links:
            changes["torque"] = (self.torque or Torque()).changed(margin=0.0, rate=math.inf)
        if self.motion is None:
            changes["gripper"] = self.gripper.changed(sticking_margin=0.0)
        if self.cup is not None:
            changes["cup"] = self.cup.changed(clearance=0.0)
        if self.bin is not None:
            changes["bin"] = self.bin.changed(clearance=0.0)
        if self.bounds.palm_clearance is not None:
            changes["workspace"] = self.bounds.changed(palm_clearance=0.0)
        if self.obstacle:
            changes["obstacle"] = tuple(one.changed(clearance=0.0) for one in self.obstacle)
        return self.changed(**changes)

    @property
    def palm_clearance(self) -> float | None:
        """Clearance [m] of the flying bar to the palm; None without one, or where none is required.

        For a hand without a palm the clearance is that to its capsules."""
        has_palm = self.arm is not None and self.arm.tool.has_palm
        return self.bounds.palm_clearance if has_palm else None

    @property
    def deciding_model(self) -> str:
        """Name of the release model that decides: a user's own, else the tolerance's."""
        return self.tolerance.model if self.release is None else self.release.__name__

    @property
    def aim(self) -> Pose:
        """The target; for scenes with [hand] or [robot], which have one."""
        assert self.target is not None
        return self.target

    @property
    def bounds(self) -> Workspace:
        """[workspace]; without the section one that bounds nothing."""
        return self.workspace or UNBOUNDED

    @property
    def tool_speed(self) -> float | None:
        """Highest speed [m/s] of an arm's flange and of the pads' centre; None without a limit."""
        if self.robot is None or self.arm is None:
            return None
        own = self.arm.limits.tool_speed
        return own if self.robot.tool_speed is None else self.robot.tool_speed

    @property
    def torque_rate(self) -> float | None:
        """Largest rate of change [N m/s] of a throwing joint's torque; None without a limit, or
        for an arm whose masses are not known."""
        if self.robot is None or self.arm is None or not self.arm.links:
            return None
        own = None if self.torque is None else self.torque.rate
        return self.arm.limits.torque_rate if own is None else own

    @property
    def torque_margin(self) -> float:
        """Share of the torque limits that no throw uses: the scene's, else the arm's, else 0.1."""
        own = None if self.torque is None else self.torque.margin
        if own is None and self.arm is not None:
            own = self.arm.limits.torque_margin
        return Torque.MARGIN if own is None else own

    @property
    def com_offset(self) -> float:
        """h [m]: from the pads' centre to the CoM."""
        return self.object.com - self.grasp.offset

    @functools.cached_property
    def body(self) -> Body:
        """The body of the release models."""
        return Body(self.object.mass, self.object.inertia, self.com_offset)

    @functools.cached_property
    def patch(self) -> PinchContact:
        """The contact of the release models."""
        return self.contact.contact

    @property
    def flight(self) -> FlightLaw:
        """The law of free flight, whose landings have the bias of [calibration]."""
        return FlightLaw(self.gravity, self.calibration.bias if self.calibration else None)

    @property
    def values(self) -> dict[str, float]:
        """The scene's values of the uncertain parameters by name; errors are 0."""
        object_values = {name: getattr(self.object, name) for name in ("mass", "inertia")}
        pads = {name: getattr(self.contact, name) for name in ("friction", "patch_radius")}
        grasp = {"grasp_offset": self.grasp.offset, "grasp_angle": self.grasp.angle}
        rest = {"com_offset": self.com_offset, "opening": self.gripper.profile().opening}
        return dict.fromkeys(Uncertainty.PARAMETERS, 0.0) | object_values | pads | grasp | rest

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """[lowest, highest] possible value of each uncertain parameter."""
        offset, length = self.grasp.offset, self.object.length
        limits = {
            name: Uncertainty.PARAMETERS[name].range(value) for name, value in self.values.items()
        }
        # The CoM stays in the bar; the pads may reach beyond its end by an error.
        limits["com_offset"] = (0.0 - offset, length - offset)
        return limits | {"grasp_offset": (-length, length)}

    @property
    def mean_delay(self) -> float:
        """Known mean [s] of the opening delay; the command is earlier by it."""
        spread = None if self.uncertainty is None else self.uncertainty.delay
        return 0.0 if spread is None else spread.about(0.0).expected

    @property
    def uncertain(self) -> Uncertainty:
        """[uncertainty], with what is assumed beside it."""
        usual = {name: getattr(Uncertainty.USUAL, name) for name in self.assumed_spreads}
        if self.uncertainty is None:
            return Uncertainty(**usual)
        return self.uncertainty.changed(**usual)

    @property
    def assumed_spreads(self) -> tuple[str, ...]:
        """Names of the values whose distributions are assumed: delay and opening where they are
        not given, the opening not beside a measured force."""
        known, measured = self.uncertainty, self.gripper.force is None
        return tuple(
            name
            for name in Uncertainty.USUAL.names
            if (known is None or getattr(known, name) is None)
            and not (measured and name == "opening")
        )

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the uncertain parameters by name."""
        spreads = self.uncertain.about(self.values)
        return {name: spread.deviation for name, spread in spreads.items()}

    @property
    def assumed(self) -> tuple[str, ...]:
        """Names of the values that neither the scene, a maker nor a measurement gives, such as
        "gripper.dwell" and "arm.tool_speed"."""
        sections = {"object": self.object, "contact": self.contact, "gripper": self.gripper}
        names = [f"{section}.{key}" for section, s in sections.items() for key in s.assumptions]
        if self.robot is None or self.arm is None:
            return tuple(names)
        torque = self.torque or Torque()
        replaced = {
            "tool_speed": self.robot.tool_speed,
            "torque_rate": torque.rate,
            "torque_margin": torque.margin,
            "torque": torque.limits,
        }
        kept = [key for key in self.arm.assumed if replaced.get(key) is None]
        return (*names, *(f"arm.{key}" for key in kept))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about the defaults of keys that the scene leaves out."""
        sections = {"object": self.object, "contact": self.contact}
        sentences = [
            f"[{name}] {words}" for name, s in sections.items() for words in s.assumptions.values()
        ]
        if self.arm is not None:
            words = [*self.arm.notes]
            if self.robot is not None and not self.arm.capsules:
                words += [
                    "no [[capsules]]: its joints keep off the floor, links and hand off nothing"
                ]
            sentences += [f"arm {self.arm.name}: {each}" for each in words]
        cup, target = self.cup, self.target
        if cup is not None and target is not None and cup.x == target.x != target.plane_x:
            sentences.append(
                f"[cup] x = {cup.x:g} is in the throw's plane, where the target is at "
                f"{target.plane_x:.4g}: leave x out for a cup at the target"
            )
        return tuple(sentences)

    def table(self) -> dict[str, Any]:
        """The scene as the tables of a file, with the data of its arm as table `arm`, and of other
        files, such as a recorded grip force."""
        table: dict[str, Any] = {key: getattr(self, key) for key in TOP_KEYS}
        for key in SECTIONS:
            section = getattr(self, key)
            if isinstance(section, Uncertainty):
                table[key] = section.table()
            elif isinstance(section, tuple):
                table[key] = [table_of(row) for row in section]
            elif section is not None:
                table[key] = table_of(section)
        if self.aims_at_bin:
            table.pop("target")
        # `times` and `forces` have its rows.
        for key in ("table", "raw", "file"):
            table["gripper"].pop(key, None)
        if self.arm is not None:
            table["arm"] = arm_table(self.arm)
        # A section of defaults alone counts, if it may be left out.
        optional = {field.name for field in dataclasses.fields(self) if field.default is None}
        return {k: v for k, v in table.items() if k in optional or v not in ({}, [], "")}

    @property
    def place(self) -> str:
        """Name of the scene for messages: its file, or its name."""
        return Path(self.file).name if self.file else self.name


def obstacles_besides_bins(scenes: Sequence[Scene]) -> tuple[Obstacle, ...]:
    """The obstacles of the first of some scenes that are no walls of a bin of any of them: scenes
    of a cycle have the walls of its other bins among their obstacles."""

    def place(one: Obstacle) -> tuple[float, ...]:
        return tuple(round(value, 9) for value in (*one.position, *one.size, one.yaw))

    walls = {place(o) for one in scenes for o in one.bodies_around[len(one.obstacle) :]}
    return tuple(o for o in scenes[0].obstacle if place(o) not in walls)


#: Sections of a scene file, and their types.
SECTIONS: dict[str, type[Section]] = {
    name: kind
    for name, hint in hints_of(Scene).items()
    if (kind := part_of(hint)[0]) is not None and issubclass(kind, Section)
}
#: Keys of a scene file before its first section.
TOP_KEYS = ("name", "description", "gravity")


def _document_sections() -> None:
    """Every section and its keys with their units, for ``help(Scene)``."""
    lines = ["", "Sections, and what each holds:", ""]
    for name, kind in SECTIONS.items():
        keys = ", ".join(
            f"{field.name}{unit_of(field.metadata)}"
            for field in dataclasses.fields(kind)
            if "meaning" in field.metadata
        )
        several = "several of " if part_of(hints_of(Scene)[name])[1] else ""
        words = f"{name}: {several}{name.capitalize()}({keys})"
        lines += textwrap.wrap(words, 92, subsequent_indent="    ")
    Scene.__doc__ = "\n".join([inspect.cleandoc(Scene.__doc__ or ""), *lines])


_document_sections()
