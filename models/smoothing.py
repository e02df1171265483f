"""Rounded corners for the friction laws, so that an NLP can differentiate them.

A width of zero gives the non-smooth law itself.
"""

from __future__ import annotations

from dataclasses import dataclass

from .backend import Value, backend
from .contact import Body, Contact

#: Acceleration [m/s^2] that keeps the widths above zero in zero gravity.
ACCELERATION_FLOOR = 1.0


def soft_positive(value: Value, width: Value) -> Value:
    """max(value, 0) rounded over `width` (same unit): (v + sqrt(v^2 + w^2)) / 2."""
    return 0.5 * (value + backend(value, width).sqrt(value * value + width * width))


def positive(value: Value) -> Value:
    """max(value, 0)."""
    return backend(value).maximum(value, 0.0)


@dataclass(frozen=True)
class Widths:
    """Rounding widths: force [N] and torque [N m]."""

    force: Value
    torque: Value


def relative_widths(epsilon: Value, body: Body, contact: Contact, gravity: Value) -> Widths:
    """Widths of `epsilon` times the body's weight and its weight's torque about the grasp.

    Both stay above zero at g = 0 and h = 0 (an acceleration of 1 m/s^2 and the
    patch radius stand in), because a release that transmits nothing has a zero
    wrench and a zero limit at once, where derivatives must stay finite.
    """
    xp = backend(gravity, body.com_offset, contact.patch_radius)
    force = epsilon * body.mass * xp.sqrt(gravity * gravity + ACCELERATION_FLOOR**2)
    arm = xp.sqrt(body.com_offset**2 + contact.patch_radius**2)
    return Widths(force, force * arm)
