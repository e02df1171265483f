"""The release models run for a report: every method and setting of its tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import (
    HandMotion,
    ImplicitRelease,
    KarnoppRelease,
    LuGreRelease,
    PatchThrows,
    Release,
    ReleaseCase,
    SlidingPivot,
    SlidingPivotRelease,
    SteppedRelease,
    euler_step,
    march_patch,
    number_symbols,
    numbers,
    relative_widths,
    rk4_step,
    single_release,
    world_release,
)
from .model_throws import detached

Array = npt.NDArray[np.float64]
Run = Callable[[ReleaseCase], Release]

#: LuGre stiffnesses sigma_0 [1/m], hardest first.
STIFFNESSES = (1e7, 1e6, 1e5)


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


def python_loop(steps: int, case: ReleaseCase) -> Release:
    """The paper's way: explicit Euler steps of the sliding pivot, one by one in Python."""
    law = SlidingPivot(case.body, case.contact, case.gravity)
    times = np.linspace(0.0, case.grip.opening, steps + 1)
    state = np.array([0, 0, case.grasp_angle, 0, 0, 0], float).tolist()
    for k, t in enumerate(times):
        hand = case.hand.at(times[k : k + 1])
        pose, twist, a = (np.asarray(v)[:, 0] for v in (hand.pose, hand.twist, hand.acceleration))
        motion = HandMotion(*(float(v) for v in (pose[2], twist[2], *a)))
        if k < steps:
            dt = float(times[1])
            state = euler_step(law.rates, state, [motion], [float(case.grip.force(t))], dt)
    end = np.array(law.com_state(state, pose, twist, motion), float)[:, None]
    return Release(times[-1:], end[:3], end[3:])


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
    return single_release(march_patch(PatchThrows.of(case, steps)))


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
    budget = 12_000 if quick else 100_000
    for integrator in ("LSODA", "Radau", "BDF"):
        # A hundred times slower than other rows; what narrow d costs, LSODA shows.
        few = settings[1:7:5] if integrator == "LSODA" else settings[:1]
        for d, rtol in few if quick else settings:
            model = ImplicitRelease(
                d, "paper", integrator, rtol, rtol / 100, samples=2, budget=budget
            )
            words = f"d {d:g} m/s, rtol {rtol:g}"
            yield Method(f"ils, {integrator}", words, "ils", model.release)
