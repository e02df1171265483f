"""Fixed-step integration of a release model along a given hand motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .backend import Value, components
from .contact import HandMotion

Rates = Callable[[Value, HandMotion, Value], list[Value]]


def rk4_step(
    rates: Rates,
    state: Value,
    hand: Sequence[HandMotion],
    normal_force: Sequence[Value],
    dt: Value,
) -> list[Value]:
    """One classical Runge-Kutta step of `dt` seconds.

    `hand` and `normal_force` hold the values at the start, middle and end of the
    step: three instants serve the four stages.
    """
    start = components(state)
    k1 = rates(start, hand[0], normal_force[0])
    k2 = rates(_moved(start, k1, 0.5 * dt), hand[1], normal_force[1])
    k3 = rates(_moved(start, k2, 0.5 * dt), hand[1], normal_force[1])
    k4 = rates(_moved(start, k3, dt), hand[2], normal_force[2])
    return [
        x + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        for x, a, b, c, d in zip(start, k1, k2, k3, k4, strict=True)
    ]


def euler_step(
    rates: Rates,
    state: Value,
    hand: Sequence[HandMotion],
    normal_force: Sequence[Value],
    dt: Value,
) -> list[Value]:
    """One explicit Euler step of `dt` seconds; only the start's values are used."""
    start = components(state)
    return _moved(start, rates(start, hand[0], normal_force[0]), dt)


def _moved(state: Sequence[Value], rates: Sequence[Value], dt: Value) -> list[Value]:
    return [x + dt * rate for x, rate in zip(state, rates, strict=True)]
