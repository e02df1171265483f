"""Release models run for a report: the throws, the methods, and converged answers.

Every law has a converged answer by a method that none of its rows is; a second method
tells how well it is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models.contact import Body, Contact, HandMotion
from ...models.flight import land
from ...models.grip_force import LinearRelease
from ...models.hand_track import ConstantAcceleration
from ...models.integrate import rk4_step
from ...models.limit_surface_release import ImplicitRelease, KarnoppRelease
from ...models.lugre_release import LuGreRelease
from ...models.patch import scaled_patch
from ...models.patch_release import Throws, march, single
from ...models.release import Release, ReleaseCase
from ...models.sliding_pivot import SlidingPivot
from ...models.sliding_pivot_release import (
    SlidingPivotRelease,
    number_symbols,
    numbers,
    world_release,
)
from ...models.smoothing import relative_widths
from ...models.time_stepping_release import SteppedRelease

Array = npt.NDArray[np.float64]
Run = Callable[[ReleaseCase], Release]

#: Height of the landing [m]; the hand is at 0 when its grip begins to fall.
HEIGHT = -0.9
#: LuGre stiffnesses sigma_0 [1/m], hardest first.
STIFFNESSES = (1e7, 1e6, 1e5)
#: Speed [m/s] over which friction builds up in converged answers: it moves them by less
#: than 0.001 mm of landing.
CREEP = 1e-10


@dataclass(frozen=True)
class Throw:
    """One of the report's releases. length [m] of the object, for the scaled error (39)."""

    key: str
    title: str
    case: ReleaseCase
    length: float


def four_throws() -> list[Throw]:
    """Drop, decelerating and accelerating throw, slow opening; the full grip holds all."""
    bar, long_bar = Body(0.24, 535e-6, 0.10), Body(0.24, 802e-6, 0.16)
    pads = Contact(1.0, 0.0025, 0.6, 2)

    def case(
        body: Body, contact: Contact, grip: tuple[float, float], *hand: Sequence[float]
    ) -> ReleaseCase:
        full, opening = grip
        return ReleaseCase(
            body, contact, LinearRelease(full, 0.0, opening), ConstantAcceleration(*hand)
        )

    still = (0.0, 0.0, 0.0)
    drop = case(
        Body(0.2, 5e-4, 0.10), Contact(0.8, 0.0075, 0.6, 2), (50.0, 0.05), still, still, still
    )
    start, twist = (0.0, 0.0, 0.6), (1.6, 1.2, 4.2)
    slower = case(bar, pads, (50.0, 0.05), start, twist, (-6.0, -8.0, -15.0))
    faster = case(bar, pads, (100.0, 0.05), start, twist, (4.0, 3.0, 8.0))
    slow = case(long_bar, pads, (100.0, 0.2), (0.0, 0.0, 1.0), (1.4, 1.6, 3.0), (-4.0, -6.0, -10.0))
    return [
        Throw("drop", "drop from a still hand", drop, 0.20),
        Throw("decelerating", "decelerating throw", slower, 0.26),
        Throw("accelerating", "accelerating throw", faster, 0.26),
        Throw("slow", "slow opening, 200 ms", slow, 0.26),
    ]


def detached(release: Release) -> Array:
    """x, z, theta, v_x, v_z, omega (6,) at the end of the opening."""
    return np.concatenate([release.com[:, -1], release.com_twist[:, -1]])


def differences(found: Array, truth: Array, gravity: float, length: float) -> Array:
    """Errors (4, N) of detach states (N, 6): landing x [m] and theta [rad], detach twist
    |dv| + |d omega| l / 2 [m/s], and the scaled landing error (39), |dx| + |d theta| l / 2 [m].
    """
    a, b = land(found, HEIGHT, gravity), land(truth, HEIGHT, gravity)
    x, theta = np.abs((a - b)[:, :2]).T
    off = found - truth
    twist = np.hypot(off[:, 3], off[:, 4]) + np.abs(off[:, 5]) * length / 2
    return np.array([x, theta, twist, x + theta * length / 2])


def micro(seconds: float) -> int | float:
    """Microseconds as they are read: whole ones from 100 on."""
    value = 1e6 * seconds
    return round(value) if value >= 100 else value


# Methods.


@dataclass(frozen=True)
class Method:
    """One way to compute a release.

    family: its line in a diagram; setting: in words; law: which converged answer it
    approaches ('sp', 'ls', 'ils', 'patch', or a LuGre stiffness).
    """

    family: str
    setting: str
    law: str
    run: Run


@dataclass(frozen=True)
class SmoothedRelease:
    """The sliding pivot with rounded corners, as the NLP has it, by even Runge-Kutta steps."""

    epsilon: float
    steps: int

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        widths = relative_widths(self.epsilon, case.body, case.contact, case.gravity)
        law = SlidingPivot(case.body, case.contact, case.gravity, widths=widths)
        instants = np.linspace(0.0, case.grip.opening, 2 * self.steps + 1)
        hand, forces = case.hand.at(instants), case.grip.force(instants)
        table = np.vstack([hand.pose[2], hand.twist[2], hand.acceleration, forces])
        dt = np.full(self.steps, case.grip.opening / self.steps)
        columns = np.vstack([table[:, 0:-2:2], table[:, 1:-1:2], table[:, 2::2], dt])
        start = np.array([0, 0, case.grasp_angle, 0, 0, 0], float)
        parameters = np.vstack([numbers(case), [[self.epsilon]]])
        stepper = _smoothed_steps(self.steps)
        track = np.array(stepper(start, columns, np.repeat(parameters, self.steps, axis=1)))
        nodes = case.hand.at(instants[::2])
        return world_release(law, nodes, np.column_stack([start, track]), forces[::2])


@cache
def _smoothed_steps(steps: int) -> ca.Function:
    """`steps` steps as one function: (state (6,), columns (19, steps), numbers and epsilon)."""
    p, body, contact, gravity = number_symbols()
    state, u, epsilon = ca.SX.sym("state", 6), ca.SX.sym("u", 19), ca.SX.sym("epsilon")
    widths = relative_widths(epsilon, body, contact, gravity)
    law = SlidingPivot(body, contact, gravity, widths=widths)
    parts = [ca.vertsplit(u[6 * i : 6 * i + 6]) for i in range(3)]
    hands = [HandMotion(*part[:5]) for part in parts]
    new = rk4_step(law.rates, state, hands, [part[5] for part in parts], u[18])
    inputs = [state, u, ca.vertcat(p, epsilon)]
    return ca.Function("smoothed", inputs, [ca.cse(ca.vertcat(*new))]).mapaccum("smoothed", steps)


def stepped(steps: int, case: ReleaseCase) -> Release:
    """The limit surface in even steps, without the instants at which slip begins."""
    times = np.linspace(0.0, case.grip.opening, steps + 1)
    return SteppedRelease(steps).along(case, case.hand.at(times))


def extrapolated(
    run: Callable[[int, ReleaseCase], Release], steps: int, case: ReleaseCase
) -> Release:
    """Twice the result of 2 `steps` less that of `steps`: the first order's error is gone."""
    coarse, fine = run(steps, case), run(2 * steps, case)
    end = 2 * detached(fine) - detached(coarse)
    times = np.array([case.grip.opening])
    return Release(times, end[:3, None], end[3:, None], trouble=coarse.trouble or fine.trouble)


def patched(steps: int, case: ReleaseCase) -> Release:
    """The meshed Coulomb patch, without the instants at which slip begins."""
    return single(march(Throws.of(case, steps)))


def bristled(stiffness: float, steps: int, case: ReleaseCase) -> Release:
    """LuGre bristles on the same mesh."""
    return LuGreRelease(stiffness=stiffness, steps=steps).release(case)


def methods(quick: bool) -> Iterator[Method]:
    """All rows of one throw's table, in the order in which they are read."""

    def some(*steps: int) -> tuple[int, ...]:
        return steps[::2] if quick else steps

    for steps in some(10, 20, 40, 80, 160, 320, 640, 1280, 2560):
        run = SlidingPivotRelease(steps=steps, integrator="euler").release
        yield Method("sp, Euler", f"{steps} steps", "sp", run)
    for steps in some(5, 10, 20, 40, 80, 160, 320, 640, 1280):
        yield Method("sp, RK4", f"{steps} steps", "sp", SlidingPivotRelease(steps=steps).release)
    for steps in some(2, 4, 8, 16, 32, 64):
        run = SlidingPivotRelease(steps=steps, events=True).release
        yield Method("sp, RK4, events located", f"{steps} steps", "sp", run)
    pairs = ((0.3, 10), (0.1, 20), (0.03, 40), (0.01, 80), (3e-3, 160), (1e-3, 320), (1e-4, 1280))
    for epsilon, steps in pairs[::2] if quick else pairs:
        run = SmoothedRelease(epsilon, steps).release
        yield Method("sp, smoothed, RK4", f"ε {epsilon:g}, {steps} steps", "sp", run)
    yield from _surfaces(quick)
    for steps in some(10, 20, 50, 100, 200, 500, 1000, 2000, 5000):
        yield Method("ls-step", f"{steps} steps", "ls", partial(stepped, steps))
    for steps in some(5, 10, 20, 40, 80, 160, 320, 640):
        words = f"{steps} and {2 * steps} steps"
        yield Method("ls-step, extrapolated", words, "ls", partial(extrapolated, stepped, steps))
    for steps in some(25, 50, 100, 200, 500, 1000, 2000)[: 3 if quick else 7]:
        yield Method("patch", f"{steps} steps", "patch", partial(patched, steps))
    for stiffness in STIFFNESSES:
        for steps in (50, 200) if quick else (50, 200, 500):
            words = f"σ₀ {stiffness:.0e} 1/m, {steps} steps".replace("e+0", "e")
            run = partial(bristled, stiffness, steps)
            yield Method("LuGre", words, f"{stiffness:g}", run)


def _surfaces(quick: bool) -> Iterator[Method]:
    """The published limit surface: explicit, and smoothed with a stiff integrator."""
    for steps in (500,) if quick else (100, 500, 2500):
        yield Method("ls, Karnopp, Euler", f"{steps} steps", "ls", KarnoppRelease(steps).release)
    run = KarnoppRelease(500, half_band=0.01).release
    yield Method("ls, Karnopp, Euler", "500 steps, d 0.01 m/s", "ls", run)
    settings = [(1e-2, 1e-3), (1e-2, 1e-4), (1e-2, 1e-6), (1e-2, 1e-8)]
    settings += [(1e-3, 1e-4), (1e-3, 1e-6), (1e-4, 1e-6), (1e-5, 1e-6), (1e-6, 1e-6)]
    for integrator in ("LSODA", "Radau", "BDF"):
        for d, rtol in settings[2::4] if quick else settings:
            budget = 12_000 if quick else 100_000
            model = ImplicitRelease(
                d, "paper", integrator, rtol, rtol / 100, samples=2, budget=budget
            )
            words = f"d {d:g} m/s, rtol {rtol:g}"
            yield Method(f"ils, {integrator}", words, "ils", model.release)


# Converged answers.


def pivot_truth(case: ReleaseCase, epsilon: float | None = None) -> Array:
    """Detach state (6,) of the sliding pivot by DOP853 at 1e-13; smoothed, given `epsilon`.

    Its steps shrink at the corners of the law by themselves.
    """
    from scipy.integrate import solve_ivp

    widths = None
    if epsilon is not None:
        widths = relative_widths(epsilon, case.body, case.contact, case.gravity)
    law = SlidingPivot(case.body, case.contact, case.gravity, widths=widths)

    def motion(t: float) -> tuple[Array, Array, HandMotion]:
        hand = case.hand.at(np.array([t]))
        pose, twist, a = (np.asarray(v)[:, 0] for v in (hand.pose, hand.twist, hand.acceleration))
        return pose, twist, HandMotion(pose[2], twist[2], *a)

    def rates(t: float, state: Array) -> Array:
        return np.array(law.rates(state, motion(t)[2], float(case.grip.force(t))), float)

    end, start = case.grip.opening, np.array([0, 0, case.grasp_angle, 0, 0, 0], float)
    options = {"rtol": 1e-13, "atol": 1e-15, "max_step": end / 100}
    run = solve_ivp(rates, (0.0, end), start, "DOP853", [end], **options)
    pose, twist, hand = motion(end)
    return np.array(law.com_state(run.y[:, -1], pose, twist, hand), float)


def surface_truth(case: ReleaseCase) -> Array:
    """Detach state (6,) of the limit surface (19) as a differential equation, see `_creeping`."""
    return _creeping(case, np.zeros((2, 1)), np.ones(1), float(case.contact.torsion_arm))


def patch_truth(case: ReleaseCase) -> Array:
    """Detach state (6,) of the meshed patch as a differential equation, see `_creeping`."""
    patch, arm = scaled_patch(case.contact, "uniform", 64)
    return _creeping(case, float(arm) * np.array([patch.x, patch.z]), patch.weights)


def _creeping(case: ReleaseCase, places: Array, weights: Array, arm: float = 0.0) -> Array:
    """Detach state (6,) by Radau, friction mu N u / sqrt(|u|^2 + CREEP^2) at each point.

    places (2, P) [m] in the hand's frame, weights (P,): its points. u: the slip of a point;
    with an `arm` [m] the turning slip times the arm is a third part of it, which makes a
    point the ellipsoid of a limit surface.
    """
    from scipy.integrate import solve_ivp

    mass = np.array([case.body.mass, case.body.mass, case.body.inertia])
    end = case.grip.opening

    def points(t: float, state: Array) -> tuple[Array, Array, Array, Array]:
        """Slips (3, P), their Jacobian (3, 3, P) by the CoM's twist, shares of friction, sizes."""
        hand = case.hand.at(np.array([t]))
        pose, twist = np.asarray(hand.pose)[:, 0], np.asarray(hand.twist)[:, 0]
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        x, z = np.array([[cos, -sin], [sin, cos]]) @ places
        x_r, z_r = state[:2] - pose[:2]
        one, none = np.ones_like(x), np.zeros_like(x)
        moves = np.array([[one, none, z_r - z], [none, one, x - x_r], [none, none, arm * one]])
        u = np.einsum("ijp,j->ip", moves, state[3:])
        u -= np.array([twist[0] - twist[2] * z, twist[1] + twist[2] * x, twist[2] * arm * one])
        size = np.sqrt((u * u).sum(axis=0) + CREEP * CREEP)
        limit = float(case.contact.force_limit(case.grip.force(t)))
        return u, moves, limit * weights / size, size

    def rates(t: float, state: Array) -> Array:
        u, moves, share, _ = points(t, state)
        wrench = -np.einsum("ijp,ip,p->j", moves, u, share)
        return np.concatenate([state[3:], wrench / mass - [0.0, case.gravity, 0.0]])

    def jacobian(t: float, state: Array) -> Array:
        """By the twist alone, which is what makes the equations stiff."""
        u, moves, share, size = points(t, state)
        along = np.einsum("ijp,ip->jp", moves, u) / size
        damping = np.einsum("ijp,ikp,p->jk", moves, moves, share) - (along * share) @ along.T
        none = np.zeros((3, 3))
        return np.block([[none, np.eye(3)], [none, -damping / mass[:, None]]])

    options = {"jac": jacobian, "rtol": 1e-8, "atol": 1e-12, "first_step": 1e-7 * end}
    run = solve_ivp(rates, (0.0, end), case.start(), "Radau", [end], **options)
    return np.asarray(run.y[:, -1]) if run.success else np.full(6, np.nan)
