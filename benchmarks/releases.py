"""The releases that section `models` compares: throws, every method, and converged answers.

Converged answers come from other methods than those compared: the sliding pivot by DOP853 at
1e-13, whose steps shrink at the corners of the law by themselves; the limit surface and the meshed
patch as differential equations whose friction is rounded over `CREEP`, by Radau.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from throwplan.models import (
    Array,
    Body,
    FlightLaw,
    HandMotion,
    PinchContact,
    Trajectory,
    pivot_wrench,
)
from throwplan.models.release import (
    STEPPED_SURFACE,
    ImplicitRelease,
    KarnoppRelease,
    LinearGrip,
    Release,
    ReleaseCase,
    SlidingPivot,
    SlidingPivotRelease,
    SteppedRelease,
)
from throwplan.models.release.patch import PatchRelease, disc

from .plain_pivot import PlainPivot

Run = Callable[[ReleaseCase], Release]

#: Landing height [m]; the hand is at 0 at the start of the force's fall.
HEIGHT = -0.9
#: Gravity [m/s^2].
GRAVITY = 9.81
#: LuGre stiffnesses sigma_0 [1/m], hardest first.
STIFFNESSES = (1e7, 1e6, 1e5)
#: Speeds d [m/s] of smoothed friction, and relative tolerances of its integrators.
SMOOTHED = ((1e-2, 1e-3), (1e-2, 1e-6), (1e-3, 1e-6), (1e-4, 1e-6))
#: Speed [m/s] that regularises friction in converged answers: it moves landings by < 0.001 mm.
CREEP = 1e-10
#: Largest use of the ellipsoid by a random throw's load at full grip; the patch's own limit surface
#: lies up to 6.6 % inside it.
GRIP_USE = 0.9
#: Number of random throws drawn for each that is kept.
SPARE = 20
#: Length [m] of the object, for pose errors.
LENGTH = 0.26


def random_throws(count: int, seed: int) -> dict[str, Any]:
    """Random throws that the full grip holds, as the arguments of `simulate_batch`.

    h 2-20 cm, m 0.1-0.4 kg, hand 1-3 m/s, turning at 0-6 rad/s, accelerations to 8 m/s^2 along
    each axis and 20 rad/s^2, opening 30-100 ms, grip 20-235 N (a 2F-85's), mu 0.3-1, r_p 2.5-10 mm.
    """
    rng, many = np.random.default_rng(seed), SPARE * count

    def uniform(low: float, high: float) -> Array:
        return rng.uniform(low, high, many)

    mass = uniform(0.1, 0.4)
    body = Body(mass, mass * uniform(0.03, 0.08) ** 2, uniform(0.02, 0.2))
    contact = PinchContact(uniform(0.3, 1.0), uniform(0.0025, 0.01))
    speed, up, zero = uniform(1.0, 3.0), uniform(np.radians(10), np.radians(70)), np.zeros(many)
    pose = np.array([zero, zero, uniform(-np.pi / 3, np.pi / 2)])
    twist = np.array([speed * np.cos(up), speed * np.sin(up), uniform(0.0, 6.0)])
    acceleration = np.array([uniform(-8, 8), uniform(-8, 8), uniform(-20, 20)])
    force, opening = uniform(20, 235), uniform(0.03, 0.1)
    motion = HandMotion(pose[2], twist[2], *acceleration)
    x_r, z_r = body.com_offset * np.cos(pose[2]), body.com_offset * np.sin(pose[2])
    load = pivot_wrench(body, GRAVITY, motion, twist[2], x_r, z_r)
    use = np.asarray(contact.utilisation_squared(*load, force))
    sticking = np.flatnonzero(use < GRIP_USE**2)[:count]
    return {
        "mass": mass[sticking],
        "inertia": np.asarray(body.inertia)[sticking],
        "com_offset": np.asarray(body.com_offset)[sticking],
        "friction": np.asarray(contact.friction)[sticking],
        "patch_radius": np.asarray(contact.patch_radius)[sticking],
        "force": force[sticking],
        "opening": opening[sticking],
        "hand": {
            "pose": pose.T[sticking],
            "twist": twist.T[sticking],
            "acceleration": acceleration.T[sticking],
        },
    }


def case_of(throws: Mapping[str, Any], i: int, contact: PinchContact) -> ReleaseCase:
    """Throw number i of `random_throws` by itself; contact: with torsion and faces."""
    number = {name: float(value[i]) for name, value in throws.items() if name != "hand"}
    hand = [throws["hand"][name][i] for name in ("pose", "twist", "acceleration")]
    return ReleaseCase(
        Body(*(number[name] for name in ("mass", "inertia", "com_offset"))),
        replace(contact, friction=number["friction"], patch_radius=number["patch_radius"]),
        LinearGrip(number["force"], 0.0, number["opening"]),
        Trajectory.accelerating(*hand),
        GRAVITY,
    )


def pose_errors(found: Array, truth: Array) -> Array:
    """Pose errors (N,) [m] of the landings of detach states (N, 6), (39): |dx| + |dtheta| l / 2."""
    a, b = (FlightLaw(GRAVITY).land(detach, HEIGHT) for detach in (found, truth))
    x, theta = np.abs((a - b)[:, :2]).T
    return np.asarray(x + theta * LENGTH / 2)


@dataclass(frozen=True)
class Method:
    """One way to compute a release.

    family: its line in the picture; setting: in words; law: which converged answer it approaches
    ('sp', 'ls', 'patch' or none); run: of one throw, or of all at once by the model `batch`.
    """

    family: str
    setting: str
    law: str
    run: Run | None = None
    batch: str = ""
    steps: int = 0


def methods(quick: bool) -> Iterator[Method]:
    """All ways to compute a release."""

    def some(*steps: int) -> tuple[int, ...]:
        return steps[1::3] if quick else steps

    for n in some(40, 80, 160, 320, 640, 1280, 2560):
        run = PlainPivot(steps=n, integrator="euler").release
        yield Method("sp, Euler", f"{n} steps", "sp", run)
    for n in some(10, 20, 40, 80, 160, 320, 640, 1280):
        yield Method("sp, RK4", f"{n} steps", "sp", PlainPivot(steps=n).release)
    for n in some(2, 4, 8, 16, 32, 64):
        run = SlidingPivotRelease(steps=n).release
        yield Method("sp, events located", f"{n} steps", "sp", run)
    yield Method("sp-paper, RK4", "1000 steps", "", PlainPivot("paper").release)
    for n in (500,) if quick else (100, 500, 2500):
        yield Method("ls, Karnopp, Euler", f"{n} steps", "ls", KarnoppRelease(n).release)
    for d, rtol in SMOOTHED[: 1 if quick else None]:
        for integrator in ("LSODA", "Radau"):
            model = ImplicitRelease(d, integrator, rtol, rtol / 100, samples=2, budget=50_000)
            words = f"d {d:g} m/s, rtol {rtol:g}"
            yield Method(f"ils, {integrator}", words, "ls", model.release)
    for n in some(20, 50, 100, 200, 500, 1000, 2000, 5000):
        yield Method(STEPPED_SURFACE, f"{n} steps", "ls", SteppedRelease(steps=n).release)
    for n in some(50, 100, 200, 500, 1000, 2000):
        yield Method("patch", f"{n} steps", "patch", PatchRelease(steps=n).release)
    for stiffness in STIFFNESSES:
        run = PatchRelease(stiffness=stiffness, steps=500).release
        name = f"LuGre, σ₀ {stiffness:.0e} 1/m".replace("e+0", "e")
        yield Method(name, "500 steps", "", run)
    for n in some(12, 24, 48, 96, 192):
        yield Method("sp, batch", f"{n} steps", "sp", None, "sp", n)
    for n in some(20, 40, 80, 120, 240, 480):
        yield Method("ls-step, batch", f"{n} steps", "ls", None, STEPPED_SURFACE, n)


def _hand(case: ReleaseCase, t: float) -> tuple[Array, Array, HandMotion]:
    """Pose, twist and motion of the hand at an instant [s]."""
    hand = case.hand.at(np.array([t]))
    pose, twist, a = (np.asarray(v)[:, 0] for v in (hand.pose, hand.twist, hand.acceleration))
    return pose, twist, HandMotion(*(float(v) for v in (pose[2], twist[2], *a)))


def pivot_truth(case: ReleaseCase) -> Array:
    """Detach state (6,) of the sliding pivot by DOP853 at 1e-13."""
    from scipy.integrate import solve_ivp

    law = SlidingPivot(case.body, case.contact, case.gravity)

    def rates(t: float, state: Array) -> Array:
        return np.array(law.rates(state, _hand(case, t)[2], float(case.grip.force(t))), float)

    end, start = case.grip.opening, np.array([0, 0, case.grasp_angle, 0, 0, 0], float)
    options = {"rtol": 1e-13, "atol": 1e-15, "max_step": end / 100}
    run = solve_ivp(rates, (0.0, end), start, "DOP853", [end], **options)
    return np.array(law.com_state(run.y[:, -1], *_hand(case, end)), float)


def surface_truth(case: ReleaseCase) -> Array:
    """Detach state (6,) of the limit surface (19) as a differential equation."""
    return _creeping(case, np.zeros((2, 1)), np.ones(1), float(case.contact.torsion_arm))


def patch_truth(case: ReleaseCase, points: int = 64) -> Array:
    """Detach state (6,) of the meshed patch as a differential equation."""
    patch = disc("uniform", points, float(case.contact.torsion_arm))
    return _creeping(case, np.array([patch.x, patch.z]), patch.weights)


#: Functions that compute converged answers, by law.
TRUTHS = {"sp": pivot_truth, "ls": surface_truth, "patch": patch_truth}


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
        pose, twist, _ = _hand(case, t)
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
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
        components = np.einsum("ijp,ip->jp", moves, u) / size
        damping = (
            np.einsum("ijp,ikp,p->jk", moves, moves, share) - (components * share) @ components.T
        )
        none = np.zeros((3, 3))
        return np.block([[none, np.eye(3)], [none, -damping / mass[:, None]]])

    options = {"jac": jacobian, "rtol": 1e-8, "atol": 1e-12, "first_step": 1e-7 * end}
    run = solve_ivp(rates, (0.0, end), case.start(), "Radau", [end], **options)
    return np.asarray(run.y[:, -1]) if run.success else np.full(6, np.nan)
