"""A release by the time-stepping limit surface, for any of the surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from .contact import Contact
from .limit_surface import Ellipsoid, LimitSurface, Quartic, ellipsoid
from .release import BLEW_UP, HandSamples, Release, ReleaseCase
from .sliding_pivot_release import number_symbols, numbers
from .slip_onset import slip_onset, surface_gauge
from .time_stepping import HandState, LimitSurfaceStepping

Array = npt.NDArray[np.float64]
Shape = Callable[[Contact], LimitSurface]


@dataclass(frozen=True)
class SteppedRelease:
    """Moreau-Jean steps on a limit surface; `steps` over the opening, first order."""

    steps: int = 1000
    shape: Shape = ellipsoid

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        times = np.linspace(0.0, case.grip.opening, self.steps + 1)
        pivot, slide = slip_onset(case, surface_gauge(self.shape(case.contact)))
        return replace(self.along(case, case.hand.at(times)), pivot=pivot, slide=slide)

    def along(self, case: ReleaseCase, hand: HandSamples) -> Release:
        """The same for hand samples at steps + 1 even instants of the opening, without onsets."""
        times = hand.times - hand.times[0]
        dt = times[-1] / self.steps
        forces = case.grip.force(times[:-1] + dt / 2)
        surface = self.shape(case.contact)
        start = case.start()
        if isinstance(surface, Quartic):
            states = _quartic_steps(case, surface, hand, forces, dt)
        else:
            table = np.vstack([hand.pose, hand.twist])
            columns = np.vstack([table[:, :-1], table[:, 1:], forces, np.full(self.steps, dt)])
            factor = _factor(case.contact, surface)[:, None]
            parameters = np.vstack([numbers(case), factor])
            stepper = _compiled(self.steps)
            track = stepper(start, columns, np.repeat(parameters, self.steps, axis=1))
            states = np.column_stack([start, np.array(track)])
        trouble = "" if np.isfinite(states).all() else BLEW_UP
        wrench = _friction(case, states, hand, dt)
        return Release(times, states[:3], states[3:], wrench=wrench, trouble=trouble)


def _factor(contact: Contact, surface: LimitSurface) -> Array:
    """Columns of S with S S^T = A^-1, as nine numbers."""
    if not isinstance(surface, Ellipsoid):
        raise TypeError(f"no time stepping for a {type(surface).__name__}")
    return np.linalg.cholesky(surface.inverse).T.ravel()


def _friction(case: ReleaseCase, states: Array, hand: HandSamples, dt: float) -> Array:
    """Contact wrench (3, K) of each step, from the change of momentum in it."""
    change = np.diff(states[3:], axis=1) / dt
    f_x, f_z = case.body.mass * change[0], case.body.mass * (change[1] + case.gravity)
    middle = (states[:2, :-1] + states[:2, 1:] - hand.pose[:2, :-1] - hand.pose[:2, 1:]) / 2
    torque = case.body.inertia * change[2] - f_x * middle[1] + f_z * middle[0]
    wrench = np.vstack([f_x, f_z, torque])
    return np.column_stack([wrench[:, :1], wrench])


@cache
def _compiled(steps: int) -> ca.Function:
    """`steps` steps as one function: (state (6,), columns (14, steps), numbers) -> states."""
    p, body, contact, gravity = number_symbols()
    state, u, s = ca.SX.sym("state", 6), ca.SX.sym("u", 14), ca.SX.sym("s", 9)
    parts, entries = ca.vertsplit(u), ca.vertsplit(s)
    factor = (tuple(entries[0:3]), tuple(entries[3:6]), tuple(entries[6:9]))
    law = LimitSurfaceStepping(body, contact, gravity, factor=factor)
    new = law.step(state, HandState(*parts[:6]), HandState(*parts[6:12]), parts[12], parts[13])
    inputs = [state, u, ca.vertcat(p, s)]
    return ca.Function("ls", inputs, [ca.cse(ca.vertcat(*new))]).mapaccum("ls", steps)


def _quartic_steps(
    case: ReleaseCase, surface: Quartic, hand: HandSamples, forces: Array, dt: float
) -> Array:
    """States (6, K) of the same steps on a surface without a closed form."""
    mass = np.array([case.body.mass, case.body.mass, case.body.inertia])
    fall = np.array([0.0, -case.gravity * dt, 0.0])
    state = case.start()
    states = [state]
    for k, force in enumerate(forces):
        start, end, twist = hand.pose[:, k], hand.pose[:, k + 1], hand.twist[:, k + 1]
        x_r, z_r = state[:2] + dt / 2 * state[3:5] - (start + end)[:2] / 2
        g = np.array([[1, 0, z_r], [0, 1, -x_r], [0, 0, 1]])
        free = state[3:] + fall
        inverse_mass = (g / mass) @ g.T
        impulse = quartic_impulse(
            surface, inverse_mass, g @ free - twist, case.contact.faces * force * dt
        )
        velocity = free + (g.T @ impulse) / mass
        # As in LimitSurfaceStepping: the hand's own way, carried over to the CoM, and slip.
        way = end - start - dt * twist
        pose = state[:3] + dt * velocity + way + way[2] * np.array([-z_r, x_r, 0.0])
        state = np.concatenate([pose, velocity])
        states.append(state)
    return np.array(states).T


def quartic_impulse(surface: Quartic, inverse_mass: Array, b: Array, radius: float) -> Array:
    """Impulse (3,) of maximum dissipation for the free contact twist `b` (3,).

    The minimiser of p.W p / 2 + b.p with gauge(p) <= radius.
    """
    scale = surface.scale
    k, rhs = inverse_mass * np.outer(scale, scale), -scale * b
    y: npt.NDArray[Any] = np.linalg.solve(k, rhs)
    if surface.gauge(scale * y) <= radius:
        return np.asarray(scale * y)
    if radius <= 0.0:
        return np.zeros(3)
    # In units of the radius, where the surface is H(y) = 1.
    k = k * radius
    y = y / surface.gauge(scale * y)
    found = _on_surface(surface, k, rhs, y)
    if found is None:
        found = _by_bisection(surface, k, rhs, y)
    return np.asarray(radius * scale * found / max(surface.gauge(scale * found), 1.0))


def _on_surface(
    surface: Quartic, k: Array, rhs: Array, y: npt.NDArray[Any]
) -> npt.NDArray[Any] | None:
    """K y + w grad H / 4 = rhs with H = 1 by Newton's method; None if it does not get there."""
    weight = float((rhs - k @ y) @ y)
    matrix, residual = np.zeros((4, 4)), np.zeros(4)
    for _ in range(25):
        gradient = surface.gradient(y) / 4
        residual[:3] = k @ y - rhs + weight * gradient
        residual[3] = (float(gradient @ y) - 1.0) / 4
        if np.abs(residual[:3]).max() < 1e-11 * np.abs(rhs).max() and abs(residual[3]) < 1e-12:
            return y if weight >= 0 else None
        matrix[:3, :3] = k + weight * surface.hessian(y) / 4
        matrix[:3, 3] = matrix[3, :3] = gradient
        try:
            step = np.linalg.solve(matrix, residual)
        except np.linalg.LinAlgError:
            return None
        share = min(1.0, 0.5 / max(float(np.abs(step[:3]).max()), 1e-300))
        y, weight = y - share * step[:3], weight - share * float(step[3])
    return None


def _by_bisection(surface: Quartic, k: Array, rhs: Array, y: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same, slowly and surely: bisection on the logarithm of the multiplier."""
    scale = surface.scale
    low, high = -40.0, float(np.log(np.linalg.norm(rhs) + np.abs(k).max())) + 3.0
    for _ in range(60):
        middle = (low + high) / 2
        y = _penalised(surface, k, rhs, float(np.exp(middle)), y)
        if surface.gauge(scale * y) > 1.0:
            low = middle
        else:
            high = middle
        if high - low < 1e-12:
            break
    return y


def _penalised(
    surface: Quartic, k: Array, rhs: Array, weight: float, y: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Minimiser of y.K y / 2 - rhs.y + weight H(y) / 4, by damped Newton steps."""

    def merit(value: Array) -> float:
        quartic = surface.gauge(surface.scale * value) ** 4
        return float(value @ k @ value / 2 - rhs @ value + weight * quartic / 4)

    for _ in range(40):
        residual = k @ y - rhs + weight * surface.gradient(y) / 4
        step = np.linalg.solve(k + weight * surface.hessian(y) / 4, residual)
        share, before = 1.0, merit(y)
        while share > 1e-8 and merit(y - share * step) > before:
            share /= 2
        y = y - share * step
        if np.abs(step).max() < 1e-13 * (1 + np.abs(y).max()):
            break
    return y
