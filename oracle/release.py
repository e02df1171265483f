"""The bar while the pads open, for N throws at once: by the limit surface or the sliding pivot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from .motion import Array, Curve

#: Steps of an opening; results are extrapolated from this and the double number. Landings then err
#: by 0.05 mm and 0.04 deg on the hardest built-in scene (hand-flip), by a tenth of that on others.
STEPS = 2000
#: Most Newton iterations of a step.
NEWTON = 60
#: Newton iterations end at this error of the radius, a share of it.
CLOSE = 1e-12
#: A table's fall starts at this loss of force, a share of its first value.
FALL = 0.01


@dataclass(frozen=True)
class Held:
    """Real parameters of N held bars, each (N,): mass [kg], inertia [kg m^2] about the CoM,
    offset h [m] of the CoM from the pads, angle [rad] of their axis to the hand's; friction;
    arm [m]: torsional over tangential limit; opening [s]; begins [s]: when the force falls;
    omega [rad/s]: of the hand beyond its motion, from then on. full [N]: of one pad, faces."""

    mass: Array
    inertia: Array
    offset: Array
    angle: Array
    friction: Array
    arm: Array
    opening: Array
    begins: Array
    omega: Array
    full: float
    faces: int
    gravity: float
    gripper: Any

    def lever(self, theta: Array) -> tuple[Array, Array]:
        """The CoM from the pads where the hand is at theta."""
        return self.offset * np.cos(theta + self.angle), self.offset * np.sin(theta + self.angle)

    def wrench(self, hand: tuple[Array, Array, Array], share: Any = slice(None)) -> Array:
        """Force x, z [N] and torque [N m] about the pads' centre (3, ...) that carries the bar.

        By Newton's and Euler's laws for a body that moves as one with the hand.
        """
        (pose, twist, acceleration), m = hand, self.mass[share]
        theta, rate, turn = pose[..., 2] + self.angle[share], twist[..., 2], acceleration[..., 2]
        r_x, r_z = self.offset[share] * np.cos(theta), self.offset[share] * np.sin(theta)
        f_x = m * (acceleration[..., 0] - turn * r_z - rate**2 * r_x)
        f_z = m * (acceleration[..., 1] + turn * r_x - rate**2 * r_z + self.gravity)
        return np.array([f_x, f_z, self.inertia[share] * turn + r_x * f_z - r_z * f_x])

    def grip(self, shares: Array) -> Array:
        """Force of one pad over the full one at shares of the opening."""
        if self.gripper.force is not None:
            return np.clip(1.0 - shares, 0.0, 1.0)
        t, f = np.array(self.gripper.times), np.array(self.gripper.forces)
        f[-1] = 0.0
        start = max(int(np.flatnonzero(f < (1 - FALL) * f[0])[0]) - 1, 0)
        stop = int(np.flatnonzero(f > 1e-9 * f.max())[-1]) + 2
        curve = PchipInterpolator(t[start:stop] - t[start], f[start:stop])
        return np.asarray(np.maximum(curve(shares * (t[stop - 1] - t[start])), 0.0) / f[0])


@dataclass(frozen=True)
class Released:
    """The bar's CoM (K, N, 3) at `times` (K, N) [s] while the pads open, and its twist (N, 3) at
    the end."""

    times: Array
    com: Array
    twist: Array


def released(held: Held, hand: Curve, model: str, steps: int = STEPS) -> Released:
    """The release by the model `ls-step` or `sp` of a scene's tolerance.

    The first is of first order in its steps: two runs are extrapolated.
    """
    shares = np.linspace(0.0, 1.0, steps + 1)[:, None] + 0 * held.begins
    halves = np.empty((2 * len(shares) - 1, shares.shape[1]))
    halves[::2], halves[1::2] = shares, (shares[1:] + shares[:-1]) / 2
    if model == "sp":
        return pivoting(held, hand, halves)
    coarse, fine = (surface(held, hand, each) for each in (shares, halves))
    com = 2 * fine.com[::2] - coarse.com
    return Released(coarse.times, com, 2 * fine.twist - coarse.twist)


def _tracks(held: Held, hand: Curve, shares: Array) -> tuple[Array, Array, Array, Array]:
    """Times (K, N) at shares of the opening, and the hand's pose, twist and acceleration
    (K, N, 3) then."""
    since = shares * held.opening
    pose, twist, acceleration = hand.at(held.begins + since)
    pose[..., 2] += held.omega * since
    twist[..., 2] += held.omega
    return held.begins + since, pose, twist, acceleration


def _stuck(held: Held, pose: Array, twist: Array) -> tuple[Array, Array]:
    """CoM pose and twist (3, N) of a bar that sticks to hands (N, 3)."""
    r_x, r_z = held.lever(pose[:, 2])
    com = np.array([pose[:, 0] + r_x, pose[:, 1] + r_z, pose[:, 2] + held.angle])
    rate = twist[:, 2]
    return com, np.array([twist[:, 0] - rate * r_z, twist[:, 1] + rate * r_x, rate])


def surface(held: Held, hand: Curve, shares: Array) -> Released:
    """The limit surface stepped on impulses: of those inside it the one that dissipates most."""
    times, pose, twist, _ = _tracks(held, hand, shares)
    com, v = _stuck(held, pose[0], twist[0])
    steps, m, i = np.diff(times, axis=0), held.mass, held.inertia
    middle = held.grip((shares[:-1] + shares[1:]) / 2)
    scale = np.array([held.friction, held.friction, held.friction * held.arm])
    a, b = scale[0] ** 2 / m, 1.0 / i
    found, shift = [com], np.zeros(m.size)
    for k, dt in enumerate(steps):
        radius = held.faces * held.full * middle[k] * dt
        x, z = (com[:2] + dt / 2 * v[:2]) - (pose[k, :, :2] + pose[k + 1, :, :2]).T / 2
        free = v - np.array([0 * dt, held.gravity * dt, 0 * dt])
        # The impulse at the CoM with which the contact follows the hand, then that at the pads.
        rate = twist[k + 1, :, 2]
        wanted = twist[k + 1, :, 0] - rate * z, twist[k + 1, :, 1] + rate * x
        p_x, p_z = m * (wanted[0] - free[0]), m * (wanted[1] - free[1])
        torque = i * (rate - free[2]) + x * p_z - z * p_x
        y = np.array([p_x, p_z, torque]) / scale * (radius > 0.0)
        slides = np.flatnonzero((y**2).sum(axis=0) > radius**2)
        if slides.size:
            # K y = -c, K = diag(a, a, 0) + b w w^T, with the sticking y; sliding: (K + s) y = -c.
            w = np.array([scale[0] * z, -scale[1] * x, scale[2]])
            rhs = np.array([a * y[0], a * y[1], 0 * a]) + b * (w * y).sum(axis=0) * w
            part = rhs[:, slides], w[:, slides], a[slides], b[slides], radius[slides]
            y[:, slides], shift[slides] = _sliding(*part, shift[slides])
        p = scale * y
        before = v
        v = free + np.array([p[0] / m, p[1] / m, (p[2] + p[0] * z - p[1] * x) / i])
        com = com + dt * (before + v) / 2
        found.append(com)
    return Released(times, np.array(found).transpose(0, 2, 1), v.T)


def _sliding(
    rhs: Array, w: Array, a: Array, b: Array, radius: Array, shift: Array
) -> tuple[Array, Array]:
    """y (3, N) of (diag(a, a, 0) + b w w^T + s) y = rhs with |y| = radius, and s (N,).

    Newton's method on 1/|y(s)|, kept between bounds: |y| falls with s.
    """
    size = np.sqrt((rhs**2).sum(axis=0)) / radius
    low = np.maximum(size - a - b * (w**2).sum(axis=0), 0.0)
    high = size
    s = np.where((shift > low) & (shift < high), shift, np.maximum(low, 1e-9 * high))

    def solved(right: Array, s: Array) -> Array:
        d = np.array([a + s, a + s, s])
        u, right = w / d, right / d
        return right - u * (b * (w * right).sum(axis=0) / (1 + b * (w * u).sum(axis=0)))

    for _ in range(NEWTON):
        y = solved(rhs, s)
        norm = np.sqrt((y**2).sum(axis=0))
        if (np.abs(norm - radius) <= CLOSE * radius).all():
            break
        low, high = np.where(norm > radius, s, low), np.where(norm < radius, s, high)
        step = s + norm**2 * (norm / radius - 1) / (y * solved(y, s)).sum(axis=0)
        s = np.where((step > low) & (step < high), step, (low + high) / 2)
    return y * (radius / norm), s


def pivoting(held: Held, hand: Curve, shares: Array) -> Released:
    """The sliding pivot in its continuous form, by the classical Runge-Kutta method; every
    second of the shares is in the middle of a step."""
    times, pose, twist, acceleration = _tracks(held, hand, shares)
    limit = held.faces * held.full * held.friction * held.grip(shares)
    m, h, inertia = held.mass, held.offset, held.inertia + held.mass * held.offset**2

    def slope(k: int, state: Array) -> Array:
        s_x, s_z, turned, v_x, v_z, rate = state
        theta, omega = pose[k, :, 2] + held.angle + turned, twist[k, :, 2] + rate
        a_x, a_z, alpha = acceleration[k].T
        r_x, r_z = s_x + h * np.cos(theta), s_z + h * np.sin(theta)
        f_x = m * (a_x - alpha * r_z - omega**2 * r_x)
        f_z = m * (a_z + alpha * r_x - omega**2 * r_z + held.gravity)
        torque = inertia * alpha - m * (a_x * r_z - a_z * r_x) + m * held.gravity * r_x
        pivot = np.maximum(np.abs(torque) - held.arm * limit[k], 0.0)
        force = np.hypot(f_x, f_z)
        over = np.maximum(force - limit[k], 0.0) / np.maximum(force, 1e-300)
        slide = over * (r_z * f_x - r_x * f_z)
        more = (-np.sign(torque) * pivot - slide) / inertia
        turn = alpha + more
        slip_x = -turn * s_z - omega**2 * s_x - over * f_x / m
        slip_z = turn * s_x - omega**2 * s_z - over * f_z / m
        return np.array([v_x, v_z, rate, slip_x, slip_z, more])

    state = np.zeros((6, m.size))
    states = [state]
    for k in range(0, len(shares) - 1, 2):
        dt = times[k + 2] - times[k]
        one = slope(k, state)
        two = slope(k + 1, state + dt / 2 * one)
        three = slope(k + 1, state + dt / 2 * two)
        four = slope(k + 2, state + dt * three)
        state = state + dt / 6 * (one + 2 * two + 2 * three + four)
        states.append(state)
    s = np.array(states)
    theta = pose[::2, :, 2] + held.angle + s[:, 2]
    lever = np.array([s[:, 0] + h * np.cos(theta), s[:, 1] + h * np.sin(theta)])
    com = np.stack([*(pose[::2, :, :2].transpose(2, 0, 1) + lever), theta], axis=2)
    rate, (r_x, r_z) = twist[-1, :, 2] + state[5], lever[:, -1]
    # The slip's rate is added to the CoM's as the bar turns about the pads.
    v_x = twist[-1, :, 0] + state[3] - rate * (r_z - state[1])
    v_z = twist[-1, :, 1] + state[4] + rate * (r_x - state[0])
    return Released(times[::2], com, np.column_stack([v_x, v_z, rate]))
