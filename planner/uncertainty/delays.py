"""Delays of the opening: the largest that succeed, and what each does to the landing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...models import Array, Flags
from ...problems import Pose
from ...problems.files import plain
from ..throw import Throw, ThrowBatch
from ..verdict import Judge

#: Largest delay [s] of a scan over delays.
FURTHEST = 0.05
#: Sections of three nested scans for the first delay that fails; the first covers all delays up to
#: `FURTHEST`.
SECTIONS = (100, 64, 64)
#: Delay [s] whose landing a plan says; the landing is no linear function of the delay.
SAID = 0.010


@dataclass(frozen=True)
class DelayScan:
    """The largest delays [s] before and after the mean without a failure.

    0 if the nominal throw fails, None without a failure up to `FURTHEST`.
    """

    early: float | None
    late: float | None

    @property
    def fails(self) -> bool:
        """Whether the nominal throw fails."""
        return self.early == self.late == 0.0

    @property
    def words(self) -> str:
        """The delays within which the throw succeeds, as text."""
        if self.fails:
            return "at no delay: it fails as planned"
        return f"up to {_borne(self.early)} early and {_borne(self.late)} late"


def scan_delays(judge: Judge) -> DelayScan:
    """Finds the first failure on either side; all other parameters have their planned values."""
    if not _succeeds(judge, np.zeros(1))[0]:
        return DelayScan(0.0, 0.0)
    return DelayScan(_largest_delay(judge, -1.0), _largest_delay(judge, 1.0))


def _largest_delay(judge: Judge, sign: float) -> float | None:
    low, high = 0.0, FURTHEST
    for sections in SECTIONS:
        ends = np.linspace(low, high, sections + 1)
        inside = _succeeds(judge, sign * ends[1:])
        if inside.all() and high == FURTHEST:
            return None
        first = int(np.argmin(np.append(inside[:-1], False)))
        low, high = float(ends[first]), float(ends[first + 1])
    return sign * low


def _succeeds(judge: Judge, delays: Array) -> Flags:
    """Flags of the delays (K,) beyond the mean that succeed; other parameters as planned."""
    batch, values = with_delays(judge.batch, delays, judge.batch.nominal(len(delays)))
    late = judge if batch is judge.batch else Judge(batch)
    return late.verdicts(values).succeeds


def with_delays(batch: ThrowBatch, delays: Array, values: Array) -> tuple[ThrowBatch, Array]:
    """A batch and values (K, P) with these delays (K,) [s] beyond the mean."""
    late = batch.scene.mean_delay + delays
    if "delay" not in batch.names:
        names = (*batch.names, "delay")
        return replace(batch, names=names), np.column_stack([values, late])
    values = values.copy()
    values[:, batch.names.index("delay")] = late
    return batch, values


@dataclass(frozen=True)
class DelayTolerance:
    """What an opening that is early or late does to a throw, by exact releases of its motion.

    early, late: change of the landing (x [m], theta [rad]), relative to a target that moves, by an
    opening 10 ms early or late; NaN where it never lands. scan: the delays that succeed, as in a
    sweep.
    """

    early: tuple[float, float]
    late: tuple[float, float]
    scan: DelayScan

    @classmethod
    def of(cls, throw: Throw, target: Pose) -> DelayTolerance:
        """That of a solved throw. target: the requested one."""
        opening = throw.scene.gripper.profile().opening
        reach = -FURTHEST, FURTHEST, opening
        judge = Judge.of_success(ThrowBatch.of(throw, target, ("delay",), reach))
        throws = [judge.batch.one(np.array([delay])) for delay in (0.0, -SAID, SAID)]
        at = [
            (one.landing.x - target.speed * one.landing_time, one.landing.theta) for one in throws
        ]
        early, late = ((x - at[0][0], theta - at[0][1]) for x, theta in at[1:])
        return cls(early, late, scan_delays(judge))

    def to_dict(self) -> dict[str, Any]:
        """As JSON, SI units; early and late are None without a failure up to 50 ms."""
        moved = {"early": self.early, "late": self.late}
        changes = {key: dict(zip(("x", "theta"), pose, strict=True)) for key, pose in moved.items()}
        table: dict[str, Any] = plain(vars(self.scan) | {"landing": {"delay": SAID} | changes})
        return table


def _borne(delay: float | None) -> str:
    """The size of a delay [s] that succeeds, in words; rounded down, so that it does."""
    if delay is None:
        return f"{1e3 * FURTHEST:g} ms and more"
    size = 1e3 * abs(delay)
    digits = 1 - math.floor(math.log10(size)) if size > 0.0 else 0
    return f"{math.floor(size * 10**digits) / 10**digits:.2g} ms"
