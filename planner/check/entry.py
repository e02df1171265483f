"""Which throws go into the cup, and how clear of wall and rim: arrays of flights at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import Array, Flags, FlightState
from ...problems import Cup, Scene

#: Flight instants on which the entry is sought, bisections that locate its ends, instants of
#: the entry at which the clearance is measured, and how often it is measured anew around
#: the least: a corner that passes the rim is near it for a moment only.
COARSE, BISECTIONS, FINE, ROUNDS = 48, 15, 24, 3
#: The flight is followed beyond the landing height for this long [s].
BEYOND = 0.3


@dataclass(frozen=True)
class _Flights:
    """N bars in flight: com (N,) [m] from the end nearer the grasp; detach (N, 6)."""

    scene: Scene
    cup: Cup
    com: Array
    detach: Array

    def picked(self, which: npt.NDArray[np.intp]) -> _Flights:
        """Some of them."""
        return _Flights(self.scene, self.cup, self.com[which], self.detach[which])

    def at(self, times: Array) -> FlightState:
        """The CoM, each (N, K), at `times` (N, K) after detach."""
        return FlightState(*self.detach.T[:, :, None]).after(times, self.scene.gravity)

    def depth(self, times: Array) -> Array:
        """Depth (N, K) of the lowest corner below the rim plane."""
        bar, com, at = self.scene.object, self.com[:, None], self.at(times)
        sin = np.sin(at.theta)
        ends = np.minimum(-com * sin, (bar.length - com) * sin)
        return np.asarray(self.cup.rim - (at.z + ends - bar.width / 2 * np.abs(np.cos(at.theta))))

    def clearance(self, times: Array) -> Array:
        """Clearance (N, K): of the corners below the rim to the wall, of the rim to the bar.

        Between them lies the outline's point at the rim's height, which is no nearer to the
        wall than the rim is to the bar.
        """
        cup, bar, com, at = self.cup, self.scene.object, self.com[:, None], self.at(times)
        x, z, cos, sin = at.x - cup.x, at.z - cup.rim, np.cos(at.theta), np.sin(at.theta)
        half = np.sqrt(cup.radius**2 - (bar.width / 2) ** 2)
        least = np.full(times.shape, np.inf)
        for along in (-com, bar.length - com):
            for across in (-bar.width / 2, bar.width / 2):
                free = half - np.abs(x + cos * along - sin * across)
                below = z + sin * along + cos * across <= 0.0
                least = np.minimum(least, np.where(below, free, np.inf))
        for rim in (-half, half):
            along, across = cos * (rim - x) - sin * z, -cos * z - sin * (rim - x)
            over = np.maximum(np.maximum(-com - along, along - (bar.length - com)), 0.0)
            aside = np.maximum(np.abs(across) - bar.width / 2, 0.0)
            least = np.minimum(least, np.hypot(over, aside))
        return least


def cup_entries(scene: Scene, detach: Array, flight: Array, com: Array | None = None) -> Array:
    """Least clearance (N,) [m] of the bars' way into the scene's cup; -inf for those that miss it.

    detach (N, 6): CoM pose and twist; flight (N,): seconds until the landing height; com (N,):
    the CoM's distance from the end nearer the grasp, where it is not the scene's. The way in is
    from the lower end's passing the rim plane until it is `insertion` below; the clearance is
    the least distance of outline and wall or rim, negative outside. The bar is taken as thick as
    it is wide, so in a round cup the walls are nearer than `radius` off the middle.
    """
    cup = scene.cup
    assert cup is not None
    com = np.full(len(detach), scene.object.com) if com is None else com
    clearance = np.full(len(detach), -np.inf)
    coming = np.flatnonzero(np.isfinite(flight))
    flights = _Flights(scene, cup, com[coming], detach[coming])
    times = np.linspace(0.0, 1.0, COARSE) * (flight[coming, None] + BEYOND)
    depth = flights.depth(times)
    deep = depth >= cup.insertion
    first_deep = np.argmax(deep, axis=1)
    above = (depth < 0.0) & (np.arange(COARSE) < first_deep[:, None])
    last_above = COARSE - 1 - np.argmax(above[:, ::-1], axis=1)
    enters = np.flatnonzero(deep.any(axis=1) & above.any(axis=1))
    flights = flights.picked(enters)

    # Both ends of the way in at once: where the depth passes 0, and the insertion.
    rows, levels = enters[:, None], np.array([0.0, cup.insertion])
    before = np.stack([last_above[enters], first_deep[enters] - 1], axis=1)
    low, high = times[rows, before], times[rows, before + 1]
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        under = flights.depth(middle) >= levels
        low, high = np.where(under, low, middle), np.where(under, middle, high)
    begin, end = ((low + high) / 2).T
    least = np.full(enters.size, np.inf)
    for _ in range(ROUNDS):
        instants = np.linspace(begin, end, FINE, axis=1)
        found = flights.clearance(instants)
        nearest = np.argmin(found, axis=1)
        least = np.minimum(least, found.min(axis=1))
        around = np.clip([nearest - 1, nearest + 1], 0, FINE - 1)
        begin, end = (np.take_along_axis(instants, a[:, None], 1)[:, 0] for a in around)
    clearance[coming[enters]] = least
    return clearance


def enters_cup_at_landing(
    scene: Scene, detach: Array, x: Array, time: Array, more: float = 0.0
) -> Flags:
    """Whether throws (N,) go into a cup that has come along with the target to their landing.

    detach (N, 6): CoM pose and twist; x (N,) [m] and time (N,) [s] of the landing at the
    height of the scene's target; more [m]: clearance beyond the scene's. True for a scene
    without a cup.
    """
    if scene.cup is None or scene.target is None:
        return np.ones(len(x), dtype=bool)
    shifted = detach.copy()
    shifted[:, 0] += scene.target.plane_x - x
    return np.asarray(cup_entries(scene, shifted, time) >= scene.cup.clearance + more)
