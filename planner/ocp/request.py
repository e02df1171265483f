"""The request that an NLP answers, its nodes, and the window of an uncertain opening."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Array
from ...problems import Mesh, Pose, Scene, Uncertainty
from ..throw import Manipulator, Throw, friction_use
from .lazy_constraints import BASE, Refinement


@dataclass(frozen=True)
class WindowSettings:
    """How wide and how fine the window of a robust plan is.

    step [s]: longest interval before the opening and after detach. deviations: of a normal
    distribution, inside the window. slow_opening: share of the opening by which a slow one may
    outlast it; the brake waits that long. samples: instants at which the load is measured. delays:
    of the scenarios, as shares of the window before the opening and after detach.
    """

    step: float = 0.005
    deviations: float = 2.0
    slow_opening: float = 0.2
    samples: int = 561
    delays: tuple[float, ...] = (-1.0, -0.5, 0.5, 1.0)


WINDOW = WindowSettings()


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
    """The window of a scene's [robust] and [uncertainty]; +-10 ms without them."""
    before, after = _uncertain_span(scene)
    if scene.robust is not None:
        before = before if scene.robust.early is None else scene.robust.early
        after = after if scene.robust.late is None else scene.robust.late
    early, late = (math.ceil(span / WINDOW.step - 1e-9) for span in (before, after))
    steps = [length / count for length, count in ((before, early), (after, late)) if count]
    step = max(steps, default=WINDOW.step)
    delays = [step * (early if share < 0 else late) * share for share in WINDOW.delays]
    return Window(early, late, step, np.array([d for d in delays if d != 0.0]))


def _uncertain_span(scene: Scene) -> tuple[float, float]:
    """Times [s] from the earliest start of the opening to its mean, and from the mean detach to the
    latest."""
    section = scene.uncertainty
    delay = section.delay if section is not None else Uncertainty.USUAL.delay
    opening = None if section is None else section.opening
    nominal = scene.gripper.profile().opening
    before, after = 0.0, WINDOW.slow_opening * nominal
    if delay is not None:
        spread = delay.about(0.0)
        low, high = spread.reach
        width = WINDOW.deviations * spread.deviation if delay.normal is not None else 0.0
        before = max(spread.expected - low, width)
        after += max(high - spread.expected, width)
    if opening is not None:
        spread = opening.about(nominal)
        width = WINDOW.deviations * spread.deviation if opening.normal is not None else 0.0
        after += max(
            max(spread.reach[1], spread.expected + width) - (1 + WINDOW.slow_opening) * nominal, 0.0
        )
    return before, after


def opening_nodes(mesh: Mesh, opening: float) -> Array:
    """Times (opening + 1,) [s] of the shooting nodes, from the start of the force's fall."""
    shares = np.linspace(0.0, 1.0, mesh.opening + 1)
    return np.asarray(opening * (1.0 - (1.0 - shares) ** mesh.grading))


def load_curve(throw: Throw) -> tuple[Array, Array]:
    """Times (K,) [s] over the window and the load there (K,).

    The load is the wrench that keeps the object in the moving hand, as a share of the friction
    limit of the full grip: at 1 the object slips, at 0 it flies freely.
    """
    scene, window = throw.scene, window_of(throw.scene)
    begin = throw.opening_time - window.early * window.step
    end = throw.opening_time + scene.gripper.profile().opening + window.late * window.step
    times = np.linspace(max(begin, 0.0), end, WINDOW.samples)
    return times, friction_use(scene, throw.hand(times))


def peak_load(throw: Throw) -> float:
    """The largest load over the window, after the earliest opening has reached a quarter of the
    full grip: with more grip the pads hold a quiet load."""
    times, load = load_curve(throw)
    profile, window = throw.scene.gripper.profile(), window_of(throw.scene)
    grip = profile.force(times - throw.opening_time + window.early * window.step)
    return float(load[grip <= profile.full / 4].max())


@dataclass(frozen=True)
class Request:
    """A throw of a scene to a target, for an NLP (target None: unknown, for a verdict).

    robust: the method of a robust plan, empty for none. elastic: the landing may miss the target,
    at a price. reference: the throw at the start of a solve; obstacles are linearised about it.
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
