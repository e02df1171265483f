"""A scene: what is thrown, what holds it, where it should land. Data only, SI units, radians.

A section that is None is left out of everything: no variable, no constraint. The sections
are in files of their own; their names are all to be had from here.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

from ..models import Arm, Body, Contact
from .choice import Choice
from .distribution import Distribution
from .errors import InputError
from .hold import Grasp, Gripper, PadContact, ThrownObject
from .mesh import Mesh
from .movers import Hand, Motion, Robot, check_robot, thrown_by
from .robust import Robust
from .section import Section, quantity
from .surroundings import Cup, Workspace
from .target import Landing, Pose, Tolerance
from .torque import Torque, check_torque
from .uncertainty import PARAMETERS, SHARES, Uncertainty

__all__ = [
    "Cup",
    "Distribution",
    "Grasp",
    "Gripper",
    "Hand",
    "Landing",
    "Mesh",
    "Motion",
    "PadContact",
    "Pose",
    "Robot",
    "Scene",
    "ThrownObject",
    "Tolerance",
    "Torque",
    "Uncertainty",
    "Workspace",
]


@dataclasses.dataclass(frozen=True)
class Scene(Section):
    """A whole scene. `file` is where it came from, for messages."""

    name: str
    object: ThrownObject
    contact: PadContact
    gripper: Gripper
    description: str = ""
    gravity: float = quantity(least=0, most=1e3, default=9.81)
    grasp: Grasp = dataclasses.field(default_factory=Grasp)
    hand: Hand | None = None
    robot: Robot | None = None
    motion: Motion | None = None
    target: Pose | None = None
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)
    choice: Choice | None = None
    robust: Robust | None = None
    cup: Cup | None = None
    landing: Landing | None = None
    workspace: Workspace | None = None
    torque: Torque | None = None
    uncertainty: Uncertainty | None = None
    mesh: Mesh = dataclasses.field(default_factory=Mesh)
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
            check_robot(self.robot, self.arm)
        if self.torque is not None:
            if self.robot is None or self.arm is None:
                raise InputError("[torque]: only for a scene with [robot]")
            check_torque(self.torque, self.arm, thrown_by(self.robot, self.arm))
        if self.cup is not None:
            self._check_cup(self.cup)
        if self.uncertainty is not None:
            try:
                self.uncertainty.check_possible(self.values, self.ranges)
            except InputError as error:
                raise InputError(f"[uncertainty] {error}") from None
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
    def values(self) -> dict[str, float]:
        """What the scene takes an uncertain parameter to be, by its name; errors are 0."""
        held = {name: getattr(self.object, name) for name in ("mass", "inertia")}
        pads = {name: getattr(self.contact, name) for name in ("friction", "patch_radius")}
        grasp = {"grasp_offset": self.grasp.offset, "grasp_angle": self.grasp.angle}
        rest = {"com_offset": self.com_offset, "opening": self.gripper.profile().opening}
        return dict.fromkeys(PARAMETERS, 0.0) | held | pads | grasp | rest

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """[lowest, highest] possible value of each uncertain parameter."""
        offset, length = self.grasp.offset, self.object.length
        found = {
            name: (SHARES[0] * value, SHARES[1] * value)
            if PARAMETERS[name].scaled
            else (value - PARAMETERS[name].most, value + PARAMETERS[name].most)
            for name, value in self.values.items()
        }
        # The CoM stays in the bar; the pads may reach beyond its end by an error.
        found["com_offset"] = (0.0 - offset, length - offset)
        return found | {"grasp_offset": (-length, length)}

    @property
    def mean_delay(self) -> float:
        """Known mean [s] of the opening delay: the command goes out earlier by as much."""
        spread = None if self.uncertainty is None else self.uncertainty.delay
        return 0.0 if spread is None else spread.about(0.0).expected

    @property
    def place(self) -> str:
        """Name of the scene for messages: its file, or its name."""
        return Path(self.file).name if self.file else self.name
