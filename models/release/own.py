"""Releases by a law of a user's own: a subclass of `SlidingPivot` with other `rates`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..body import Array, Flags, HandMotion, HandSamples
from .cases import BatchRelease, Release, ReleaseBatch, ReleaseCase
from .integrators import rk4_step, track_length
from .sliding_pivot import SlidingPivot


@dataclass(frozen=True)
class OwnRelease:
    """Releases by Runge-Kutta steps of the law without smoothing.

    steps: of each interval between two nodes of the track, which are 2 ms apart at most.
    """

    law: type[SlidingPivot]
    steps: int = 8

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        opening = case.grip.opening
        times = opening * self._shares(track_length(opening))
        law = self.law(case.body, case.contact, case.gravity)
        hands = [case.hand.at(np.array([time])) for time in times]
        forces = [np.array([force]) for force in case.grip.force(times)]
        pose, twist, lost = self._steps(law, hands, forces, opening, case.grasp_angle)
        nodes = np.column_stack([times[:: 2 * self.steps], pose[..., 0], twist[..., 0]])
        return Release.from_nodes(nodes, lost=bool(lost[0]))

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """N releases; they ignore `steps`."""
        shares = self._shares(track_length(float(batch.opening.max())))
        law = self.law(batch.body, batch.contact, batch.gravity)
        hands = [batch.hands.at(share * batch.opening) for share in shares]
        opening, angle = batch.opening, batch.grasp_angle
        pose, twist, lost = self._steps(law, hands, batch.forces(shares), opening, angle)
        detach = np.concatenate([pose[-1], twist[-1]]).T
        times = shares[:: 2 * self.steps, None] * opening
        track = np.concatenate([times[:, None], pose], axis=1).transpose(2, 0, 1)
        return BatchRelease(detach, lost, track=np.ascontiguousarray(track))

    def _shares(self, nodes: int) -> Array:
        """Ends and middles of all steps as shares of the opening."""
        return np.linspace(0.0, 1.0, 2 * self.steps * (nodes - 1) + 1)

    def _steps(
        self,
        law: SlidingPivot,
        hands: list[HandSamples],
        forces: list[Array],
        opening: Array | float,
        grasp_angle: Array | float,
    ) -> tuple[Array, Array, Flags]:
        """CoM pose and twist (K, 3, N) at the nodes, from hands and forces at `_shares`; flags (N,)
        of the bodies that slide out of the pads before the end."""
        zero = np.zeros(hands[0].pose.shape[1])
        lost = np.zeros(zero.shape, bool)
        state = [zero, zero, zero + grasp_angle, zero, zero, zero]
        dt, found = 2 * np.asarray(opening) / (len(hands) - 1), []
        for k in range(0, len(hands), 2):
            if k:
                motions: list[HandMotion] = [hand.motion for hand in hands[k - 2 : k + 1]]
                state = rk4_step(law.rates, state, motions, tuple(forces[k - 2 : k + 1]), dt)
            if k < len(hands) - 1:
                lost |= np.broadcast_to(law.lost(state), lost.shape)
            if k % (2 * self.steps) == 0:
                com = law.com_state(state, hands[k].pose, hands[k].twist, hands[k].motion)
                found.append(np.array(np.broadcast_arrays(*com)))
        every = np.array(found)
        return every[:, :3], every[:, 3:], lost
