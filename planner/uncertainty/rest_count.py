"""How often the object comes to rest where [rest] wants it, over [uncertainty] and the contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...models import Array, Flags
from ...problems import Rest, Scene
from ..rest import Ends, entry_states, roll_to_rest
from ..throw import Throw
from ..verdict import Code, Finding, Judge
from .sampled_throws import sample_throws
from .sampler import even_shares

#: Throws that a plan's count samples.
COUNTED = 64
#: Seed of the samples of a plan's count.
REPORTED = 1
#: Seed of the samples that choose a plan; others than those counted, which would flatter it.
COMPARED = 7
#: Findings of throws that do not come to their flight: these rest nowhere.
STOPPED = (Code.NO_LANDING, Code.RELEASE, Code.SLIP_BEFORE_OPENING)


@dataclass(frozen=True)
class RestCount:
    """Of `of` sampled throws, `rests` come to rest at the place that `rest` names.

    moving: of the others, those that still move after 3 s among the bodies around the target.
    missed: those that never were in the wanted cup, and throws that never fly.
    """

    rest: Rest
    rests: int
    of: int
    moving: int
    missed: int

    @property
    def share(self) -> float:
        """Share of the throws that rest there."""
        return self.rests / self.of

    @property
    def words(self) -> str:
        """The count as text."""
        words = f"rests {self.rest.place} in {self.rests} of {self.of} throws"
        out = self.of - self.rests - self.moving - self.missed
        parts = {"misses it": self.missed, "bounces out": out, "still moves": self.moving}
        if self.rest.in_ is None:
            parts = {"still moves": self.moving}
        more = [f"{text} in {number}" for text, number in parts.items() if number]
        return f"{words} ({', '.join(more)})" if more else words

    @property
    def findings(self) -> tuple[Finding, ...]:
        """A warning if fewer rest there than [rest] at_least asks."""
        if self.share >= self.rest.at_least:
            return ()
        note = f"{self.words}, fewer than {100 * self.rest.at_least:g} %: {Code.REST.cure}"
        return (
            Finding(
                Code.REST, self.share, self.rest.at_least, body="object", broken=False, note=note
            ),
        )

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "place": self.rest.place,
            "rests": self.rests,
            "of": self.of,
            "moving": self.moving,
            "missed": self.missed,
            "at_least": self.rest.at_least,
        }


@dataclass(frozen=True)
class Entries:
    """Sampled throws of one motion as they come down to the bodies around the target.

    states (N, 6): poses and twists in the throw's plane, as a target that moves sees them;
    restitution, friction (N,): of their contacts; flies (M,): flags of the sampled throws that
    come to their flight, N of them; succeeds (M,): of those that a sweep counts as a success.
    """

    states: Array
    restitution: Array
    friction: Array
    flies: Flags
    succeeds: Flags

    @classmethod
    def of(cls, judge: Judge, values: Array, seed: int) -> Entries:
        """The throws with values (N, P) of the uncertain parameters, contacts drawn by `seed`."""
        batch, rest = judge.batch, judge.batch.scene.rest
        assert rest is not None
        flights = batch.fly(values)
        judged = judge.verdicts(values)
        flies = ~judged.breaks(*STOPPED) & np.isfinite(flights.landing).all(axis=1)
        detach = flights.start[flies]
        # A moving target is at its place when the throw itself lands.
        speed = batch.target.speed
        detach[:, 0] -= speed * (flights.freed[flies] - batch.throw.landing_time)
        detach[:, 3] -= speed
        low, high = np.array([rest.restitution, rest.friction]).T
        # In another order than the throws, whose values come from the same sequence.
        shares = np.random.default_rng(seed).permutation(even_shares(2, 0, len(values), seed))
        contact = low + (high - low) * shares[flies]
        states = entry_states(batch.scene, detach)[1]
        restitution, friction = contact.T
        return cls(states, restitution, friction, flies, judged.succeeds)

    @classmethod
    def sampled(cls, throw: Throw, count: int = COUNTED, seed: int = REPORTED) -> Entries:
        """`count` samples of what is uncertain in a throw and in its contacts."""
        return cls.of(*sample_throws(throw, throw.target, count, seed), seed)

    def count(self, scene: Scene) -> RestCount:
        """Where they end, by MuJoCo."""
        assert scene.rest is not None
        ends, stopped = self._ends(scene), int((~self.flies).sum())
        there = ends.where_wanted(scene)
        missed = ~there & ~ends.entered & (scene.rest.in_ is not None)
        moving = ~there & ~ends.at_rest & ~ends.lost & ~missed
        return RestCount(
            scene.rest,
            int(there.sum()),
            len(self.flies),
            int(moving.sum()),
            int(missed.sum()) + (stopped if scene.rest.in_ else 0),
        )

    def stays(self, scene: Scene) -> Flags:
        """Flags (M,) of the sampled throws that succeed and rest at the wanted place."""
        stays = self.succeeds & self.flies
        stays[self.flies] &= self._ends(scene).where_wanted(scene)
        return stays

    def _ends(self, scene: Scene) -> Ends:
        return roll_to_rest(scene, self.states, self.restitution, self.friction)


@dataclass(frozen=True, eq=False)
class RestingThrow:
    """A throw among others to its target, by common samples of [uncertainty] and contacts."""

    throw: Throw

    @cached_property
    def stays(self) -> Flags:
        """Flags (64,) of the throws that succeed and rest where they should."""
        return Entries.sampled(self.throw, seed=COMPARED).stays(self.throw.scene)


def count_rests(throw: Throw) -> RestCount | None:
    """The count over samples of a throw's uncertain parameters and contacts.

    None without [rest]; InputError without MuJoCo.
    """
    if throw.scene.rest is None:
        return None
    return Entries.sampled(throw).count(throw.scene)
