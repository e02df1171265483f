"""What all parts of the throw's NLP share: its structure, parameters, models, coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..models.contact import Body, Contact, HandMotion
from ..models.sliding_pivot import SlidingPivot
from ..models.smoothing import relative_widths
from .mover import Mover
from .ocp import Parameters, Stage

#: Unit of the jerk control [rad/s^3], so that the variables are of order one.
JERK_UNIT = 1000.0


@dataclass(frozen=True)
class Structure:
    """What a scene's NLP consists of; two scenes with the same one share a build.

    pivot: whether the object's rotation against the hand matters (it does not for a
    CoM grasp with the landing angle open). cup: number of depths with a clearance
    condition; palm: number of instants of the flight with one.
    elastic: the landing may miss, at a price.
    """

    carry: int
    opening: int
    substeps: int
    jerk_control: bool
    free_start: bool
    angle: bool
    pivot: bool
    cup: int = 0
    landing: tuple[str, ...] = ()
    floor: bool = False
    column: bool = False
    palm: int = 0
    elastic: bool = False

    @property
    def last(self) -> int:
        """Number of the last stage, at detach."""
        return self.carry + self.opening


class Context:
    """What all parts of the NLP share: structure, parameters, models, coordinates."""

    def __init__(self, structure: Structure, mover: Mover) -> None:
        self.structure = structure
        self.n = mover.size
        self.names = mover.joints
        self._motion = mover.motion
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
            states["q"] = ca.SX.sym(f"q{k}", n)
        if k > 0:
            states["dq"] = ca.SX.sym(f"dq{k}", n)
            if s.jerk_control:
                states["ddq"] = ca.SX.sym(f"ddq{k}", n)
        if k < s.carry:
            states["T"] = ca.SX.sym(f"T{k}")
        if k > s.carry:
            states["rel"] = ca.SX.sym(f"rel{k}", 6 if s.pivot else 4)
        return Stage(states, {"c": ca.SX.sym(f"c{k}", n)} if k < s.last else {})

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

    def hand(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> tuple[ca.SX, ca.SX, HandMotion]:
        """Hand pose, twist, and what the release model needs of its motion."""
        pose, twist, acceleration = self._motion(q, dq, ddq)
        return pose, twist, HandMotion(pose[2], twist[2], *ca.vertsplit(acceleration))

    def gap(self, stage: Stage, following: Stage, dt: ca.SX, more: dict[str, Any]) -> None:
        """Close the interval: coordinates by their closed form, other states by `more`."""
        end = dict(zip(("q", "dq", "ddq"), self.inside(stage, dt), strict=True)) | more
        names = list(following.states)
        stage.gap = ca.vertcat(*following.states.values()) - ca.vertcat(*[end[n] for n in names])

    def limit(self, stage: Stage, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate, under the coordinate's name."""
        for i, name in enumerate(self.names):
            stage.row(f"{name} {kind}", share[i], -1.0, 1.0)

    def inside_positions(self, stage: Stage, kind: str, q: ca.SX) -> None:
        """q within the position limits."""
        self.limit(stage, kind, (q - self.each("q_mid")) / self.each("q_half"))
