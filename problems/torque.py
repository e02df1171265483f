"""Torque limits of the arm's joints, with the object in the hand."""

from __future__ import annotations

import dataclasses

from ..models import Arm
from .errors import InputError
from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Torque(Section):
    """Keeps the throwing joints' torques inside limits, by inverse dynamics.

    limits [N m]: one per throwing joint, the arm's own where absent. margin: share of them
    that planning keeps back. The arm's data need link masses. Left out are friction and rotors
    of the drives, and the joints that only hold the posture.
    """

    limits: tuple[float, ...] | None = quantity(above=0, most=1e6, default=None)
    margin: float = quantity(least=0, below=0.9, default=0.02)

    def of(self, arm: Arm, throwing_joints: tuple[int, ...]) -> tuple[float, ...]:
        """Limits of the throwing joints [N m], without margin."""
        if self.limits is not None:
            return self.limits
        return tuple(arm.limits.torque[joint - 1] for joint in throwing_joints)


def check_torque(torque: Torque, arm: Arm, throwing_joints: tuple[int, ...]) -> None:
    """InputError for an arm without masses and for too few or many limits."""
    if not arm.links:
        raise InputError(f"[torque]: arm {arm.name} has no link masses ('links' in its data file)")
    if torque.limits is not None and len(torque.limits) != len(throwing_joints):
        given = list(torque.limits)
        raise InputError(f"[torque] limits = {given}: must be a list of {len(throwing_joints)}")
