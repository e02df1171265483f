"""Sampled throws in closed form: their run-ups, and whether these and the flight clear obstacles.

A run-up is a polynomial from rest to a state of the coordinates. Solves that start from a run-up
through the base column mostly end with one, so each sampled throw is marked.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...models import Array, Flags, FlightState, Path
from ...problems import Scene
from ..check import (
    Mover,
    Throw,
    column_distance,
    column_of,
    contacts,
    held_bar,
    overlap,
    palm_distance,
)
from ..ocp import BRAKE_SHARE, PALM_TIMES

#: Instants of the run-up, and of the flight, at which the bar is held against the column.
INSTANTS, FLIGHT_INSTANTS = 24, 40
#: Pieces of a table's run-up that is held against obstacles.
PIECES = 12


def run_up(mover: Mover, q: Array, dq: Array, ddq: Array, duration: Any) -> list[Array]:
    """Coefficients c_0 .. c_5 of q(t), t from 0 to `duration` [s], ending at (q, dq, ddq).

    From the mover's start by a quintic; without a given one by the rate a t^2 + b t^3 from rest,
    which begins where it falls. Arrays that broadcast, e.g. (N, n) and
    durations (N, 1).
    """
    zero, d, start = 0.0 * q * duration, duration, mover.start
    if start is None:
        a, b = 3 * dq / d**2 - ddq / d, ddq / d**2 - 2 * dq / d**3
        return [q - a * d**3 / 3 - b * d**4 / 4, zero, zero, a / 3 + zero, b / 4 + zero, zero]
    rate, acceleration = mover.begins
    # What is left to do beside going on with the acceleration of the start.
    gap = q - start - rate * d - acceleration * d**2 / 2
    dq, ddq = dq - rate - acceleration * d, ddq - acceleration
    return [
        start + zero,
        rate + zero,
        acceleration / 2 + zero,
        (20 * gap - 8 * dq * d + ddq * d**2) / (2 * d**3),
        (-30 * gap + 14 * dq * d - 2 * ddq * d**2) / (2 * d**4),
        (12 * gap - 6 * dq * d + ddq * d**2) / (2 * d**5),
    ]


def polynomial(coefficients: list[Array], t: Any, derivative: int = 0) -> Array:
    """sum c_i t^i, or a derivative of it, at times that broadcast with the coefficients."""
    terms = []
    for power in range(derivative, len(coefficients)):
        factor = float(np.prod(np.arange(power, power - derivative, -1)))
        terms.append(factor * coefficients[power] * t ** (power - derivative))
    return np.asarray(sum(terms))


def carry(
    mover: Mover,
    state: tuple[Array, Array, Array],
    duration: float,
    opening: float,
    pieces: int,
) -> Path:
    """The run-up (in cubic `pieces`) to a state (q, dq, ddq), which then stays accelerated so.

    The pieces meet in position, rate and acceleration; each has the run-up's jerk at its middle.
    """
    times = np.append(np.linspace(0.0, duration, pieces + 1), duration + opening)
    t, dt = times[:-1, None], duration / pieces
    coefficients = run_up(mover, *state, duration)
    place, rate, acceleration = (polynomial(coefficients, t, k) for k in range(3))
    jerk = polynomial(coefficients, t + dt / 2, 3)
    jerk[-1] = 0.0
    for k in range(pieces):
        place[k + 1] = place[k] + dt * (rate[k] + dt * (acceleration[k] / 2 + dt * jerk[k] / 6))
        rate[k + 1] = rate[k] + dt * (acceleration[k] + dt * jerk[k] / 2)
        acceleration[k + 1] = acceleration[k] + dt * jerk[k]
    return Path.cubics(times, place, rate, acceleration, jerk)


def clears_carried(scene: Scene, mover: Mover, path: list[Array], duration: Array) -> Flags:
    """Whether the held bar (N,) clears base column and arm, and the arm itself, on N run-ups.

    path: coefficients (N, n) as `run_up` gives them; duration (N, 1) [s]. True where nothing is
    asked.
    """
    clear = np.ones(len(duration), dtype=bool)
    column = column_of(scene)
    if not clear.size or (column is None and mover.capsules is None):
        return clear
    for share in np.linspace(0.0, 1.0, INSTANTS):
        q = polynomial(path, share * duration).T
        bar = held_bar(scene, mover.motion(q, 0 * q, 0 * q)[0])
        if column is not None:
            clear &= column_distance(scene.object, bar, *column) >= 0.0
        clear[clear] = overlap(scene, mover, q[:, clear], bar[:, clear]) <= 0.0
    return clear


def flies_past_column(scene: Scene, detach: Array, duration: Array, room: float = 0.0) -> Flags:
    """Whether the flying bar (N,) stays out of the base column, by `room` [m] or more.

    detach (N, 6): the bar's pose and twist there; duration (N,) [s] of the flights, NaN where it
    does not come down, which counts as not clear. True where nothing is asked.
    """
    clear = np.ones(len(detach), dtype=bool)
    column = column_of(scene)
    if column is None or not clear.size:
        return clear
    clear &= np.isfinite(duration)
    for share in np.linspace(0.0, 1.0, FLIGHT_INSTANTS):
        com = _flown(scene, detach, share * np.nan_to_num(duration))
        clear &= column_distance(scene.object, com, *column) >= room
    return clear


def in_obstacles(scene: Scene, mover: Mover, releases: Any, index: int) -> float:
    """How far [m] a table's throw `index` is inside obstacles and the arm itself, all bodies."""
    state = releases.q[index], releases.dq[index], releases.ddq[index]
    time, opening = float(releases.run_up[index]), scene.gripper.profile().opening
    throw = Throw(scene, mover, carry(mover, state, time, opening, PIECES), time)
    return sum(contact.missing for contact in contacts(throw)) if throw.lands else math.inf


def clears_thrown(scene: Scene, mover: Mover, q: Array, dq: Array, detach: Array) -> Flags:
    """Whether the bar (N,) clears the arm after detach, and the hand by the scene's clearance.

    q, dq (N, n): coordinates and rates at detach, from where each brakes at what is counted
    on; detach (N, 6): the bar's pose and twist there. True where nothing is asked.
    """
    clear = np.ones(len(q), dtype=bool)
    workspace, arm = scene.workspace, scene.arm
    palm = None if workspace is None else workspace.palm_clearance
    if arm is None or not clear.size or (palm is None and mover.capsules is None):
        return clear
    stop_time = np.abs(dq) / (BRAKE_SHARE * mover.planning.ddq) + 1e-9
    for t in PALM_TIMES:
        moving = np.minimum(t / stop_time, 1.0)
        there = (q + dq * stop_time * (moving - moving**2 / 2)).T
        com = _flown(scene, detach, t)
        if palm is not None:
            hand = mover.motion(there, 0 * there, 0 * there)[0]
            clear &= palm_distance(scene.object, arm.tool, com, hand) >= palm
        some = there[:, clear], com[:, clear]
        clear[clear] = overlap(scene, mover, *some, flying=True) <= 0.0
    return clear


def _flown(scene: Scene, detach: Array, times: Array | float) -> Array:
    """CoM poses (3, N) at `times` [s] after detach (N, 6)."""
    state = FlightState(*detach.T).after(times, scene.gravity)
    return np.array([state.x, state.z, state.theta])
