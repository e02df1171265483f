"""The opening's nodes, and the window around it in which an uncertain gripper may open."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...models import Array
from ...problems import USUAL_UNCERTAINTY, Mesh, Scene
from ..check import Throw, friction_use

#: Longest interval [s] of the window before the opening and after detach.
STEP = 0.005
#: A normal delay is taken to reach this many standard deviations.
DEVIATIONS = 2.0
#: An opening is always taken to last up to this share longer: the brake waits for it.
SLOWER = 0.2
#: Instants of the window at which the load is measured.
SAMPLES = 141
#: Openings that the scenarios share the hand's motion among, as shares of the window.
SHARES = (-1.0, -0.5, 0.5, 1.0)


@dataclass(frozen=True)
class Window:
    """early, late: intervals of `step` [s] before the opening's start and after detach.

    delays (scenarios,) [s]: of the openings other than the planned one.
    """

    early: int
    late: int
    step: float
    delays: Array


def window_of(scene: Scene) -> Window:
    """The window of a scene's [robust] and [uncertainty]; +-10 ms where they say nothing."""
    before, after = _reach(scene)
    robust = scene.robust
    if robust is not None:
        before = before if robust.early is None else robust.early
        after = after if robust.late is None else robust.late
    early, late = math.ceil(before / STEP - 1e-9), math.ceil(after / STEP - 1e-9)
    steps = [length / count for length, count in ((before, early), (after, late)) if count]
    step = max(steps, default=STEP)
    delays = [step * (early if share < 0 else late) * share for share in SHARES]
    return Window(early, late, step, np.array([d for d in delays if d != 0.0]))


def _reach(scene: Scene) -> tuple[float, float]:
    """How much earlier than its mean the force may start to fall, and later be zero [s]."""
    section = scene.uncertainty
    delay = section.delay if section is not None else USUAL_UNCERTAINTY.delay
    opening = None if section is None else section.opening
    nominal = scene.gripper.profile().opening
    before, after = 0.0, SLOWER * nominal
    if delay is not None:
        spread = delay.about(0.0)
        low, high = spread.reach
        width = DEVIATIONS * spread.deviation if delay.normal is not None else 0.0
        before = max(spread.expected - low, width)
        after += max(high - spread.expected, width)
    if opening is not None:
        spread = opening.about(nominal)
        width = DEVIATIONS * spread.deviation if opening.normal is not None else 0.0
        after += max(max(spread.reach[1], spread.expected + width) - (1 + SLOWER) * nominal, 0.0)
    return before, after


def opening_nodes(mesh: Mesh, opening: float) -> Array:
    """Times (opening + 1,) [s] of the shooting nodes, from the start of the force's fall."""
    shares = np.linspace(0.0, 1.0, mesh.opening + 1)
    return np.asarray(opening * (1.0 - (1.0 - shares) ** mesh.grading))


def window_nodes(scene: Scene, window: Window | None) -> Array:
    """Times (early + opening + late + 1,) [s] of a window's nodes, from the same instant.

    Without a window the opening's.
    """
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    if window is None:
        return nodes
    before = window.step * np.arange(-window.early, 0)
    after = nodes[-1] + window.step * np.arange(1, window.late + 1)
    return np.concatenate([before, nodes, after])


def load_curve(throw: Throw) -> tuple[Array, Array]:
    """Times (K,) [s] over the window and the load there (K,).

    The load is the wrench that would keep the object moving with the hand, as a share of
    the full grip's friction limit: 1 is what the grip can hold, 0 is the object's own free
    flight.
    """
    scene, opening_time = throw.scene, throw.opening_time
    window = window_of(scene)
    begin = opening_time - window.early * window.step
    end = opening_time + scene.gripper.profile().opening + window.late * window.step
    times = np.linspace(max(begin, 0.0), end, SAMPLES)
    force, torque = friction_use(scene, throw.hand(times))
    return times, np.asarray(np.hypot(force, torque))


def peak_load(throw: Throw) -> float:
    """The largest load over the window."""
    return float(load_curve(throw)[1].max())
