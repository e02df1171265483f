"""The relative states across an opening interval: collocation, or Runge-Kutta steps.

Two-point Gauss collocation (order 4, A-stable) takes the accelerations at its points as
unknowns: two evaluations of the friction law an interval, each a row of its own, and a
next state that is linear in the unknowns. Classical Runge-Kutta needs eight for the
same accuracy, nested in one another, and has a stability limit in step / epsilon.
"""

from __future__ import annotations

import math

import casadi as ca

from ...models import HandMotion, rk4_step
from .assembly import Stage
from .context import Context

#: Two-point Gauss method: nodes, coefficients, weights; its coefficients applied twice
#: integrate accelerations to positions.
NODES = (0.5 - math.sqrt(3) / 6, 0.5 + math.sqrt(3) / 6)
_RATE = ((0.25, 0.25 - math.sqrt(3) / 6), (0.25 + math.sqrt(3) / 6, 0.25))
_PLACE = tuple(
    tuple(sum(_RATE[i][k] * _RATE[k][j] for k in range(2)) for j in range(2)) for i in range(2)
)
_END = tuple(sum(0.5 * _RATE[k][j] for k in range(2)) for j in range(2))
#: Units of the unknown accelerations: slip [m/s^2], rotation [rad/s^2].
SLIP_UNIT, TURN_UNIT = 10.0, 100.0


def gauss_interval(context: Context, stage: Stage, dt: ca.SX, of: str = "") -> ca.SX:
    """The relative states at the interval's end by collocation at two points.

    of: ending of the names of a scenario's states, unknowns and grip forces.
    """
    grips = context.datum(stage, f"grip_force{of}", 2, window=bool(of))
    state = relative_state(context, stage, of)
    place, rate = state[: len(state) // 2], state[len(state) // 2 :]
    units = [SLIP_UNIT, SLIP_UNIT, TURN_UNIT][: len(place)]
    unknown = stage.control(f"acc{of}", 2 * len(place))
    points = [unknown[: len(place)], unknown[len(place) :]]
    accelerations = [[u * a for u, a in zip(units, ca.vertsplit(p), strict=True)] for p in points]

    def moved(i: int, share: float, row: tuple[float, ...]) -> ca.SX:
        return share * dt * rate[i] + dt**2 * sum(
            weight * a[i] for weight, a in zip(row, accelerations, strict=True)
        )

    def hastened(i: int, row: tuple[float, ...]) -> ca.SX:
        return dt * sum(weight * a[i] for weight, a in zip(row, accelerations, strict=True))

    for k, node in enumerate(NODES):
        at = [p + moved(i, node, _PLACE[k]) for i, p in enumerate(place)]
        speed = [r + hastened(i, _RATE[k]) for i, r in enumerate(rate)]
        _, _, hand = context.hand(stage, *context.inside(stage, node * dt))
        law = _accelerations(context, stage, [*at, *speed], hand, grips[k])
        for unit, variable, value in zip(units, ca.vertsplit(points[k]), law, strict=True):
            stage.row("sliding pivot", variable - value / unit, 0.0, 0.0)
    end = [p + moved(i, 1.0, _END) for i, p in enumerate(place)]
    return ca.vertcat(*end, *[r + hastened(i, (0.5, 0.5)) for i, r in enumerate(rate)])


def runge_kutta_interval(context: Context, stage: Stage, dt: ca.SX) -> ca.SX:
    """The same by `substeps` classical Runge-Kutta steps.

    The hand is needed at 2 * substeps + 1 instants only, which the stages share.
    """
    substeps = context.structure.substeps
    grips = ca.vertsplit(context.datum(stage, "grip_force", 2 * substeps + 1))
    hands = [
        context.hand(stage, *context.inside(stage, dt * i / (2 * substeps)))[2]
        for i in range(2 * substeps + 1)
    ]

    def rates(state: list[ca.SX], hand: HandMotion, grip: ca.SX) -> list[ca.SX]:
        half = len(state) // 2
        return [*state[half:], *stage.lift(*_accelerations(context, stage, state, hand, grip))]

    state = relative_state(context, stage)
    for i in range(0, 2 * substeps, 2):
        state = rk4_step(rates, state, hands[i : i + 3], grips[i : i + 3], dt / substeps)
    return ca.vertcat(*state)


def _accelerations(
    context: Context, stage: Stage, state: list[ca.SX], hand: HandMotion, grip: ca.SX
) -> list[ca.SX]:
    """Relative accelerations: slip, and rotation where the scene has it.

    The law depends on seven numbers: the slip, the body's angle and rate, and the
    hand's acceleration. They are lifted.
    """
    x, z, turn, _, _, spin = full_state(context, state)
    x, z, theta, omega, *acceleration = stage.lift(
        x, z, hand.theta + turn, hand.omega + spin, hand.a_x, hand.a_z, hand.alpha
    )
    zero = ca.SX(0)
    motion = HandMotion(theta, omega, *acceleration)
    found = context.release.rates([x, z, zero, zero, zero, zero], motion, grip)[3:]
    return found if context.structure.pivot else found[:2]


def relative_state(context: Context, stage: Stage, of: str = "") -> list[ca.SX]:
    """The relative states at the stage's node; sticking at the opening's start."""
    if f"rel{of}" in stage.states:
        return list(ca.vertsplit(stage.states[f"rel{of}"]))
    zero = ca.SX(0)
    if context.structure.pivot:
        return [zero, zero, context.grasp_angle, zero, zero, zero]
    return [zero] * 4


def full_state(context: Context, state: list[ca.SX]) -> list[ca.SX]:
    """All six relative states: without the pivot the object keeps its grasp angle."""
    if context.structure.pivot:
        return state
    return [state[0], state[1], context.grasp_angle, state[2], state[3], ca.SX(0)]
