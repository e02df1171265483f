"""Landings of measured throws and their derivatives by the unknowns of a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import (
    GRADING,
    HandMotion,
    HandTrack,
    Path,
    SlidingPivot,
    graded,
    number_symbols,
    rk4_step,
)
from ...problems import MeasuredThrow
from .fit_belief import UNKNOWNS, parameters_at
from .fit_together import landings_together
from .predict import Parameters, Predictor

Array = npt.NDArray[np.float64]

#: Steps over the opening of the differentiated sliding pivot, graded as in a batch.
STEPS = 96
#: Largest delay that is fitted [s].
MOST_DELAY = 0.03
#: Steps of central differences: of a logarithm, and of the delay [s].
LOG_STEP, DELAY_STEP = 0.01, 2e-4
#: Rows of a step's hand: theta, omega, a_x, a_z, alpha at its start, middle and end.
HAND_ROWS = 15


class Landings(Protocol):
    """Where all throws land, and how that changes."""

    @property
    def derivatives(self) -> str:
        """How the derivatives are made, in words."""

    def at(self, point: Array) -> tuple[Array, Array]:
        """x [m], theta [rad] (T, 2) at unknowns (P,), and derivatives (T, 2, P)."""


def landings_of(predictor: Predictor, model: str, names: tuple[str, ...]) -> Landings:
    """Landings by `model`: CasADi's derivatives for `sp`, else central differences."""
    if model == "sp":
        return PivotLandings(predictor, names)
    return DifferencedLandings(predictor, model, names)


@dataclass(frozen=True)
class DifferencedLandings:
    """Any model, differentiated by central differences, all in one batch."""

    predictor: Predictor
    model: str
    names: tuple[str, ...]
    derivatives: str = "central differences"

    def at(self, point: Array) -> tuple[Array, Array]:
        """As `Landings`."""
        steps = np.array([DELAY_STEP if n == "delay" else LOG_STEP for n in self.names])
        moves = np.diag(steps)
        points = np.vstack([point, point + moves, point - moves])
        parameters, count = parameters_at(self.names, points), len(self.names)
        landing = landings_together(self.predictor, self.model, parameters)
        ahead, behind = landing[:, 1 : 1 + count], landing[:, 1 + count :]
        slopes = (ahead - behind) / (2 * steps[:, None])
        return landing[:, 0], np.asarray(slopes.transpose(0, 2, 1))


class PivotLandings:
    """The non-smooth sliding pivot, differentiated by CasADi."""

    derivatives = "CasADi"

    def __init__(self, predictor: Predictor, names: tuple[str, ...]) -> None:
        self._predictor = predictor
        self._places = [UNKNOWNS.index(name) for name in names]
        self._names = names
        self._hands = [
            _wide_hand(predictor, throw, hand, "delay" in names)
            for throw, hand in zip(predictor.data.throws, predictor.hands, strict=True)
        ]

    def at(self, point: Array) -> tuple[Array, Array]:
        """As `Landings`; NaN where a throw comes to no landing."""
        chosen = parameters_at(self._names, point).spread()
        p = np.array([np.log(chosen[0][0]), np.log(chosen[1][0]), 0.0, np.log(chosen[3][0])])
        delay, function = float(chosen[2][0]), pivot_landing()
        landings, slopes = [], []
        for throw, hand in zip(self._predictor.data.throws, self._hands, strict=True):
            inputs = pivot_inputs(self._predictor, throw, hand, delay)
            landing, slope = function(p, *inputs)
            landings.append(np.array(landing).ravel())
            slopes.append(np.array(slope)[:, self._places])
        return np.array(landings), np.array(slopes)


def _wide_hand(predictor: Predictor, throw: MeasuredThrow, hand: HandTrack, delayed: bool) -> Path:
    """The hand's spline around the opening, as far as a delay may reach."""
    one, reach = np.ones(1), MOST_DELAY if delayed else 0.0
    batch = predictor.batch(throw, hand, Parameters(one, one, np.array([reach])))
    return replace(batch.hands, delays=0.0)


def pivot_inputs(
    predictor: Predictor, throw: MeasuredThrow, hand: Path, delay: float
) -> tuple[Array, Array, Array]:
    """What `pivot_landing` takes beside the unknowns: steps (34, STEPS), end (9,), numbers."""
    nodes = graded(STEPS, GRADING)
    shares = np.empty(2 * STEPS + 1)
    shares[::2], shares[1::2] = nodes, (nodes[:-1] + nodes[1:]) / 2
    times, grip = shares * throw.grip.opening, throw.grip
    pose, twist, acceleration = hand.at(times + delay)
    # The spline's acceleration is linear between its samples: this is its slope.
    near = 1e-6
    after, before = hand.at(times + delay + near), hand.at(times + delay - near)
    jerk = (after.acceleration - before.acceleration) / (2 * near)
    rows = np.array([pose[2], twist[2], *acceleration])
    slopes = np.array([twist[2], acceleration[2], *jerk])
    table = [np.vstack([part[:, :-2:2], part[:, 1::2], part[:, 2::2]]) for part in (rows, slopes)]
    force = grip.force(times)
    forces = np.array([force[:-2:2], force[1::2], force[2::2]])
    steps = np.vstack([*table, forces, np.diff(times[::2])])
    end = np.concatenate([pose[:, -1], twist[:, -1], acceleration[:, -1]])
    shared = predictor.data.shared
    offset = throw.object.com - throw.grasp.offset
    numbers: list[Any] = [throw.object.mass, throw.object.inertia, offset, shared.torsion]
    numbers += [shared.faces, shared.gravity, throw.grasp.angle, shared.landing_height]
    return steps, end, np.array(numbers, float)


@cache
def pivot_landing() -> ca.Function:
    """(unknowns (4,), steps, end, numbers) -> landing (2,), derivatives (2, 4).

    Unknowns: log mu, log r_p, a delay [s] beyond the one that steps and end are of (its
    derivative is taken there), log of the grip force's scale.
    """
    p, u, end = ca.MX.sym("p", 4), ca.MX.sym("u", 34, STEPS), ca.MX.sym("end", 9)
    numbers = ca.MX.sym("numbers", 8)
    law = ca.vertcat(numbers[:3], ca.exp(p[0] + p[3]), ca.exp(p[1]), numbers[3:6])
    start = ca.vertcat(0, 0, numbers[6], 0, 0, 0)
    steps = _pivot_step().fold(STEPS)
    last = steps(start, u, ca.repmat(ca.vertcat(law, p[2]), 1, STEPS))
    landing = _landing()(last, end, ca.vertcat(law, p[2]), u[10:15, -1], numbers[7])
    inputs = [p, u, end, numbers]
    return ca.Function("landing", inputs, [landing, ca.jacobian(landing, p)])


def _pivot_step() -> ca.Function:
    """(state (6,), step (34,), law's numbers and delay (9,)) -> state."""
    q, body, contact, gravity = number_symbols()
    state, u, delay = ca.SX.sym("state", 6), ca.SX.sym("u", 34), ca.SX.sym("delay")
    rows = u[:HAND_ROWS] + delay * u[HAND_ROWS : 2 * HAND_ROWS]
    hands = [HandMotion(*ca.vertsplit(rows[5 * i : 5 * i + 5])) for i in range(3)]
    law = SlidingPivot(body, contact, gravity)
    forces = [u[2 * HAND_ROWS + i] for i in range(3)]
    new = rk4_step(law.rates, state, hands, forces, u[33])
    return ca.Function("step", [state, u, ca.vertcat(q, delay)], [ca.cse(ca.vertcat(*new))])


def _landing() -> ca.Function:
    """(state, hand's end (9,), law's numbers and delay, motion at the end, height) -> x, theta."""
    q, body, contact, gravity = number_symbols()
    state, end, delay = ca.SX.sym("state", 6), ca.SX.sym("end", 9), ca.SX.sym("delay")
    motion, height = ca.SX.sym("motion", 5), ca.SX.sym("height")
    law = SlidingPivot(body, contact, gravity)
    pose, twist = end[:3] + delay * end[3:6], end[3:6] + delay * end[6:]
    hand = HandMotion(pose[2], twist[2], *ca.vertsplit(motion[2:]))
    x, z, theta, v_x, v_z, omega = law.com_state(
        state, ca.vertsplit(pose), ca.vertsplit(twist), hand
    )
    time = (v_z + ca.sqrt(v_z**2 + 2 * gravity * (z - height))) / gravity
    landed = ca.vertcat(x + v_x * time, theta + omega * time)
    return ca.Function("land", [state, end, ca.vertcat(q, delay), motion, height], [landed])
