"""The throw behind a plan: its motion, its NLP, its landing by each model."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from ...models import Trajectory
from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import Pose, Scene
from ..ocp import BASE, Layout, Optimum, Refinement, Solution
from ..throw import Manipulator, Samples, Throw
from ..uncertainty import RestCount, count_rests


@dataclass(frozen=True, repr=False)
class PlannedThrow:
    """The throw behind a plan: its motion, its NLP, its landing by each model.

    planned: the motion up to detach. deciding: the motion that is sent, by the tolerance's model.
    effort: cost of the NLP. nlp_size: variables and constraints of the NLP. refinement: its lazy
    constraints and margins. aim: offset (dx [m], dtheta [rad]) of the NLP's target from the target;
    with it `deciding` lands on the target. layout, solution, landing_of_nlp (x, z [m], theta
    [rad]): of a throw that an NLP solved. optimum: of a throw moved from a solved one.
    """

    planned: Trajectory
    deciding: Throw
    effort: float
    nlp_size: tuple[int, int]
    refinement: Refinement = BASE
    aim: tuple[float, float] = (0.0, 0.0)
    layout: Layout | None = None
    solution: Solution | None = None
    landing_of_nlp: tuple[float, float, float] | None = None
    optimum: Optimum | None = None

    @cached_property
    def exact(self) -> Throw:
        """The planned motion by the sliding pivot."""
        return replace(self.deciding, path=self.planned, model=SLIDING_PIVOT)

    @cached_property
    def rests(self) -> RestCount | None:
        """How often the object comes to rest where [rest] wants it; None without [rest]."""
        return count_rests(self.deciding)

    @cached_property
    def planned_landing(self) -> tuple[float, float, float]:
        """Landing by the smoothed model: x, z [m], theta [rad].

        A moved throw has the smoothing error of its optimum.
        """
        if self.optimum is None or self.landing_of_nlp is not None:
            return self.landing_of_nlp or (math.nan, math.nan, math.nan)
        (x, z, theta), (dx, turn) = self.exact.landing.pose, self.optimum.smoothing
        return x + dx, z, theta + turn

    @property
    def scene(self) -> Scene:
        """The scene, aimed at the target."""
        return self.deciding.scene

    @property
    def manipulator(self) -> Manipulator:
        """The manipulator."""
        return self.deciding.manipulator

    @property
    def opening_time(self) -> float:
        """Time [s] on the motion's clock at which the grip force starts to fall."""
        return self.deciding.opening_time

    @property
    def samples(self) -> Samples:
        """The samples of motion.csv."""
        return self.deciding.samples

    @property
    def landings(self) -> dict[str, tuple[float, float, float]]:
        """Landings x, z [m], theta [rad] by their key in plan.json."""
        own = {} if self.scene.release is None else {"own": self.deciding.landing.pose}
        return own | {
            "planned": self.planned_landing,
            "exact": self.exact.landing.pose,
            "sent": self.deciding.sliding_pivot.landing.pose,
            "limit_surface": self.deciding.limit_surface.landing.pose,
        }

    @property
    def decides(self) -> str:
        """Key of the deciding landing."""
        if self.scene.release is not None:
            return "own"
        return "limit_surface" if self.scene.tolerance.model == STEPPED_SURFACE else "sent"

    @property
    def landing_time(self) -> float:
        """Time [s] of the landing on the motion's clock."""
        return self.deciding.landing_time

    def words(self, goal: Pose) -> str:
        """The landing error to `goal` as text; the place of a landing in a region."""
        dx, dtheta = self.deciding.miss(goal)
        turn = "" if goal.theta is None else f" and {math.degrees(abs(dtheta)):.3f} deg"
        off = f"{1e3 * abs(dx):.3f} mm{turn} from the target"
        if not goal.is_region:
            return f"lands {off}"
        landing = self.deciding.landing
        theta = None if goal.theta is None else landing.theta
        place = goal.in_plane(landing.x, theta).changed(velocity=None, arrival=None)
        inside = "in the target region" if dx == dtheta == 0.0 else f"{off} region"
        return f"lands at {place.words}, {inside}"
