"""Sliding pivot (SP): stick, pivot about the pads, slide between them.

Section V of Liu and Billard, (28)-(38). The state is relative to the hand, so the
pivot constraint holds exactly until the body slides:

    s = (slip_x, slip_z)   slip of the pivot against the hand, world axes [m]
    theta_r                body angle minus hand angle [rad]
    and the rates of the three.

The CoM seen from the hand is r = s + h (cos theta, sin theta).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..backend import Value, backend, components
from ..body import Array, Body, HandMotion, PinchContact, pivot_wrench
from .cases import LOST_SLIP, BatchRelease, Release, ReleaseBatch, ReleaseCase
from .integrators import by_levels, compiled_batch, pivot_steps

Form = Literal["continuous", "paper"]


def soft_positive(value: Value, width: Value) -> Value:
    """max(value, 0) rounded over `width` (same unit): (v + sqrt(v^2 + w^2)) / 2."""
    return 0.5 * (value + backend(value, width).sqrt(value * value + width * width))


def positive(value: Value) -> Value:
    """max(value, 0)."""
    return backend(value).maximum(value, 0.0)


@dataclass(frozen=True)
class Widths:
    """Rounding widths of max and |.|: force [N] and torque [N m]."""

    force: Value
    torque: Value

    @classmethod
    def relative(cls, epsilon: Value, body: Body, contact: PinchContact, gravity: Value) -> Widths:
        """Widths of `epsilon` times the body's weight and its weight's torque about the grasp.

        Both are above zero at g = 0 and h = 0, by an acceleration of 1 m/s^2 and the patch
        radius: a release without load has zero wrench at zero limit, and derivatives there must be
        finite.
        """
        xp = backend(gravity, body.com_offset, contact.patch_radius)
        force = epsilon * body.mass * xp.sqrt(gravity * gravity + 1.0)
        arm = xp.sqrt(body.com_offset**2 + contact.patch_radius**2)
        return cls(force, force * arm)


@dataclass(frozen=True)
class SlidingPivot:
    """The SP law for one body, contact and gravity.

    form: 'continuous' lets the contact slip with -Delta/m on top of the pivot
    motion; 'paper' takes (36) while sliding and jumps at slide onset.
    widths: rounding of max and |.|; None is the non-smooth law.
    """

    body: Body
    contact: PinchContact
    gravity: Value = 9.81
    form: Form = "continuous"
    widths: Widths | None = None

    def lever(self, state: Value, hand: HandMotion) -> tuple[Value, Value]:
        """r [m]: the CoM seen from the centre of the pads."""
        theta = hand.theta + state[2]
        xp = backend(theta)
        h = self.body.com_offset
        return state[0] + h * xp.cos(theta), state[1] + h * xp.sin(theta)

    def com_state(
        self, state: Value, pose: Value, twist: Value, hand: HandMotion
    ) -> tuple[Value, ...]:
        """CoM pose and twist in the world: x, z, theta, v_x, v_z, omega.

        `pose`, `twist`: rows or values (x, z, theta) of the hand and their rates.
        """
        x_r, z_r = self.lever(state, hand)
        omega = hand.omega + state[5]
        # The pivot moves with the hand and slips; the rest turns about it.
        v_x = twist[0] + state[3] - omega * (z_r - state[1])
        v_z = twist[1] + state[4] + omega * (x_r - state[0])
        return pose[0] + x_r, pose[1] + z_r, hand.theta + state[2], v_x, v_z, omega

    def excess(self, state: Value, hand: HandMotion, normal_force: Value) -> tuple[Value, Value]:
        """Excess of the pivot wrench over the friction limits: (torque [N m], force [N]).

        Above zero the body pivots, or slides; these are the event functions of the
        non-smooth law.
        """
        _, _, force_norm, torque_size, force_limit = self._load(state, hand, normal_force)
        return torque_size - self.contact.torsion_arm * force_limit, force_norm - force_limit

    def rates(self, state: Value, hand: HandMotion, normal_force: Value) -> list[Value]:
        """Time derivative of the six relative states under `normal_force` of one pad [N]."""
        state = components(state)
        force, torque, force_norm, torque_size, force_limit = self._load(state, hand, normal_force)
        body = self.body
        x_r, z_r = self.lever(state, hand)
        omega = hand.omega + state[5]

        # (34) with the sign of the torque itself, not of its magnitude.
        over_torque = torque_size - self.contact.torsion_arm * force_limit
        over_force = force_norm - force_limit
        if self.widths is None:
            over_torque, over_force = positive(over_torque), positive(over_force)
        else:
            over_torque = soft_positive(over_torque, self.widths.torque)
            over_force = soft_positive(over_force, self.widths.force)
        alpha_pivot = -torque / torque_size * over_torque / body.grasp_inertia

        # Delta: the part of the pivot force that friction cannot give.
        share = over_force / force_norm
        delta_x, delta_z = share * force[0], share * force[1]
        alpha_slide = (-x_r * delta_z + z_r * delta_x) / body.grasp_inertia
        alpha_r = alpha_pivot - alpha_slide
        alpha = hand.alpha + alpha_r

        # r'' = s'' + h e(theta)'': the slip is the rest of the pivot's motion.
        h_x, h_z = x_r - state[0], z_r - state[1]
        xp = backend(over_force, h_x, alpha_r)
        if self.form == "continuous":
            slip_x = -alpha * state[1] - omega * omega * state[0] - delta_x / body.mass
            slip_z = alpha * state[0] - omega * omega * state[1] - delta_z / body.mass
        else:
            # (36): the world acceleration of the CoM under saturated friction.
            free_x = (force[0] - delta_x) / body.mass - hand.a_x
            free_z = (force[1] - delta_z) / body.mass - self.gravity - hand.a_z
            slip_x = xp.where(over_force > 0, free_x + alpha * h_z + omega * omega * h_x, 0.0)
            slip_z = xp.where(over_force > 0, free_z - alpha * h_x + omega * omega * h_z, 0.0)
        if self.widths is None:
            lost = self.lost(state)
            fall_x, fall_z = -hand.a_x, -self.gravity - hand.a_z
            slip_x = xp.where(lost, fall_x + omega * omega * h_x, slip_x)
            slip_z = xp.where(lost, fall_z + omega * omega * h_z, slip_z)
            alpha_r = xp.where(lost, -hand.alpha, alpha_r)
        return [state[3], state[4], state[5], slip_x, slip_z, alpha_r]

    def lost(self, state: Value) -> Value:
        """Whether the body has slid out of the pads before detach."""
        limit = abs(self.body.com_offset) + LOST_SLIP
        return state[0] * state[0] + state[1] * state[1] > limit * limit

    def friction(
        self, state: Value, hand: HandMotion, normal_force: Value
    ) -> tuple[Value, Value, Value]:
        """Friction on the body at the contact: (f_x, f_z) [N] and torque [N m]."""
        force, torque, force_norm, torque_size, limit = self._load(state, hand, normal_force)
        xp = backend(force_norm, torque_size, limit)
        share = xp.minimum(limit / force_norm, 1.0)
        turning = xp.minimum(self.contact.torsion_arm * limit / torque_size, 1.0)
        return share * force[0], share * force[1], turning * torque

    def _load(
        self, state: Value, hand: HandMotion, normal_force: Value
    ) -> tuple[tuple[Value, Value], Value, Value, Value, Value]:
        """Pivot force and torque, their sizes (above zero), and the force limit."""
        x_r, z_r = self.lever(state, hand)
        f_x, f_z, torque = pivot_wrench(
            self.body, self.gravity, hand, hand.omega + state[5], x_r, z_r
        )
        # A negligible width of the non-smooth sizes: 0/0 at a zero wrench is 0.
        force_width = 1e-12 if self.widths is None else self.widths.force
        torque_width = 1e-14 if self.widths is None else self.widths.torque
        xp = backend(f_x, f_z, torque)
        force_norm = xp.sqrt(f_x * f_x + f_z * f_z + force_width * force_width)
        torque_size = xp.sqrt(torque * torque + torque_width * torque_width)
        return (f_x, f_z), torque, force_norm, torque_size, self.contact.force_limit(normal_force)


@dataclass(frozen=True)
class SlidingPivotRelease:
    """Releases by the sliding pivot in one of its forms.

    steps: about so many over the opening, cut where pivot or slide begins or ends, so that they
    keep their order.
    """

    form: Form = "continuous"
    steps: int = 100

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        release, states = pivot_steps(case, self.steps, paper=self.form == "paper")
        law, times = SlidingPivot(case.body, case.contact, case.gravity), release.times
        friction = law.friction(states.T, case.hand.at(times).motion, case.grip.force(times))
        return replace(release, wrench=np.vstack(friction))

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """N releases by the non-smooth law in `steps` graded Runge-Kutta steps.

        The number is doubled for throws with fast swings. Steps end at jumps of the hands'
        accelerations; across a jump their order would be one.
        """
        return by_levels(batch, lambda part, factor: self._steps(part, steps * factor))

    def _steps(self, part: ReleaseBatch, steps: int) -> BatchRelease:
        # Time [s] from a kink of the hand's motion to the next reading of its acceleration.
        gap, paper = 1e-9 if part.hands.kinks.size else 0.0, self.form == "paper"
        return compiled_batch("sliding_pivot", part, _shares(part, steps), gap, paper=paper)


def _shares(batch: ReleaseBatch, steps: int) -> Array:
    """Ends and middles of graded steps as shares of the opening (K,); (K, N) with kinks of hands.

    They are denser towards its end, where the body slides: the landing error is a tenth of that of
    even steps.
    """
    nodes = 1.0 - (1.0 - np.linspace(0.0, 1.0, steps + 1)) ** 2.0
    if batch.hands.kinks.size:
        kinks = (batch.hands.kinks[:, None] - batch.hands.delays) / batch.opening
        alike = np.broadcast_to(nodes[:, None], (nodes.size, batch.count))
        nodes = np.sort(np.vstack([alike, np.clip(kinks, 0.0, 1.0)]), axis=0)
    both = np.empty((2 * len(nodes) - 1, *nodes.shape[1:]))
    both[::2], both[1::2] = nodes, (nodes[:-1] + nodes[1:]) / 2
    return both
