"""Sampled releases: what a scene can throw, and starting points for the NLP.

Random states of the coordinates at the start of the opening, kept when limits, grip,
run-up and room to brake allow them, are thrown through the non-smooth sliding pivot
as one batch. The landing nearest a target then starts the NLP.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..models.contact import HandMotion, pivot_wrench
from ..models.flight import land
from ..models.integrate import rk4_step
from ..models.sliding_pivot import SlidingPivot
from ..problems.scene import Scene
from .context import JERK_UNIT, Structure
from .mover import Mover
from .nlp import ThrowNlp
from .numbers import BRAKE_SHARE

Array = npt.NDArray[np.float64]

#: Runge-Kutta steps of the opening in the table.
TABLE_STEPS = 12


@dataclass(frozen=True)
class Releases:
    """Feasible sampled releases: (N, n) coordinates, rates and accelerations at the
    opening's start, run-up time (N,), and detach states (N, 6): x, z, theta, v_x, v_z, omega.
    """

    q: Array
    dq: Array
    ddq: Array
    run_up: Array
    detach: Array

    def landings(self, height: float, gravity: float) -> tuple[Array, Array, Array]:
        """x [m], theta [rad] and flight time [s] of coming down through `height`; NaN if not."""
        x, theta, time = land(self.detach, height, gravity).T
        return x, theta, time


class ReleaseSampler:
    """Draws feasible releases of a scene."""

    def __init__(self, scene: Scene, mover: Mover) -> None:
        self.scene = scene
        self.mover = mover
        self.profile = scene.gripper.profile()
        self.release = SlidingPivot(scene.body, scene.patch, scene.gravity)

    def draw(self, count: int, seed: int = 0) -> Releases:
        """`count` random states, filtered and thrown; fewer come back."""
        rng = np.random.default_rng(seed)
        limits, n = self.mover.planning, self.mover.size
        q = rng.uniform(limits.q_min, limits.q_max, (count, n))
        dq = rng.uniform(-limits.dq, limits.dq, (count, n))
        ddq = rng.uniform(-0.9, 0.9, (count, n)) * limits.ddq
        # Some just let go at rest.
        still = slice(count - max(count // 20, 1), count)
        dq[still], ddq[still] = 0.0, 0.0
        if self.mover.start is not None:
            q[-1] = self.mover.start
        run_up = self.run_up_time(dq, ddq, rng)
        if self.mover.start is not None:
            run_up = np.maximum(run_up, 0.25)
        keep = self.within_limits(q, dq, ddq, run_up)
        q, dq, ddq, run_up = q[keep], dq[keep], ddq[keep], run_up[keep]
        if len(q) == 0:
            return Releases(q, dq, ddq, run_up, np.zeros((0, 6)))
        keep = self.held(q, dq, ddq)
        q, dq, ddq, run_up = q[keep], dq[keep], ddq[keep], run_up[keep]
        if len(q) == 0:
            return Releases(q, dq, ddq, run_up, np.zeros((0, 6)))
        states, _ = self.throw(q, dq, ddq, TABLE_STEPS)
        return Releases(q, dq, ddq, run_up, states)

    def run_up_time(self, dq: Array, ddq: Array, rng: np.random.Generator) -> Array:
        """Run-up time that keeps the run-up's mean acceleration under the limits."""
        needed = (np.abs(dq) / self.mover.planning.ddq).max(axis=1)
        longer = needed * rng.uniform(1.3, 2.2, needed.size)
        return np.asarray(np.clip(longer, 0.12, self.scene.mesh.carry_max))

    def within_limits(
        self, q: Array, dq: Array, ddq: Array, run_up: Array
    ) -> npt.NDArray[np.bool_]:
        """Limits at the run-up's start, at both ends of the opening and after braking."""
        limits, opening = self.mover.planning, self.profile.opening
        end = q + dq * opening + ddq * opening**2 / 2
        rate = dq + ddq * opening
        stop = end + rate * np.abs(rate) / (2 * BRAKE_SHARE * limits.ddq)
        a, b = _run_up_shape(dq, ddq, run_up[:, None])
        start = q - a * run_up[:, None] ** 3 / 3 - b * run_up[:, None] ** 4 / 4
        positions = [end, stop] if self.mover.start is not None else [start, end, stop]
        inside = np.abs(rate) <= limits.dq
        for position in positions:
            inside &= (position >= limits.q_min) & (position <= limits.q_max)
        if self.mover.start is not None:
            # From a given start: as far as the run-up's time allows.
            gap = np.abs(q - self.mover.start - dq * run_up[:, None] / 2)
            inside &= gap <= 0.15 * limits.ddq * run_up[:, None] ** 2
        return np.asarray(inside.all(axis=1))

    def hands(self, q: Array, dq: Array, ddq: Array, times: Array) -> list[HandMotion]:
        """Hand motion at `times` of the opening for constant accelerations; arrays of N."""
        return [self._hand(q, dq, ddq, t)[2] for t in times]

    def _hand(self, q: Array, dq: Array, ddq: Array, t: float) -> tuple[Array, Array, HandMotion]:
        """Hand pose (3, N), twist (3, N) and motion at time t."""
        outputs = self.mover.motion((q + dq * t + ddq * t * t / 2).T, (dq + ddq * t).T, ddq.T)
        pose, twist, acceleration = (np.array(o) for o in outputs)
        return pose, twist, HandMotion(pose[2], twist[2], *acceleration)

    def held(self, q: Array, dq: Array, ddq: Array) -> npt.NDArray[np.bool_]:
        """Whether the full grip holds the bar at the opening's start, and it is off the floor."""
        pose, _, hand = self._hand(q, dq, ddq, 0.0)
        theta = hand.theta + self.scene.grasp.angle
        h = self.scene.com_offset
        wrench = pivot_wrench(
            self.scene.body,
            self.scene.gravity,
            hand,
            hand.omega,
            h * np.cos(theta),
            h * np.sin(theta),
        )
        use = self.scene.patch.utilisation_squared(*wrench, self.profile.full)
        keep = use <= (1 - self.scene.mesh.sticking_margin) ** 2
        workspace = self.scene.workspace
        if workspace is not None and workspace.floor is not None:
            reach = self.scene.object.length - self.scene.grasp.offset
            keep &= pose[1] + reach * np.sin(theta) > workspace.floor + self.scene.object.width / 2
        return np.asarray(keep)

    def throw(self, q: Array, dq: Array, ddq: Array, steps: int) -> tuple[Array, list[Array]]:
        """Detach states (N, 6) by the exact sliding pivot, and the relative states per step."""
        opening = self.profile.opening
        times = np.linspace(0.0, opening, 2 * steps + 1)
        forces = self.profile.force(times)
        state = [np.zeros(len(q)) for _ in range(6)]
        state[2] = np.full(len(q), self.scene.grasp.angle)
        track = [np.array(state)]
        hand = self._hand(q, dq, ddq, 0.0)[2]
        for i in range(steps):
            middle = self._hand(q, dq, ddq, times[2 * i + 1])[2]
            pose, twist, end = self._hand(q, dq, ddq, times[2 * i + 2])
            state = rk4_step(
                self.release.rates,
                state,
                [hand, middle, end],
                list(forces[2 * i : 2 * i + 3]),
                opening / steps,
            )
            hand = end
            track.append(np.array(state))
        return np.array(self.release.com_state(state, pose, twist, hand)).T, track


def _run_up_shape(dq: Array, ddq: Array, time: Array) -> tuple[Array, Array]:
    """a, b of the run-up rate a t^2 + b t^3 that ends at dq with acceleration ddq."""
    return 3 * dq / time**2 - ddq / time, ddq / time**2 - 2 * dq / time**3


def nearest(
    releases: Releases,
    scene: Scene,
    x: float,
    height: float,
    theta: float | None,
    count: int,
) -> tuple[npt.NDArray[np.int_], Array]:
    """Indices and scaled distances [m] (39) of the `count` nearest landings, nearest first."""
    land_x, land_theta, time = releases.landings(height, scene.gravity)
    distance = np.abs(land_x - x)
    if theta is not None:
        distance = distance + np.abs(land_theta - theta) * scene.object.length / 2
    distance = np.where(np.isfinite(time), distance, np.inf)
    order = np.argsort(distance)[:count]
    order = order[np.isfinite(distance[order])]
    return order, distance[order]


def guess_from(
    nlp: ThrowNlp, sampler: ReleaseSampler, releases: Releases, index: int, height: float
) -> Array:
    """Decision vector that starts the NLP from release `index`."""
    s: Structure = nlp.structure
    one = slice(index, index + 1)
    q, dq, ddq = releases.q[index], releases.dq[index], releases.ddq[index]
    run_up, opening = float(releases.run_up[index]), sampler.profile.opening
    _, track = sampler.throw(
        releases.q[one], releases.dq[one], releases.ddq[one], s.opening * s.substeps
    )
    flight = float(releases.landings(height, sampler.scene.gravity)[2][index])
    a, b = _run_up_shape(dq, ddq, np.array(run_up))
    start = sampler.mover.start
    end = s.carry + s.opening

    def coordinates(k: int) -> tuple[Array, Array, Array]:
        if k <= s.carry:
            t = run_up * k / s.carry
            position = q - a * (run_up**3 - t**3) / 3 - b * (run_up**4 - t**4) / 4
            rate, acceleration = a * t**2 + b * t**3, 2 * a * t + 3 * b * t**2
            if start is not None:
                return _from_start(start, q, dq, ddq, run_up, t)
            return position, rate, acceleration
        t = opening * (k - s.carry) / s.opening
        return q + dq * t + ddq * t**2 / 2, dq + ddq * t, ddq

    def value(name: str, k: int) -> Array | float:
        if name in ("q", "dq", "ddq"):
            return coordinates(k)[("q", "dq", "ddq").index(name)]
        if name == "c":
            dt = run_up / s.carry if k < s.carry else opening / s.opening
            before, after = coordinates(k), coordinates(k + 1)
            if s.jerk_control:
                return (after[2] - before[2]) / dt / JERK_UNIT
            return (after[1] - before[1]) / dt
        if name == "rel":
            state = track[(k - s.carry) * s.substeps][:, 0]
            return state if s.pivot else state[[0, 1, 3, 4]]
        if name.startswith("t_cup"):
            return flight + 0.02 * (int(name[5:]) - (s.cup - 1) / 2)
        return {"T": run_up, "t_f": flight}.get(name, 0.0)

    assert math.isfinite(flight) and end == len(nlp.nx) - 1
    return nlp.fill(value)


def _from_start(
    start: Array, q: Array, dq: Array, ddq: Array, run_up: float, t: float
) -> tuple[Array, Array, Array]:
    """Quintic from rest at `start` to the release state."""
    T = run_up
    gap = q - start
    c3 = (20 * gap - 8 * dq * T + ddq * T**2) / (2 * T**3)
    c4 = (-30 * gap + 14 * dq * T - 2 * ddq * T**2) / (2 * T**4)
    c5 = (12 * gap - 6 * dq * T + ddq * T**2) / (2 * T**5)
    return (
        start + c3 * t**3 + c4 * t**4 + c5 * t**5,
        3 * c3 * t**2 + 4 * c4 * t**3 + 5 * c5 * t**4,
        6 * c3 * t + 12 * c4 * t**2 + 20 * c5 * t**3,
    )
