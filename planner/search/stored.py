"""Solved throws over a scene's reach: a plan from the nearest takes few iterations.

The release table has what is thrown; these have the whole motion, and the multipliers that
an interior-point solver needs to go on from it. Made when asked for, see `Planner.prepare`,
and kept in the cache folder. A stale one costs time only: one of another size is not used, and
whatever is solved from one is checked like any other throw.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene
from ..compile import DAMAGED, cache_folder, digest, publish, source_of
from ..ocp import Asked, Margins, Solution
from ..result import PlannedThrow
from .sampling import sparse_parents

Array = npt.NDArray[np.float64]

#: Share of the targets drawn evenly over the reach, its edge above all, the others as often as
#: random throws land there.
EVENLY = 0.25
#: Within this distance [m, scaled error] of a target a solved throw is of use.
NEAR = 0.2
#: How many of the nearest are tried.
NEAREST = 2
SEED = 5
#: What a file has of an answer, throw after throw.
PARTS = ("x", "lam_g", "lam_x")


@dataclass(frozen=True)
class SolvedThrow:
    """A throw's target, what its NLP had beyond the usual, and its answer.

    x (n,), lam_g (m,), lam_x (n,): point and multipliers. aim: (dx [m], dtheta [rad]) beside
    the target, which made what is sent land at it.
    """

    target: Pose
    asked: Asked
    x: Array
    lam_g: Array
    lam_x: Array
    aim: tuple[float, float]

    @classmethod
    def of(cls, throw: PlannedThrow, target: Pose) -> SolvedThrow:
        """What is worth keeping of a throw to `target`."""
        found = throw.solution
        return cls(target, throw.asked, found.x, found.lam_g, found.lam_x, throw.aim)

    def fits(self, goal: Pose, size: tuple[int, int]) -> bool:
        """Whether it is of the NLP of (variables, constraints) `size` for `goal`."""
        alike = (self.target.theta is None) == (goal.theta is None)
        return alike and (self.x.size, self.lam_g.size, self.lam_x.size) == (*size, size[0])

    @property
    def solution(self) -> Solution:
        """To start from."""
        return Solution(self.x, self.lam_g, self.lam_x, math.nan, True, 0, "kept")


class SolvedThrows:
    """Solved throws by where they land."""

    def __init__(self, throws: Sequence[SolvedThrow], scene: Scene) -> None:
        self._throws = tuple(throws)
        self._lever = scene.object.length / 2
        targets = [throw.target for throw in throws]
        # With an open angle all are at 0.
        self._at = np.array([(t.plane_x, t.z, t.theta or 0.0) for t in targets]).reshape(-1, 3)

    def __len__(self) -> int:
        return len(self._throws)

    def near(self, goals: Sequence[Pose]) -> list[tuple[SolvedThrow, Pose]]:
        """The nearest throws to any of the goals, each with its goal, nearest first."""
        found: list[tuple[float, int, Pose]] = []
        for goal in goals if len(self) else ():
            away = np.abs(self._at - (goal.plane_x, goal.z, goal.theta or 0.0))
            distance = away @ (1.0, 1.0, self._lever)
            nearest = np.argsort(distance, kind="stable")[:NEAREST]
            found += [(float(distance[i]), int(i), goal) for i in nearest if distance[i] < NEAR]
        found.sort(key=lambda entry: entry[:2])
        return [(self._throws[i], goal) for _, i, goal in found[:NEAREST]]

    def save(self, path: Path) -> None:
        """All as one NPZ file."""
        throws = self._throws
        arrays: dict[str, Any] = {
            # An open angle becomes NaN.
            "pose": np.array(
                [(t.target.plane_x, t.target.z, t.target.theta) for t in throws], float
            ),
            "guards": np.array([" ".join(sorted(throw.asked.guards)) for throw in throws], str),
            "margins": np.array(
                [json.dumps(dict(throw.asked.margins.values)) for throw in throws], str
            ),
            "aim": np.array([throw.aim for throw in throws]),
            "sizes": np.array([[getattr(throw, name).size for name in PARTS] for throw in throws]),
        }
        for name in PARTS:
            arrays[name] = np.concatenate([getattr(throw, name) for throw in throws])
        np.savez(path, **arrays)


def stored_throws(
    key: str, scene: Scene, count: int, make: Callable[[], Iterator[SolvedThrow]]
) -> SolvedThrows:
    """`count` tried throws of a scene from the cache, or made and put there.

    key: of the NLP that the answers are of.
    """
    folder, target = cache_folder(), scene.target
    assert target is not None
    # Where in the reach the scene's own target lies changes nothing.
    somewhere = Pose(1.0, target.z, theta=None if target.theta is None else 0.0)
    like = scene.aimed_at(somewhere).replace(name="", description="", file="")
    if like.cup is not None:
        # Moved and moved back it may differ in the last digit.
        like = like.replace(cup=dataclasses.replace(like.cup, x=round(like.cup.x, 9)))
    made_by = source_of(SolvedThrow)
    name = f"{digest('throws', made_by, repr(like), str(count), key)}.npz"
    found = None if folder is None else _read(folder / name)
    if found is None:
        found = list(make())
        if folder is not None and found:
            publish(folder, name, SolvedThrows(found, scene).save)
    return SolvedThrows(found, scene)


def spread_targets(scene: Scene, x: Array, theta: Array, count: int) -> list[Pose]:
    """At most `count` landing poses at the height of the scene's target.

    x [m], theta [rad] (N,): landings that are in reach.
    """
    assert scene.target is not None
    if not len(x):
        return []
    angle, rng = scene.target.theta is not None, np.random.default_rng(SEED)
    evenly = sparse_parents(x, theta if angle else 0 * theta, round(EVENLY * count), rng)
    others = rng.choice(len(x), min(count, len(x)), replace=False)
    chosen = list(dict.fromkeys([*evenly.tolist(), *others.tolist()]))[:count]
    return [scene.target.in_plane(float(x[i]), float(theta[i]) if angle else None) for i in chosen]


def _read(path: Path) -> list[SolvedThrow] | None:
    """The throws in a file; None if it is not there or not whole."""
    try:
        with path.open("rb") as file, np.load(file) as arrays:
            ends = np.cumsum(arrays["sizes"], axis=0)
            if not all(len(arrays[name]) == end for name, end in zip(PARTS, ends[-1], strict=True)):
                return None
            if not all(np.isfinite(arrays[name]).all() for name in ("aim", *PARTS)):
                return None
            parts = [np.split(arrays[name], ends[:-1, k]) for k, name in enumerate(PARTS)]
            columns = [arrays[name] for name in ("pose", "guards", "margins", "aim")]
            return [_throw(*row) for row in zip(*columns, *parts, strict=True)]
    except DAMAGED:
        return None


def _throw(pose: Array, guards: str, margins: str, aim: Array, *answer: Array) -> SolvedThrow:
    """One of a file's rows; answer: its arrays in the order of `PARTS`."""
    plane_x, z, theta = (float(number) for number in pose)
    x, lam_g, lam_x = answer
    return SolvedThrow(
        Pose(plane_x, z=z, theta=None if math.isnan(theta) else theta),
        Asked(frozenset(guards.split()), Margins(**json.loads(margins))),
        x,
        lam_g,
        lam_x,
        (float(aim[0]), float(aim[1])),
    )
