"""The throw's NLP: building it from the problem, and reading its decision vectors.

All numbers of the scene are parameters: one build serves all targets, masses, frictions, limits and
grip profiles of its structure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array, Trajectory
from ...models.release import SlidingPivot
from .assembly import StagedNlp, assemble
from .problem import ThrowProblem, variable_bounds
from .request import Request, Weights
from .scene_constraint import BRAKE_SHARE, SceneConstraint
from .solver import Solution
from .stage_functions import Shared
from .stages import BIN_WALLS, JERK_UNIT, SLACKS, Block, NlpStructure
from .terms import TERMS
from .transcription import UNITS, Ocp, grip_instants

#: Parts of a carry interval with grip constraints at their ends: without and with lazy "carry".
INSTANTS = (2, 8)
#: A limit binds if its multiplier is above this share of the largest one.
BINDING_SHARE = 0.02
#: A variable's bound binds only within this distance, in the variable's unit.
BINDING_DISTANCE = 1e-4
#: A limit is broken by more than this, in the unit of its row.
BROKEN = 1e-3


@dataclass(frozen=True)
class ThrowNlp(StagedNlp):
    """The NLP of a throw, with the constraints of its scene.

    request: that it was built for; all requests that it serves have its nodes.
    """

    constraints: list[SceneConstraint]
    request: Request

    @property
    def linearised(self) -> bool:
        """Whether parameters depend on the throw at the start of a solve."""
        return any(constraint.linearised for constraint in self.constraints)

    def parameter_values(self, request: Request) -> Array:
        """The parameter vector of a request with this structure."""
        values = _common_values(request)
        for constraint in _constraints_of(request):
            values |= constraint.values
        return self.parameters.vector(values)

    def bounds(self, request: Request) -> tuple[Array, Array]:
        """Lower and upper bounds of the decision vector."""
        given, free = variable_bounds(request), (-np.inf, np.inf)
        return (
            self.fill(lambda block, _: given.get(block.name, free)[0]),
            self.fill(lambda block, _: given.get(block.name, free)[1]),
        )

    def motion(self, request: Request, x: Array) -> tuple[Trajectory, float]:
        """The motion of decision vector `x`, from rest to detach or the end of the window, and the
        time [s] on it at which the grip force starts to fall."""
        s, manipulator = self.structure, request.manipulator
        duration = self.block(x, "T", 0)
        assert duration is not None
        opening_time = float(duration[0] - request.nodes[0])
        zero, (rate, acceleration) = np.zeros(manipulator.size), manipulator.initial_motion

        def blocks(name: str, default: Array) -> Array:
            values = [self.block(x, name, k) for k in range(s.last)]
            return np.array([default if value is None else value for value in values])

        q = blocks("q", zero if manipulator.start is None else manipulator.start)
        dq = blocks("dq", rate)
        ddq, jerk = blocks("ddq", acceleration), JERK_UNIT * blocks("c", zero)
        return Trajectory.cubics(request.times(opening_time), q, dq, ddq, jerk), opening_time

    def with_miss(self, x: Array, parameters: Array) -> Array:
        """Decision vector `x` of an elastic problem, with slacks as large as its landing misses the
        target."""
        landed, x = np.array(self.landing(x, parameters)).ravel()[[0, 2]], x.copy()
        names = [slack.name for slack in SLACKS]
        for block, _, where in self.blocks:
            if block.name in names:
                target = ("target_x", "target_theta")[block.index]
                over = landed[block.index] - parameters[self.parameters.start(target)]
                x[where] = max(0.0, over if block.name == names[1] else -over)
        return x

    def decision_vector(
        self,
        times: Array,
        states: Sequence[Array],
        relative: Callable[[int, int], Array],
        other: Callable[[Block], Array | float],
    ) -> Array:
        """Decision vector of a motion, to start from.

        times (last + 1,) [s], states: q, dq, ddq (n, last + 1) at the stages. relative: the sliding
        pivot's state (6; 4) at a stage, of which opening; other: values of all other blocks.
        """
        s = self.structure
        coordinates = dict(zip(("q", "dq", "ddq"), states, strict=True))
        control = np.diff(coordinates["ddq"], axis=1) / np.diff(times) / JERK_UNIT

        def value(block: Block, k: int) -> Array | float:
            if block.name in coordinates:
                return np.asarray(coordinates[block.name][:, k])
            if block.name == "c":
                return np.asarray(control[:, k])
            if block.name == "T":
                return float(times[s.carry])
            if block.name == "acc" and block.index == 0:
                # The mean acceleration of each interval, at both collocation points.
                before, after = relative(k, 0), relative(k + 1, 0)
                half = len(after) // 2
                gained = after[half:] - (before[half:] if k > s.opens else 0.0)
                return np.tile(gained / (times[k + 1] - times[k]) / UNITS[:half], 2)
            return relative(k, block.index) if block.name == "rel" else other(block)

        return self.fill(value)

    def binding_limits(
        self, joints: tuple[str, ...], solution: Solution, bounds: tuple[Array, Array]
    ) -> tuple[str, ...]:
        """Names of the limits with the largest multipliers at a solution, strongest first.

        joints: names of the coordinates; bounds: of the decision vector.
        """
        multipliers: dict[str, float] = {}

        def add(name: str, multiplier: float) -> None:
            multipliers[name] = max(multipliers.get(name, 0.0), abs(multiplier))

        for row, inequality in enumerate(self.lbg < self.ubg):
            if inequality and self.row_names[row] != BIN_WALLS:
                add(self.row_names[row], solution.lam_g[row])
        distance = np.minimum(solution.x - bounds[0], bounds[1] - solution.x)
        for block, _, where in self.blocks:
            for i, at in enumerate(range(where.start, where.stop)):
                if block.limit and distance[at] < BINDING_DISTANCE:
                    joint = f"{joints[i]} " if block.each else ""
                    add(f"{joint}{block.limit}", solution.lam_x[at])
        least = max(BINDING_SHARE * max(multipliers.values(), default=0.0), 1e-6)
        binding = [name for name, multiplier in multipliers.items() if multiplier > least]
        return tuple(sorted(binding, key=lambda name: -multipliers[name]))

    def broken_limit(self, g: Array) -> str:
        """Name of the limit that a point with the rows' values g (m,) breaks most; empty if it
        keeps all of them."""
        over = np.maximum(self.lbg - g, g - self.ubg)
        over[self.lbg >= self.ubg] = 0.0
        worst = int(np.nan_to_num(over).argmax())
        return self.row_names[worst] if over[worst] > BROKEN else ""


def build_nlp(request: Request, shared: Shared | None = None) -> ThrowNlp:
    """The NLP of a request; it serves all requests of its structure.

    shared: functions of other NLPs, which it uses where its stages are the same, and adds to.
    """
    scene, manipulator, window = request.scene, request.manipulator, request.window
    constraints = _constraints_of(request)
    turns = any(constraint.turns for constraint in constraints)
    structure = NlpStructure(
        carry=scene.nlp.carry,
        opening=len(request.opening_nodes) - 1,
        early=0 if window is None else window.early,
        late=0 if window is None or window.held else window.late,
        instants=INSTANTS["carry" in request.refinement.lazy],
        free_start=manipulator.start is None,
        initial_motion=manipulator.under_way is not None,
        angle=request.angle,
        pivot=request.angle or scene.com_offset > 0 or turns,
        ranges=request.ranges,
        elastic=request.elastic > 0.0,
        robust=bool(request.robust),
        calibrated=scene.calibration is not None,
        parts=len(scene.object.outline),
    )
    ocp = Ocp(structure, manipulator, scene.release or SlidingPivot)
    landing = ThrowProblem(ocp, constraints).declare()
    nlp = assemble(structure, ocp.stages, ocp.parameters, landing, {} if shared is None else shared)
    return ThrowNlp(**vars(nlp), constraints=constraints, request=request)


def _constraints_of(request: Request) -> list[SceneConstraint]:
    return [constraint for kind in TERMS if (constraint := kind.of(request)) is not None]


def _common_values(request: Request) -> dict[str, Any]:
    """Values of the parameters common to all throws."""
    scene, limits, target = request.scene, request.manipulator.planning, request.target
    assert target is not None
    profile = scene.gripper.profile()
    nodes = request.opening_nodes
    bias_x, bias_theta = scene.flight.bias or (0.0, 0.0)
    return {
        "bias_x": bias_x,
        "bias_theta": bias_theta,
        **vars(scene.body),
        **vars(scene.patch),
        "gravity": scene.gravity,
        "grasp_angle": scene.grasp.angle,
        "full_grip": profile.full,
        "sticking_limit": 1.0 - scene.gripper.sticking_margin - request.refinement.margins["grip"],
        "interval": np.diff(nodes),
        "grip_force 0": profile.force(grip_instants(nodes).ravel()),
        "epsilon": scene.nlp.epsilon,
        "start": request.manipulator.start,
        "start_rate": request.manipulator.initial_motion[0],
        "start_acceleration": request.manipulator.initial_motion[1],
        "dq_max": limits.dq,
        "ddq_max": limits.ddq,
        "jerk_max": limits.jerk,
        "q_mid": (limits.q_min + limits.q_max) / 2,
        "q_half": (limits.q_max - limits.q_min) / 2,
        "weights": Weights.of(scene),
        "braking": BRAKE_SHARE * limits.ddq,
        "ahead": scene.object.length - scene.object.com,
        "behind": scene.object.com,
        "half_width": scene.object.width / 2,
        "outline": (scene.object.capsules - [*[scene.object.com, 0.0] * 2, 0.0]).ravel(),
        "target_x": target.plane_x,
        "target_z": target.z,
        "target_theta": 0.0 if target.theta is None else target.theta,
        "half_width_x": target.half_widths[0],
        "half_width_theta": target.half_widths[1],
        "price_x": request.elastic,
        "price_theta": request.elastic * scene.object.half_length,
    }
