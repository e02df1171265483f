"""What an NLP is for, its nodes, and the window in which an uncertain gripper may open."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Array
from ...problems import Mesh, Pose, Scene, Uncertainty
from ..throw import Manipulator, Throw, friction_use
from .lazy_constraints import BASE, Refinement

#: Longest interval [s] of the window before the opening and after detach.
STEP = 0.005
#: Standard deviations that a normal delay reaches.
DEVIATIONS = 2.0
#: The window lasts this share of the opening longer: the brake waits for a slow one.
SLOWER = 0.2
#: Instants of the window at which the load is measured.
SAMPLES = 561
#: Openings of the scenarios that share the hand's motion, as shares of the window.
SHARES = (-1.0, -0.5, 0.5, 1.0)


@dataclass(frozen=True)
class Window:
    """The window in which the pads may open, around the planned opening.

    early, late: intervals of `step` [s] before the opening's start and after detach.
    delays (scenarios,) [s]: of the openings other than the planned one.
    """

    early: int
    late: int
    step: float
    delays: Array


def window_of(scene: Scene) -> Window:
    """The window of a scene's [robust] and [uncertainty]; +-10 ms where they say nothing."""
    before, after = _reach(scene)
    if scene.robust is not None:
        before = before if scene.robust.early is None else scene.robust.early
        after = after if scene.robust.late is None else scene.robust.late
    early, late = math.ceil(before / STEP - 1e-9), math.ceil(after / STEP - 1e-9)
    steps = [length / count for length, count in ((before, early), (after, late)) if count]
    step = max(steps, default=STEP)
    delays = [step * (early if share < 0 else late) * share for share in SHARES]
    return Window(early, late, step, np.array([d for d in delays if d != 0.0]))


def _reach(scene: Scene) -> tuple[float, float]:
    """The earliest start of the force's fall before its mean, the latest zero after it [s]."""
    section = scene.uncertainty
    delay = section.delay if section is not None else Uncertainty.USUAL.delay
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


def load_curve(throw: Throw) -> tuple[Array, Array]:
    """Times (K,) [s] over the window and the load there (K,).

    The load is the wrench that would keep the object moving with the hand, as a share of
    the full grip's friction limit: 1 is what the grip can hold, 0 is the object's own free
    flight.
    """
    scene, window = throw.scene, window_of(throw.scene)
    begin = throw.opening_time - window.early * window.step
    end = throw.opening_time + scene.gripper.profile().opening + window.late * window.step
    times = np.linspace(max(begin, 0.0), end, SAMPLES)
    force, torque = friction_use(scene, throw.hand(times))
    return times, np.asarray(np.hypot(force, torque))


def peak_load(throw: Throw) -> float:
    """The largest load over the window from when the earliest opening has left a quarter of
    the grip: before that the pads hold any such load."""
    times, load = load_curve(throw)
    profile, window = throw.scene.gripper.profile(), window_of(throw.scene)
    grip = profile.force(times - throw.opening_time + window.early * window.step)
    return float(load[grip <= profile.full / 4].max())


@dataclass(frozen=True)
class Request:
    """What an NLP is for: a scene's throw to a target (None: not known, for the verdict).

    robust: the method of a robust plan, empty for none. elastic: the landing may miss, at a price.
    reference: a throw that a solve starts from, about which obstacles are linearised.
    """

    scene: Scene
    manipulator: Manipulator
    target: Pose | None = None
    refinement: Refinement = BASE
    robust: str = ""
    elastic: bool = False
    reference: Throw | None = None

    @property
    def angle(self) -> bool:
        """Whether the target fixes theta."""
        return self.target is not None and self.target.theta is not None

    @cached_property
    def window(self) -> Window | None:
        """The window of a robust request."""
        return window_of(self.scene) if self.robust else None

    @cached_property
    def nodes(self) -> Array:
        """Times [s] of the stages from the end of the carry on; 0 is the opening's start."""
        nodes = opening_nodes(self.scene.mesh, self.scene.gripper.profile().opening)
        if self.window is None:
            return nodes
        before = self.window.step * np.arange(-self.window.early, 0)
        after = nodes[-1] + self.window.step * np.arange(1, self.window.late + 1)
        return np.concatenate([before, nodes, after])

    def times(self, opening_time: float) -> Array:
        """Times (last + 1,) [s] of the stages on the motion's clock."""
        after = opening_time + self.nodes
        carry = np.linspace(0.0, after[0], self.scene.mesh.carry + 1)
        return np.concatenate([carry[:-1], after])
