"""The throw as a multiple-shooting NLP, composed of what the scene has.

Every number of the scene is in the parameter vector, so one build serves all
targets, masses, frictions, limits and grip profiles of its structure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array
from .asked import Request
from .assembly import Nlp, assemble
from .context import BRAKE_SHARE, Context, Structure
from .phases import add_brake, add_flight, add_interval, grip_force, grip_instants
from .stages import Stage
from .terms import terms_of
from .window import opening_nodes

#: Cost weights: relative acceleration squared, relative jerk squared, carry time [1/s].
WEIGHTS = (10.0, 1.0, 2.0)
#: Parts of a carry interval at whose ends the grip holds: at first, and with the guard "carry".
INSTANTS = (2, 8)
#: Price of a landing that misses [1/m].
MISS_PRICE = 100.0


@dataclass(frozen=True)
class ThrowNlp(Nlp):
    """The NLP of a throw and the structure it was built for."""

    structure: Structure

    def numbers(self, request: Request) -> Array:
        """The parameter vector of a request with this structure."""
        values = _core_numbers(request)
        for term in self.structure.terms:
            values |= term.numbers(request)
        return self.parameters.vector(values)

    def bounds(self, request: Request) -> tuple[Array, Array]:
        """Lower and upper bounds of the decision vector."""
        return (
            self.fill(lambda block, _: block.bounds(request)[0]),
            self.fill(lambda block, _: block.bounds(request)[1]),
        )


def structure_of(request: Request) -> Structure:
    """What the NLP of a request consists of."""
    scene, mover, window, terms = request.scene, request.mover, request.window, terms_of(request)
    return Structure(
        carry=scene.mesh.carry,
        opening=scene.mesh.opening,
        early=0 if window is None else window.early,
        late=0 if window is None else window.late,
        integrator=scene.mesh.integrator,
        substeps=scene.mesh.substeps if scene.mesh.integrator == "rk4" else 1,
        instants=INSTANTS["carry" in request.asked.guards],
        jerk_control=mover.jerk_control,
        free_start=mover.start is None,
        under_way=mover.under_way is not None,
        angle=request.angle,
        pivot=request.angle or scene.com_offset > 0 or any(term.turns for term in terms),
        elastic=request.elastic,
        robust=request.robust,
        terms=terms,
    )


def build_nlp(request: Request) -> ThrowNlp:
    """The NLP of a request and others of its structure; numbers come later, as parameters."""
    s = structure_of(request)
    context = Context(s, request.mover)
    made: dict[tuple[bool, ...], Stage] = {}
    stages = []
    # Stages share a kind unless states come or go there, or something is asked only there.
    for k in range(s.last + 1):
        marks = (0, s.carry - 1, s.carry, s.opens, s.detach, s.last)
        kind = tuple(k < mark for mark in marks) + tuple(k == mark for mark in marks)
        if kind not in made:
            made[kind] = context.stage(k)
        stages.append(made[kind])
    closed: set[int] = set()
    for k, stage in enumerate(stages[:-1]):
        if id(stage) not in closed:
            closed.add(id(stage))
            add_interval(context, k, stage, stages[k + 1])
    landing = add_flight(context, stages[s.detach])
    add_brake(context, stages[-1])
    nlp = assemble(stages, context.parameters, landing, s.detach)
    return ThrowNlp(**vars(nlp), structure=s)


def _core_numbers(request: Request) -> dict[str, Any]:
    """Values of the parameters that are no term's."""
    scene, limits, target = request.scene, request.mover.planning, request.target
    assert target is not None
    profile = scene.gripper.profile()
    nodes = opening_nodes(scene.mesh, profile.opening)
    return {
        **vars(scene.body),
        **vars(scene.patch),
        "gravity": scene.gravity,
        "grasp_angle": scene.grasp.angle,
        "full_grip": profile.full,
        "sticking_limit": 1.0 - scene.mesh.sticking_margin,
        "interval": np.diff(nodes),
        grip_force(0): profile.force(grip_instants(scene.mesh, nodes).ravel()),
        "epsilon": scene.mesh.epsilon,
        "start": request.mover.start,
        "start_rate": request.mover.begins[0],
        "start_acceleration": request.mover.begins[1],
        "dq_max": limits.dq,
        "ddq_max": limits.ddq,
        "jerk_max": limits.jerk,
        "q_mid": (limits.q_min + limits.q_max) / 2,
        "q_half": (limits.q_max - limits.q_min) / 2,
        "weights": WEIGHTS,
        "braking": BRAKE_SHARE * limits.ddq,
        "ahead": scene.object.length - scene.object.com,
        "behind": scene.object.com,
        "half_width": scene.object.width / 2,
        "target_x": target.plane_x,
        "target_z": target.z,
        "target_theta": 0.0 if target.theta is None else target.theta,
        "price_x": MISS_PRICE,
        "price_theta": MISS_PRICE * scene.object.length / 2,
    }
