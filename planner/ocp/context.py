"""What all parts of the throw's NLP share: its structure, parameters, models, coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...models import (
    Body,
    Contact,
    HandMotion,
    PlanarArm,
    PlanarDynamics,
    SlidingPivot,
    relative_widths,
)
from ..check import Mover
from .assembly import Parameters, Stage

#: Unit of the jerk control [rad/s^3], so that the variables are of order one.
JERK_UNIT = 1000.0


@dataclass(frozen=True)
class Structure:
    """What a scene's NLP consists of; two scenes with the same one share a build.

    pivot: whether the object's rotation against the hand matters (it does not for a
    CoM grasp with the landing angle open). cup: number of depths with a clearance
    condition; instants: parts of a carry interval at whose ends the grip and the held bar
    are looked at; hand: whether the hand has a body.
    arm: whether there it is looked at too;
    palm: number of instants of the flight with a condition against the hand's body; later:
    of the rest of the flight with one;
    passing: with one against the base column.
    elastic: the landing may miss, at a price.
    early, late: intervals of the window before and after the opening in which a delayed or
    hurried opening would fall; robust: what is asked of the hand over that window;
    scenarios: number of other openings that share the hand's motion.
    slowing: velocity limits fall towards the ends of the joints' ranges.
    torque: the joints' torques are limited.
    """

    carry: int
    opening: int
    integrator: str
    substeps: int
    jerk_control: bool
    free_start: bool
    angle: bool
    pivot: bool
    cup: int = 0
    landing: tuple[str, ...] = ()
    floor: bool = False
    column: bool = False
    hand: bool = False
    instants: int = 2
    arm: bool = False
    palm: int = 0
    later: int = 0
    passing: int = 0
    elastic: bool = False
    early: int = 0
    late: int = 0
    robust: str = ""
    scenarios: int = 0
    slowing: bool = False
    torque: bool = False

    @property
    def opens(self) -> int:
        """Number of the stage at which the grip force starts to fall."""
        return self.carry + self.early

    @property
    def detach(self) -> int:
        """Number of the stage at which it is zero."""
        return self.opens + self.opening

    @property
    def last(self) -> int:
        """Number of the last stage: at detach, or at the end of the window."""
        return self.detach + self.late


class Context:
    """What all parts of the NLP share: structure, parameters, models, coordinates."""

    def __init__(self, structure: Structure, mover: Mover) -> None:
        self.structure = structure
        self.n = mover.size
        self.names = mover.joints
        self._kinematics = mover.kinematics
        self._dynamics = _dynamics_of(mover) if structure.torque else None
        p = self.parameters = Parameters()
        self.body = Body(p("mass"), p("inertia"), p("com_offset"))
        self.contact = Contact(p("friction"), p("patch_radius"), p("torsion"), p("faces"))
        self.gravity = p("gravity")
        self.grasp_angle = p("grasp_angle")
        widths = relative_widths(p("epsilon"), self.body, self.contact, self.gravity)
        self.release = SlidingPivot(self.body, self.contact, self.gravity, widths=widths)

    def each(self, name: str) -> ca.SX:
        """The parameter `name` with one value per coordinate."""
        return self.parameters(name, self.n)

    def stage(self, k: int) -> Stage:
        """Symbols of stage k, as the table of nlp.py says."""
        n, s = self.n, self.structure
        states: dict[str, ca.SX] = {}
        if k > 0 or s.free_start:
            states["q"] = ca.SX.sym("q", n)
        if k > 0:
            states["dq"] = ca.SX.sym("dq", n)
            if s.jerk_control:
                states["ddq"] = ca.SX.sym("ddq", n)
        if k < s.carry:
            states["T"] = ca.SX.sym("T")
        if s.opens < k <= s.detach:
            states["rel"] = ca.SX.sym("rel", 6 if s.pivot else 4)
        for number in range(s.scenarios if k > s.carry else 0):
            states[f"rel_{number}"] = ca.SX.sym(f"rel_{number}", 6 if s.pivot else 4)
        return Stage(states, {"c": ca.SX.sym("c", n)} if k < s.last else {})

    def window_step(self) -> ca.SX:
        """Length [s] of the intervals before and after the opening."""
        return self.parameters("window_step")

    def datum(self, stage: Stage, name: str, size: int = 1, *, window: bool = False) -> ca.SX:
        """A symbol (size, 1) with other numbers in each interval of opening or window."""
        s = self.structure
        first, end = (s.carry, s.last) if window else (s.opens, s.detach)
        self.parameters(name, size * (end - first))
        if name not in stage.data:
            stage.data[name] = (ca.SX.sym(name, size), first)
        return stage.data[name][0]

    def node(self, stage: Stage) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq and (jerk control) ddq at the stage's node, rest included."""
        zero = ca.SX.zeros(self.n)
        q = stage.states["q"] if "q" in stage.states else self.each("start")
        return q, stage.states.get("dq", zero), stage.states.get("ddq", zero)

    def inside(self, stage: Stage, t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq, ddq at time t into the stage's interval: closed forms."""
        q, dq, ddq = self.node(stage)
        c = stage.controls["c"]
        if self.structure.jerk_control:
            jerk = JERK_UNIT * c
            return (
                q + t * (dq + t * (ddq / 2 + t * jerk / 6)),
                dq + t * (ddq + t * jerk / 2),
                ddq + t * jerk,
            )
        return q + t * (dq + t * c / 2), dq + t * c, c

    def hand(
        self, stage: Stage, q: ca.SX, dq: ca.SX, ddq: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX], HandMotion]:
        """Hand pose, twist, and what the release model needs of its motion; lifted."""
        n, kinematics = self.n, self._kinematics
        links = stage.lift(*(v for values in (q, dq, ddq) for v in kinematics.turned(values)))
        pose, twist, acceleration = kinematics.motion_of(
            links[:n], links[n : 2 * n], links[2 * n :]
        )
        x, z, *motion = stage.lift(*pose, twist[2], *acceleration)
        return [x, z, motion[0]], [*twist[:2], motion[1]], HandMotion(*motion)

    def heights(self, q: ca.SX) -> list[ca.SX]:
        """Heights [m] of the arm's joint frames; none of a hand that moves by itself."""
        kinematics = self._kinematics
        if isinstance(kinematics, PlanarArm):
            return kinematics.heights(kinematics.turned(q))
        return []

    def close(self, stage: Stage, following: Stage, dt: ca.SX, more: dict[str, Any]) -> None:
        """The next stage's states: coordinates by their closed form, others by `more`."""
        end = dict(zip(("q", "dq", "ddq"), self.inside(stage, dt), strict=True)) | more
        known = [name for name in following.states if name in end]
        stage.following = stage.following | {name: end[name] for name in known}

    def limit(self, stage: Stage, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate, under the coordinate's name."""
        for i, name in enumerate(self.names):
            stage.row(f"{name} {kind}", share[i], -1.0, 1.0)

    def limit_slowing(self, stage: Stage, q: ca.SX, dq: ca.SX) -> None:
        """dq under the velocity limits that fall towards the ends of the range, if any.

        dq + offset <= sqrt(2 a (upper - q)), squared with the sign kept: no root of what
        may be negative on the way, and on the safe side by 5e-5 (rad/s)^2 at most.
        """
        if not self.structure.slowing:
            return
        offset, twice = self.each("slowing_offset"), 2 * self.each("slowing")
        unit = self.each("dq_max") ** 2
        for side, end in ((1, "slowing_upper"), (-1, "slowing_lower")):
            speed, room = side * dq + offset, side * (self.each(end) - q)
            over = (speed * ca.sqrt(speed**2 + 1e-4) - twice * room) / unit
            for i, name in enumerate(self.names):
                stage.row(f"{name} velocity", over[i], -np.inf, 0.0)

    def limit_torque(
        self,
        stage: Stage,
        q: ca.SX,
        dq: ca.SX,
        ddq: ca.SX,
        load: tuple[ca.SX, ca.SX, ca.SX] | None = None,
    ) -> None:
        """The joints' torques inside their limits, if the scene asks for it.

        load: force and torque that the hand gives to the object; None for an empty hand.
        """
        if self._dynamics is None:
            return
        angles, rates, turns = map(self._kinematics.turned, (q, dq, ddq))
        torques = self._dynamics.torques(angles, rates, turns, self.gravity, load)
        self.limit(stage, "torque", ca.vertcat(*torques) / self.each("torque_max"))

    def inside_positions(self, stage: Stage, kind: str, q: ca.SX) -> None:
        """q within the position limits."""
        self.limit(stage, kind, (q - self.each("q_mid")) / self.each("q_half"))


def _dynamics_of(mover: Mover) -> PlanarDynamics:
    assert isinstance(mover.kinematics, PlanarArm)
    return PlanarDynamics(mover.kinematics)
