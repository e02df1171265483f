"""Which throws go into the cup, and how clear of wall and rim: arrays of flights at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...problems import Cup, Scene, ThrownObject
from .throw import Throw

Array = npt.NDArray[np.float64]

#: Flight instants on which the entry is sought, bisections that locate its ends, instants of
#: the entry at which the clearance is measured, and how often it is measured anew around
#: the least: a corner that passes the rim is near it for a moment only.
COARSE, BISECTIONS, FINE, ROUNDS = 48, 14, 24, 3
#: The flight is followed beyond the landing height for this long [s].
BEYOND = 0.3


@dataclass(frozen=True)
class Bars:
    """N bars as drawn: com (N,) [m] from the end nearer the grasp, length and width [m]."""

    com: Array
    length: float
    width: float

    def lowest(self, z: Array, theta: Array) -> Array:
        """Height of the lowest corner, for CoM heights and angles (N, K)."""
        com, sin = self.com[:, None], np.sin(theta)
        ends = np.minimum(-com * sin, (self.length - com) * sin)
        return np.asarray(z + ends - self.width / 2 * np.abs(np.cos(theta)))


def cup_entries(bar: ThrownObject, com: Array, cup: Cup, detach: Array, flight: Array) -> Array:
    """Least clearance (N,) [m] of the bars' way into the cup; -inf for those that miss it.

    com (N,): the CoM's distance from the end nearer the grasp; detach (N, 7): CoM pose and
    twist, and gravity; flight (N,): seconds until the landing height. The way in is from
    the lower end's passing the rim plane until it is `insertion` below; the clearance is
    the least distance of outline and wall or rim, negative outside. The bar is taken as thick as
    it is wide, so in a round cup the walls are nearer than `radius` off the middle.
    """
    bars = Bars(com, bar.length, bar.width)
    clearance = np.full(len(detach), -np.inf)
    coming = np.flatnonzero(np.isfinite(flight))
    times = np.linspace(0.0, 1.0, COARSE) * (flight[coming, None] + BEYOND)
    depth = _depth(_some(bars, coming), cup, detach[coming], times)
    deep = depth >= cup.insertion
    first_deep = np.argmax(deep, axis=1)
    above = (depth < 0.0) & (np.arange(COARSE) < first_deep[:, None])
    last_above = COARSE - 1 - np.argmax(above[:, ::-1], axis=1)
    enters = np.flatnonzero(deep.any(axis=1) & above.any(axis=1))
    who = coming[enters]
    some, throws = _some(bars, who), detach[who]

    def instant(before: npt.NDArray[np.intp], level: float) -> Array:
        low, high = times[enters, before], times[enters, before + 1]
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            under = _depth(some, cup, throws, middle[:, None])[:, 0] >= level
            low, high = np.where(under, low, middle), np.where(under, middle, high)
        return np.asarray((low + high) / 2)

    begin = instant(last_above[enters], 0.0)
    end = instant(first_deep[enters] - 1, cup.insertion)
    least = np.full(who.size, np.inf)
    for _ in range(ROUNDS):
        instants = np.linspace(begin, end, FINE, axis=1)
        found = _clearance(some, cup, *_poses(throws, instants))
        nearest = np.argmin(found, axis=1)
        least = np.minimum(least, found.min(axis=1))
        around = np.clip([nearest - 1, nearest + 1], 0, FINE - 1)
        begin, end = (np.take_along_axis(instants, a[:, None], 1)[:, 0] for a in around)
    clearance[who] = least
    return clearance


def cup_entry(scene: Scene, thrown: Throw) -> float:
    """The same for the one throw of a scene."""
    assert scene.cup is not None
    state = np.array([[*vars(thrown.release.detach).values(), scene.gravity]])
    flight = np.array([thrown.landing.flight_time])
    return float(
        cup_entries(scene.object, np.array([scene.object.com]), scene.cup, state, flight)[0]
    )


def enters_cup_at_landing(
    scene: Scene, detach: Array, x: Array, time: Array, more: float = 0.0
) -> npt.NDArray[np.bool_]:
    """Whether throws (N,) go into a cup that has come along with the target to their landing.

    detach (N, 6): CoM pose and twist; x (N,) [m] and time (N,) [s] of the landing at the
    height of the scene's target; more [m]: clearance beyond the scene's. True for a scene
    without a cup.
    """
    if scene.cup is None or scene.target is None:
        return np.ones(len(x), dtype=bool)
    shifted = np.column_stack([detach, np.full(len(x), scene.gravity)])
    shifted[:, 0] += scene.target.plane_x - x
    com = np.full(len(x), scene.object.com)
    clearance = cup_entries(scene.object, com, scene.cup, shifted, time)
    return np.asarray(clearance >= scene.cup.clearance + more)


def _some(bars: Bars, which: npt.NDArray[np.intp]) -> Bars:
    return Bars(bars.com[which], bars.length, bars.width)


def _poses(detach: Array, times: Array) -> tuple[Array, Array, Array]:
    """x, z, theta (N, K) of the CoM at `times` (N, K) after detach."""
    x, z, theta, v_x, v_z, omega, gravity = detach.T[:, :, None]
    return x + v_x * times, z + times * (v_z - gravity / 2 * times), theta + omega * times


def _depth(bars: Bars, cup: Cup, detach: Array, times: Array) -> Array:
    """Depth (N, K) of the lower end below the rim plane."""
    _, z, theta = _poses(detach, times)
    return cup.rim - bars.lowest(z, theta)


def _clearance(bars: Bars, cup: Cup, x: Array, z: Array, theta: Array) -> Array:
    """Clearance (N, K): of the corners below the rim to the wall, of the rim to the bar.

    Between them lies the outline's point at the rim's height, which is no nearer to the
    wall than the rim is to the bar.
    """
    half = np.sqrt(cup.radius**2 - (bars.width / 2) ** 2)
    cos, sin, com = np.cos(theta), np.sin(theta), bars.com[:, None]
    least = np.full(x.shape, np.inf)
    for along in (-com, bars.length - com):
        for across in (-bars.width / 2, bars.width / 2):
            corner_x, corner_z = x + cos * along - sin * across, z + sin * along + cos * across
            free = half - np.abs(corner_x - cup.x)
            least = np.minimum(least, np.where(corner_z <= cup.rim, free, np.inf))
    for rim in (cup.x - half, cup.x + half):
        along, across = cos * (rim - x) + sin * (cup.rim - z), cos * (cup.rim - z) - sin * (rim - x)
        over = np.maximum(np.maximum(-com - along, along - (bars.length - com)), 0.0)
        aside = np.maximum(np.abs(across) - bars.width / 2, 0.0)
        least = np.minimum(least, np.hypot(over, aside))
    return least
