"""Landing errors before and after few throws: a wrong belief, a meshed patch as reality."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene, load_scene
from ..identify import Belief, applied, prior_of, throw_data, thrown, updated
from ..plan import Planner
from ..result import Plan

Array = npt.NDArray[np.float64]

#: Reality: its friction, patch radius [m] and delay of the gripper [s]; what rubs there.
TRUTH = {"friction": 1.1, "patch_radius": 0.00325, "delay": 0.010}
REALITY = "patch"
#: Noise of a measured landing: x [m], theta [rad].
NOISE = (0.002, math.radians(0.5))
#: Goals: how far [m, deg] from the scene's own target. The first `JUDGED` are thrown again.
WAYS = (
    *((0.0, 0), (-0.15, 20), (0.1, -25), (-0.05, 40), (-0.1, -40)),
    *((0.05, 15), (-0.2, -10), (0.12, 5), (-0.08, 60), (0.03, -15)),
)
JUDGED = 3
#: Of the true mu r_p that the belief begins with.
BELIEVED = 0.6


@dataclass(frozen=True)
class Learned:
    """What k throws were worth: mean real error after them [m], and mu r_p over the truth."""

    error: float
    product: float


class Lesson:
    """A scene believed wrongly, and the throws planned with that belief."""

    def __init__(self, name: str = "pose") -> None:
        given = load_scene(name)
        product = BELIEVED * TRUTH["friction"] * TRUTH["patch_radius"]
        shrink = math.sqrt(product / (given.contact.friction * given.contact.patch_radius))
        contact = dataclasses.replace(
            given.contact,
            friction=shrink * given.contact.friction,
            patch_radius=shrink * given.contact.patch_radius,
        )
        self.scene = given.replace(contact=contact)

    @cached_property
    def plans(self) -> list[Plan]:
        """Throws to all goals, planned with the wrong belief."""
        return _planned(self.scene, WAYS)

    @cached_property
    def landings(self) -> Array:
        """Where they really land (N, 2)."""
        return thrown(throw_data(self.plans), REALITY, TRUTH)

    @cached_property
    def before(self) -> float:
        """Mean real scaled error [m] of the goals that are judged, before any throw."""
        return _error(self.plans[:JUDGED], self.landings[:JUDGED])

    def after(self, count: int, model: str, seed: int) -> Learned:
        """After the first `count` throws, measured with noise, learned from by a model."""
        rng = np.random.default_rng(seed)
        seen = self.landings + rng.normal(size=self.landings.shape) * NOISE
        pairs = [(float(x), float(theta)) for x, theta in seen[:count]]
        data = throw_data(self.plans[:count], pairs, *NOISE)
        prior = prior_of(self.scene, ("friction", "patch_radius", "delay"))
        posterior: Belief = updated(prior, data, model)
        plans = _planned(applied(posterior, self.scene), WAYS[:JUDGED])
        error = _error(plans, thrown(throw_data(plans), REALITY, TRUTH))
        return Learned(error, posterior.product / (TRUTH["friction"] * TRUTH["patch_radius"]))


def _planned(scene: Scene, ways: Sequence[tuple[float, float]]) -> list[Plan]:
    """Solved plans to the scene's target, moved some ways."""
    planner, aim = Planner(scene, compiling="no"), scene.target
    assert aim is not None and aim.theta is not None
    goals = [Pose(aim.x + dx, aim.z, aim.theta + math.radians(turn)) for dx, turn in ways]
    plans = [planner.plan(goal) for goal in goals]
    lost = [goal for goal, plan in zip(goals, plans, strict=True) if not plan.solved]
    assert not lost, f"no plan to {lost}"
    return plans


def _error(plans: list[Plan], landings: Array) -> float:
    """Mean scaled error [m], |dx| + |dtheta| l / 2."""
    off = np.abs(landings - [[plan.target.x, plan.target.theta] for plan in plans])
    return float((off @ [1.0, plans[0].scene.object.length / 2]).mean())
