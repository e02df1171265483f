"""Why a release pivots: the overhanging beam on two contact points, section V-A.

A level bar rests on C1 and C2, at -r and +r from the middle of the pads; its CoM is at
h > 0, beyond C2. Each point carries half of the normal force. The sections of the paper:
sticking (who carries what), pivoting (a hinge at C1 while C2 slides), sliding.

Two findings beyond the text. Its torque about the CoM has the sign of a clockwise one;
its bound on f_1z holds as written for f_1z <= 0, as the hinge begins. And the hinge also
ends without a centripetal force: as the grip goes to zero the hinge force of a falling
bar goes to m g I / J_1 > 0, which a vanishing grip cannot hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .body import Array, Body, Contact


@dataclass(frozen=True)
class OverhangingBeam:
    """A level bar on two points at +-arm [m] from the pads' centre, its hand at rest.

    arm: r of the paper; None takes the contact's patch radius. Raises ValueError unless
    arm > 0 and com_offset >= 0.
    """

    body: Body
    contact: Contact
    arm: float | None = None
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if not self.half_span > 0:
            raise ValueError(f"arm: must be above 0, got {self.half_span:g}")
        if not self.body.com_offset >= 0:
            raise ValueError(f"com_offset: must not be negative, got {self.body.com_offset:g}")

    @property
    def half_span(self) -> float:
        """r [m]: distance of either point from the middle."""
        return float(self.contact.patch_radius if self.arm is None else self.arm)

    def point_limit(self, normal_force: npt.ArrayLike) -> Array:
        """f_max^C [N]: the friction limit of one point under f_N of one pad [N].

        Half of faces mu f_N; the paper's bar has one face.
        """
        return np.asarray(self.contact.force_limit(np.asarray(normal_force, float)) / 2.0)

    def sticking_forces(self) -> tuple[Array, Array]:
        """Forces (2,) [N] on the bar at C1 and C2, x and z, at rest.

        Remark 1: only the sum of the horizontal forces is given; the solution of least
        norm has none. Remark 2: with h >> r C2 carries many times half the weight, so
        sliding begins long before f_N falls to m g / mu.
        """
        weight = self.body.mass * self.gravity
        ratio = self.body.com_offset / self.half_span
        return (
            np.array([0.0, weight * (1.0 - ratio) / 2.0]),
            np.array([0.0, weight * (1.0 + ratio) / 2.0]),
        )

    def hinge_threshold(self) -> float:
        """f_N of one pad [N] at which C2 begins to slide: f_max^C = m g (1 + h/r) / 2.

        Remark 3: |f_1| < |f_2| for h > 0, so C2 always slides first and C1 is the hinge.
        """
        return float(self.sticking_forces()[1][1] / self.point_limit(1.0))

    def sliding_threshold(self) -> float:
        """f_N of one pad [N] at which C1 slides too, for a bar that does not turn yet.

        From f_1z = f_max^C in `hinge_force` at omega = 0:
        f_max^C = m g I / (2 (I + m h (h + r))). A turning bar slides sooner.
        """
        body = self.body
        far = body.mass * body.com_offset * (body.com_offset + self.half_span)
        limit = body.mass * self.gravity * body.inertia / (2.0 * (body.inertia + far))
        return float(limit / self.point_limit(1.0))

    def pivot_acceleration(self, normal_force: npt.ArrayLike) -> Array:
        """alpha [rad/s^2] about the hinge C1 while C2 slides downwards; negative.

        Torque about C1: -m g (h + r) + 2 r f_max^C.
        """
        reach, r = self.body.com_offset + self.half_span, self.half_span
        torque = 2.0 * r * self.point_limit(normal_force) - self.body.mass * self.gravity * reach
        return np.asarray(torque / self._hinge_inertia)

    def hinge_force(self, normal_force: npt.ArrayLike, omega: npt.ArrayLike = 0.0) -> Array:
        """Force (2, ...) [N] on the bar at C1 while C2 slides downwards and C1 is a hinge."""
        mass, reach = self.body.mass, self.body.com_offset + self.half_span
        alpha, limit = self.pivot_acceleration(normal_force), self.point_limit(normal_force)
        inward = -mass * reach * np.asarray(omega, float) ** 2
        upward = mass * (self.gravity + alpha * reach) - limit
        return np.array(np.broadcast_arrays(inward, upward))

    def hinge_holds(
        self, normal_force: npt.ArrayLike, omega: npt.ArrayLike = 0.0
    ) -> npt.NDArray[np.bool_]:
        """Whether C2 slides and C1 still sticks: |f_1| <= f_max^C.

        True from `hinge_threshold` down to `sliding_threshold` at omega = 0, and over
        less for a turning bar, whose centripetal force loads C1.
        """
        limit = self.point_limit(normal_force)
        sliding = limit < self.sticking_forces()[1][1]
        force = self.hinge_force(normal_force, omega)
        return np.asarray(sliding & (np.hypot(force[0], force[1]) <= limit))

    @property
    def _hinge_inertia(self) -> float:
        """J_1 [kg m^2] about C1."""
        reach = self.body.com_offset + self.half_span
        return float(self.body.inertia + self.body.mass * reach**2)
