"""Sampled throws in closed form: their run-ups, and whether these and the flight clear obstacles.

A run-up is a polynomial from rest to a state of the coordinates. Solves that start from a run-up
through the base column mostly end with one, so each sampled throw is marked.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from ....models import Array, Flags, FlightState, Trajectory
from ....problems import Scene
from ...ocp import BRAKE_SHARE, PALM_TIMES
from ...throw import Manipulator, Throw, column_of
from ...verdict import column_distance, held_bar, overlap, palm_distance

#: Instants of the run-up, and of the flight, at which the bar is checked against the column.
INSTANTS, FLIGHT_INSTANTS = 24, 40
#: Times after detach [s] at which the bar is checked against the arm besides those of the palm.
LATE_TIMES = tuple(np.arange(0.3, 1.3, 0.05).tolist())
#: Cubics of a table's run-up.
PIECES = 12


def run_up(manipulator: Manipulator, q: Array, dq: Array, ddq: Array, duration: Any) -> list[Array]:
    """Coefficients c_0 .. c_5 of q(t), t from 0 to `duration` [s], ending at (q, dq, ddq).

    From a given start by a quintic. With a free start the rate is a t^2 + b t^3, and the start's
    position follows from it. Arrays that broadcast, e.g. (N, n) and durations (N, 1).
    """
    zero, d, start = 0.0 * q * duration, duration, manipulator.start
    if start is None:
        a, b = 3 * dq / d**2 - ddq / d, ddq / d**2 - 2 * dq / d**3
        return [q - a * d**3 / 3 - b * d**4 / 4, zero, zero, a / 3 + zero, b / 4 + zero, zero]
    rate, acceleration = manipulator.initial_motion
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
    return np.asarray(polyval(t, polyder(np.array(coefficients), derivative), tensor=False))


def carry(
    manipulator: Manipulator,
    state: tuple[Array, Array, Array],
    duration: float,
    opening: float,
    pieces: int,
) -> Trajectory:
    """The run-up (in cubic `pieces`) to a state (q, dq, ddq), which then stays accelerated so.

    The pieces meet in position, rate and acceleration; each has the run-up's jerk at its middle.
    """
    times = np.append(np.linspace(0.0, duration, pieces + 1), duration + opening)
    t, dt = times[:-1, None], duration / pieces
    coefficients = run_up(manipulator, *state, duration)
    place, rate, acceleration = (polynomial(coefficients, t, k) for k in range(3))
    jerk = polynomial(coefficients, t + dt / 2, 3)
    jerk[-1] = 0.0
    for k in range(pieces):
        place[k + 1] = place[k] + dt * (rate[k] + dt * (acceleration[k] / 2 + dt * jerk[k] / 6))
        rate[k + 1] = rate[k] + dt * (acceleration[k] + dt * jerk[k] / 2)
        acceleration[k + 1] = acceleration[k] + dt * jerk[k]
    return Trajectory.cubics(times, place, rate, acceleration, jerk)


def clears_carried(
    scene: Scene, manipulator: Manipulator, path: list[Array], duration: Array
) -> Flags:
    """Whether the held bar (N,) clears base column and arm, and the arm itself, on N run-ups.

    path: coefficients (N, n) as `run_up` gives them; duration (N, 1) [s]. True where nothing is
    asked.
    """
    clear = np.ones(len(duration), dtype=bool)
    column = column_of(scene)
    if not clear.size or (column is None and manipulator.capsules is None):
        return clear
    for share in np.linspace(0.0, 1.0, INSTANTS):
        q = polynomial(path, share * duration).T
        bar = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
        if column is not None:
            clear &= column_distance(scene.object, bar, *column) >= 0.0
        clear[clear] = overlap(scene, manipulator, q[:, clear], bar[:, clear]) <= 0.0
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


def sampled_throw(scene: Scene, manipulator: Manipulator, releases: Any, index: int) -> Throw:
    """A table's throw `index`: its run-up in cubics, as an NLP has it, then its acceleration while
    the pads open."""
    state = releases.q[index], releases.dq[index], releases.ddq[index]
    time, opening = float(releases.run_up[index]), scene.gripper.profile().opening
    return Throw(scene, manipulator, carry(manipulator, state, time, opening, PIECES), time)


def clears_thrown(
    scene: Scene, manipulator: Manipulator, q: Array, dq: Array, detach: Array
) -> Flags:
    """Whether the bar (N,) clears the arm after detach, and the hand by the scene's clearance.

    q, dq (N, n): coordinates and rates at detach, from where each joint brakes at BRAKE_SHARE of
    its acceleration limit; detach (N, 6): the bar's pose and twist there. True where nothing is
    asked.
    """
    clear = np.ones(len(q), dtype=bool)
    palm, arm = scene.palm_clearance, scene.arm
    if arm is None or not clear.size or (palm is None and manipulator.capsules is None):
        return clear
    stop_time = np.abs(dq) / (BRAKE_SHARE * manipulator.planning.ddq) + 1e-9
    # A bar thrown up comes back, onto an arm at rest.
    down = 0.0 if scene.bounds.floor is None else scene.bounds.floor
    for t in (*PALM_TIMES, *LATE_TIMES):
        moving = np.minimum(t / stop_time, 1.0)
        there = (q + dq * stop_time * (moving - moving**2 / 2)).T
        com = _flown(scene, detach, t)
        flying = clear & (com[1] > down)
        here, bar = there[:, flying], com[:, flying]
        if palm is not None:
            hand = manipulator.motion(here, 0 * here, 0 * here)[0]
            clear[flying] = palm_distance(scene.object, arm.tool, bar, hand) >= palm
            here, bar = here[:, clear[flying]], bar[:, clear[flying]]
            flying &= clear
        clear[flying] = overlap(scene, manipulator, here, bar) <= 0.0
    return clear


def _flown(scene: Scene, detach: Array, times: Array | float) -> Array:
    """CoM poses (3, N) at `times` [s] after detach (N, 6)."""
    return scene.flight.after(FlightState(*detach.T), times).pose
