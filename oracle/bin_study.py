"""Throws into random bins, judged by the oracle: `python -m oracle.bin_study [COUNT] [SEED]`."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import throwplan as tp

from .files import oracle_of

#: Arms whose shipped scenes are varied.
ARMS = ("box", "fr3")
#: Ranges: lengths and widths, radii, depths, heights of rims [m]; distances of the centres from the
#: base [m] and their azimuths [rad]; clearances [m].
SIZES, RADII, DEPTHS, RIMS = (0.12, 0.40), (0.07, 0.20), (0.06, 0.25), (0.08, 0.35)
AWAY, AZIMUTHS, CLEARANCES = (0.6, 1.15), (-1.0, 1.0), (0.003, 0.015)


@dataclass(frozen=True)
class BinThrow:
    """A plan into a bin: seconds, and what the oracle says: limits that the plan breaks, and the
    least distance [m] from walls and rim."""

    plan: tp.Plan
    seconds: float
    broken: tuple[str, ...] = ()
    distance: float = math.nan

    @property
    def words(self) -> str:
        """One line."""
        into = self.plan.scene.bin
        assert into is not None
        size = (
            f"radius {into.radius:.3f}"
            if into.radius is not None
            else (f"{into.length:.3f} x {into.width:.3f}, yaw {math.degrees(into.yaw):4.0f} deg")
        )
        place = f"{size}, depth {into.depth:.3f}, rim {into.rim:.2f} at {into.x:.2f}, {into.y:.2f}"
        least = f"{1e3 * self.distance:5.1f} mm off, asked {1e3 * into.clearance:.0f}"
        end = f"{self.plan.status}, {least}" if self.plan.solved else self.plan.status
        return f"{into.shape:5} {place}: {end}, {self.seconds:.1f} s {' '.join(self.broken)}"


def random_bin(shape: str, random: np.random.Generator) -> tp.Scene:
    """A shipped scene with a random bin as its target."""

    def any_of(span: tuple[float, float]) -> float:
        return float(random.uniform(*span))

    scene, away, turn = tp.load_scene(ARMS[random.integers(2)]), any_of(AWAY), any_of(AZIMUTHS)
    place = {"x": away * math.cos(turn), "y": away * math.sin(turn), "rim": any_of(RIMS)}
    kept = {"depth": any_of(DEPTHS), "clearance": any_of(CLEARANCES)}
    if shape == "round":
        into = tp.Bin(shape=shape, radius=any_of(RADII), **place, **kept)
    else:
        sides = {"length": any_of(SIZES), "width": any_of(SIZES)}
        yaw = any_of((-math.pi / 2, math.pi / 2))
        into = tp.Bin(shape=shape, yaw=yaw, **sides, **place, **kept)
    return scene.replace(bin=into, target=None)


def throws(count: int, seed: int = 0) -> Iterator[BinThrow]:
    """Throws into `count` boxes and as many round bins."""
    for number in range(2 * count):
        shape = ("box", "round")[number >= count]
        scene = random_bin(shape, np.random.default_rng((seed, number)))
        begin = time.perf_counter()
        plan = tp.plan(scene)
        seconds = time.perf_counter() - begin
        if not plan.solved:
            yield BinThrow(plan, seconds)
            continue
        judged = oracle_of(plan).judge(planned=True)
        distance = float(judged.found["bin"].value[0])
        yield BinThrow(plan, seconds, judged.broken()[0], distance)


if __name__ == "__main__":
    asked = [int(word) for word in sys.argv[1:]] or [10]
    ended = []
    for one in throws(*asked):
        print(one.words, flush=True)
        ended.append(one)
    solved = [one for one in ended if one.plan.solved]
    wrong = sum(bool(one.broken) for one in solved)
    print(f"{len(solved)} of {len(ended)} solved; the oracle finds {wrong} of these wrong")
