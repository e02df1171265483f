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
from .batch import Judge

#: Largest delay [s] of a scan over delays.
FURTHEST = 0.05
#: Sections of three nested scans for the first delay that fails; the first covers all delays up to
#: `FURTHEST`.
SECTIONS = (100, 64, 64)
#: Delay [s] by which the landing's change per delay is said.
MILLISECOND = 0.001


@dataclass(frozen=True)
class DelayScan:
    """The largest delays [s] before and after the mean without a failure.

    0 if the nominal throw fails, None without a failure up to `FURTHEST`.
    """

    early: float | None
    late: float | None


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
    late = batch.mean_delay + delays
    if "delay" not in batch.names:
        names = (*batch.names, "delay")
        return replace(batch, names=names), np.column_stack([values, late])
    values = values.copy()
    values[:, batch.names.index("delay")] = late
    return batch, values


@dataclass(frozen=True)
class DelayTolerance:
    """What an opening that is early or late does to a throw, by exact releases of its motion.

    x [m], theta [rad]: change of the landing per second of delay, between 1 ms early and 1 ms late;
    NaN where one of these never lands. scan: the delays that succeed.
    """

    x: float
    theta: float
    scan: DelayScan

    @classmethod
    def of(cls, throw: Throw, target: Pose) -> DelayTolerance:
        """That of a solved throw; [uncertainty] does not count. target: the requested one."""
        sure = throw.in_scene(throw.scene.changed(uncertainty=None))
        opening = sure.scene.gripper.profile().opening
        batch = ThrowBatch.of(sure, target, ("delay",), (-FURTHEST, FURTHEST, opening))
        ends = [batch.one(np.array([d])).landing for d in (-MILLISECOND, MILLISECOND)]
        x, theta = (getattr(ends[1], k) - getattr(ends[0], k) for k in ("x", "theta"))
        return cls(x / (2 * MILLISECOND), theta / (2 * MILLISECOND), scan_delays(Judge(batch)))

    @property
    def words(self) -> str:
        """The same as a sentence."""
        moves = "lets the object miss the target's height"
        if math.isfinite(self.x):
            turn = math.degrees(MILLISECOND * self.theta)
            moves = f"moves the landing by {self.x:+.2f} mm and {turn:+.2f} deg"
        return (
            f"the gripper's delay is not measured: each ms of it {moves};\n"
            f"        the throw succeeds up to {_borne(self.scan.early)} early and "
            f"{_borne(self.scan.late)} late. Measure the delay for [uncertainty]\n"
            "        (throwplan measure-gripper, or identify --delay on measured throws)"
        )

    def to_dict(self) -> dict[str, Any]:
        """As JSON, SI units; early and late are None without a failure up to 50 ms."""
        table: dict[str, Any] = plain({"x": self.x, "theta": self.theta} | vars(self.scan))
        return table


def _borne(delay: float | None) -> str:
    """The size of a delay [s] that succeeds, in words."""
    return f"{1e3 * FURTHEST:g} ms and more" if delay is None else f"{1e3 * abs(delay):.2g} ms"
