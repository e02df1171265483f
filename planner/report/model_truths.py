"""Converged answers of the release models, by methods that none of the report's rows is."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import HandMotion, ReleaseCase, SlidingPivot, relative_widths, scaled_patch

Array = npt.NDArray[np.float64]

#: Speed [m/s] over which friction builds up in converged answers: it moves them by less
#: than 0.001 mm of landing.
CREEP = 1e-10


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


def patch_truth(case: ReleaseCase, points: int = 64) -> Array:
    """Detach state (6,) of the meshed patch as a differential equation, see `_creeping`."""
    patch, arm = scaled_patch(case.contact, "uniform", points)
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
