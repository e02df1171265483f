"""The throw of a given motion by the non-smooth models: the truth plans are held to.

One CasADi function per model steps through the whole opening, so that a check costs
milliseconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from ..models.contact import Body, Contact, HandMotion, pivot_wrench
from ..models.flight import FlightState, time_to_height
from ..models.integrate import rk4_step
from ..models.limit_surface import HandState, LimitSurfaceStepping
from ..models.sliding_pivot import Form, SlidingPivot
from ..problems.scene import Scene
from .motion import Motion
from .mover import Mover

Array = npt.NDArray[np.float64]

#: Steps over the opening: enough that halving them moves a landing by under 0.01 mm
#: (sliding pivot) and 0.2 mm (limit surface).
SLIDING_PIVOT_STEPS = 1000
LIMIT_SURFACE_STEPS = 2000
#: Grid [s] on which sticking is checked before the opening.
CARRY_STEP = 0.0005


@dataclass(frozen=True)
class HandSamples:
    """Hand pose, twist and acceleration, each (3, N), at `times` (N,)."""

    times: Array
    pose: Array
    twist: Array
    acceleration: Array

    @property
    def motion(self) -> HandMotion:
        """What the sliding pivot needs, as arrays."""
        return HandMotion(self.pose[2], self.twist[2], *self.acceleration)


def hand_samples(mover: Mover, motion: Motion, times: Array) -> HandSamples:
    """The hand at `times` of a motion of the coordinates."""
    outputs = mover.motion(*motion.at(times))
    return HandSamples(times, *(np.array(o) for o in outputs))


@dataclass(frozen=True)
class Release:
    """One release by one model.

    times (N,) from the start of the opening [s]; com (3, N) and com_twist (3, N) of the
    object; pivot, slide: onset times [s], None if it never happens.
    """

    times: Array
    com: Array
    com_twist: Array
    pivot: float | None
    slide: float | None

    @property
    def detach(self) -> FlightState:
        """State at the end of the opening."""
        return FlightState(*self.com[:, -1], *self.com_twist[:, -1])


@dataclass(frozen=True)
class Landing:
    """Where and when the CoM comes down through a height; NaN if it never does."""

    x: float
    z: float
    theta: float
    flight_time: float
    state: FlightState


def landing(release: Release, height: float, gravity: float) -> Landing:
    """Flight of a release to `height` [m]."""
    time = time_to_height(release.detach, height, gravity)
    end = release.detach.after(time, gravity)
    return Landing(end.x, height if math.isfinite(time) else math.nan, end.theta, time, end)


def friction_use(scene: Scene, hand: HandSamples, com: Array | None = None) -> tuple[Array, Array]:
    """Wrench that sticking needs, over the full grip's limits: (force share, torque share).

    For a held bar; shares above 1 slip.
    """
    theta = hand.pose[2] + scene.grasp.angle
    h = scene.com_offset
    f_x, f_z, torque = pivot_wrench(
        scene.body, scene.gravity, hand.motion, hand.twist[2], h * np.cos(theta), h * np.sin(theta)
    )
    limit = scene.patch.force_limit(scene.gripper.profile().full)
    return np.hypot(f_x, f_z) / limit, np.abs(torque) / (limit * scene.patch.torsion_arm)


def slip_while_carrying(scene: Scene, mover: Mover, motion: Motion, opening_time: float) -> float:
    """Largest friction use (ellipsoid, 1 is the limit) from rest to the opening's start."""
    steps = max(math.ceil(opening_time / CARRY_STEP), 2)
    hand = hand_samples(mover, motion, np.linspace(0.0, opening_time, steps + 1))
    force, torque = friction_use(scene, hand)
    return float(np.sqrt(force**2 + torque**2).max())


def sliding_pivot_release(
    scene: Scene,
    mover: Mover,
    motion: Motion,
    opening_time: float,
    form: Form = "continuous",
    steps: int = SLIDING_PIVOT_STEPS,
) -> Release:
    """The non-smooth sliding pivot through the opening that starts at `opening_time` [s]."""
    profile = scene.gripper.profile()
    instants = np.linspace(0.0, profile.opening, 2 * steps + 1)
    hand = hand_samples(mover, motion, opening_time + instants)
    return sliding_pivot_along(scene, hand, instants, form)


def sliding_pivot_along(
    scene: Scene, hand: HandSamples, instants: Array, form: Form = "continuous"
) -> Release:
    """The same along given hand samples at 2 n + 1 even `instants` of the opening."""
    steps = (len(instants) - 1) // 2
    forces = scene.gripper.profile().force(instants)
    table = np.vstack([hand.pose[2], hand.twist[2], hand.acceleration, forces])
    columns = np.vstack([table[:, 0:-2:2], table[:, 1:-1:2], table[:, 2::2]])
    columns = np.vstack([columns, np.full(steps, instants[-1] / steps)])
    start = np.array([0, 0, scene.grasp.angle, 0, 0, 0], float)
    stepper = _sliding_pivot_steps(form, steps)
    track = np.array(stepper(start, columns, np.repeat(_numbers(scene), steps, axis=1)))
    states = np.column_stack([start, track])
    release = SlidingPivot(scene.body, scene.patch, scene.gravity, form)
    nodes = HandMotion(hand.pose[2, ::2], hand.twist[2, ::2], *hand.acceleration[:, ::2])
    x_r, z_r = release.lever(states, nodes)
    omega = nodes.omega + states[5]
    com = np.vstack([hand.pose[0, ::2] + x_r, hand.pose[1, ::2] + z_r, nodes.theta + states[2]])
    twist = np.vstack(
        [
            hand.twist[0, ::2] + states[3] - omega * (z_r - states[1]),
            hand.twist[1, ::2] + states[4] + omega * (x_r - states[0]),
            omega,
        ]
    )
    torque, force = release.excess(states, nodes, forces[::2])
    times = instants[::2]
    return Release(times, com, twist, _onset(times, torque), _onset(times, force))


def limit_surface_release(
    scene: Scene,
    mover: Mover,
    motion: Motion,
    opening_time: float,
    steps: int = LIMIT_SURFACE_STEPS,
) -> Release:
    """The time-stepping limit surface through the opening that starts at `opening_time` [s]."""
    opening = scene.gripper.profile().opening
    instants = np.linspace(0.0, opening, steps + 1)
    return limit_surface_along(
        scene, hand_samples(mover, motion, opening_time + instants), instants
    )


def limit_surface_along(scene: Scene, hand: HandSamples, instants: Array) -> Release:
    """The same along given hand samples at n + 1 even `instants` of the opening."""
    steps = len(instants) - 1
    dt = instants[-1] / steps
    forces = scene.gripper.profile().force(instants[:-1] + dt / 2)
    table = np.vstack([hand.pose, hand.twist])
    columns = np.vstack([table[:, :-1], table[:, 1:], forces, np.full(steps, dt)])
    theta = hand.pose[2, 0] + scene.grasp.angle
    h = scene.com_offset
    x_r, z_r = h * math.cos(theta), h * math.sin(theta)
    v_x, v_z, omega = hand.twist[:, 0]
    start = np.array(
        [
            hand.pose[0, 0] + x_r,
            hand.pose[1, 0] + z_r,
            theta,
            v_x - omega * z_r,
            v_z + omega * x_r,
            omega,
        ]
    )
    stepper = _limit_surface_steps(steps)
    track = np.array(stepper(start, columns, np.repeat(_numbers(scene), steps, axis=1)))
    states = np.column_stack([start, track])
    # The stepping has no pivot or slide of its own: contact motion against the hand.
    return Release(instants, states[:3], states[3:], None, None)


def _onset(times: Array, excess: Array) -> float | None:
    """First time the excess is above zero, between grid points by linear interpolation."""
    above = np.flatnonzero(excess > 0)
    if above.size == 0:
        return None
    i = int(above[0])
    if i == 0:
        return float(times[0])
    low, high = excess[i - 1], excess[i]
    return float(times[i - 1] + (times[i] - times[i - 1]) * -low / (high - low))


def _numbers(scene: Scene) -> Array:
    body, contact = scene.body, scene.patch
    values = [body.mass, body.inertia, body.com_offset, contact.friction, contact.patch_radius]
    return np.array([*values, contact.torsion, contact.faces, scene.gravity])[:, None]


def _symbols() -> tuple[ca.SX, Body, Contact, Any]:
    p = ca.SX.sym("p", 8)
    return p, Body(p[0], p[1], p[2]), Contact(p[3], p[4], p[5], p[6]), p[7]


@cache
def _sliding_pivot_steps(form: Form, steps: int) -> ca.Function:
    """`steps` Runge-Kutta steps: (state (6,), columns (19, steps), numbers) -> states."""
    p, body, contact, gravity = _symbols()
    state, u = ca.SX.sym("state", 6), ca.SX.sym("u", 19)
    release = SlidingPivot(body, contact, gravity, form)
    parts = [ca.vertsplit(u[6 * i : 6 * i + 6]) for i in range(3)]
    hands = [HandMotion(*part[:5]) for part in parts]
    new = rk4_step(release.rates, state, hands, [part[5] for part in parts], u[18])
    return ca.Function("sp", [state, u, p], [ca.cse(ca.vertcat(*new))]).mapaccum("sp", steps)


@cache
def _limit_surface_steps(steps: int) -> ca.Function:
    """`steps` Moreau-Jean steps: (state (6,), columns (14, steps), numbers) -> states."""
    p, body, contact, gravity = _symbols()
    state, u = ca.SX.sym("state", 6), ca.SX.sym("u", 14)
    parts = ca.vertsplit(u)
    stepping = LimitSurfaceStepping(body, contact, gravity)
    new = stepping.step(state, HandState(*parts[:6]), HandState(*parts[6:12]), parts[12], parts[13])
    return ca.Function("ls", [state, u, p], [ca.cse(ca.vertcat(*new))]).mapaccum("ls", steps)
