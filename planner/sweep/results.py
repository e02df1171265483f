"""The result of a sweep: statistics, JSON and files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, Flags, Indices, ReadOnly
from ...problems.files import filling, plain, write_json
from ..result import Plan
from ..throw import ThrowBatch
from ..uncertainty import DelayScan, RestCount, Sampler
from ..verdict import Verdicts
from .statistics import quantiles
from .summary import sweep_summary

#: Files of a sweep's folder; the pictures of an earlier sweep go.
SWEEP_FILES = ("sweep.csv", "sweep.json", "landings.png", "delay.png", "tornado.png")
#: Rows of sweep.csv formatted at once, to bound the memory.
ROWS = 8192

#: 97.5 % of a standard normal distribution are below.
NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class Sweep(ReadOnly):
    """A plan's sent motion thrown with sampled parameters, by one release model.

    numbers (N,): places in the sequence of samples; values (N, P): their parameters, columns as
    `sampler.names`, SI units; landings: their outcomes; nominal: the throw with the plan's own
    values. derivatives: (dx, dtheta) by each parameter; shares: of the variances of x and theta.
    delays: the largest delays that succeed. rests: of the first samples, for a scene with [rest].
    seconds: time of the sweep.
    """

    plan: Plan
    batch: ThrowBatch
    sampler: Sampler
    numbers: Indices
    values: Array
    landings: Verdicts
    nominal: Verdicts
    derivatives: dict[str, tuple[float, float]]
    shares: dict[str, tuple[float, float]]
    delays: DelayScan
    rests: RestCount | None
    seconds: float

    @property
    def samples(self) -> int:
        """Number of throws."""
        return len(self.numbers)

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        rate = 100 * float(self.success.mean())
        return f"Sweep({self.label}: {self.samples:,} throws, {rate:.1f} % succeed)"

    @property
    def label(self) -> str:
        """The scene's name, and whether its plan is robust."""
        return f"{self.plan.scene.name}{', robust' if self.plan.robust else ''}"

    @property
    def success(self) -> Flags:
        """(N,): inside the tolerance, or into the cup; and no other limit is broken."""
        return self.landings.succeeds

    @property
    def errors(self) -> dict[str, Array]:
        """`pose_errors` of the landings."""
        return pose_errors(self.plan, self.landings, self.nominal)

    def to_dict(self) -> dict[str, Any]:
        """The sweep as JSON: SI units, radians.

        bias: of the nominal landing from the target; position and angle are sizes, x and theta
        signed. quantiles: of the distances from the nominal landing; scaled is the pose error
        (position plus angle times half the length). sensitivity: derivatives in the parameter, and
        shares of the variances. broken: shares of the throws that fail by each code of plan.json;
        a landing outside the tolerance but in the cup is no failure. delay_inside: the largest
        delays [s] beyond the mean that succeed, null above 50 ms.
        """
        scene, target = self.plan.scene, self.plan.goal
        x, theta = (float(value) for value in self.nominal.pose[0, :2])
        dx, dtheta = target.miss(x, theta)
        spread = np.nanstd(self.landings.pose[:, :2], axis=0) if self._lands else [math.nan] * 2
        entries = {
            "scene": scene.name,
            "samples": self.samples,
            "seed": self.sampler.seed,
            "model": self.batch.model,
            "robust": self.plan.robust,
            "uncertain": self.sampler.names,
            "assumed": [f"uncertainty.{name}" for name in scene.assumed_spreads],
            "success": _rate(self.success),
            "in_tolerance": _rate(self.landings.in_tolerance),
            "in_cup": None if scene.opening is None else _rate(self.landings.in_cup),
            **self._rest_entries(),
            **({"not_checked": [one.name for one in own]} if (own := scene.constraints) else {}),
            "held": _rate(self.landings.sticks),
            "broken": {code.value: share for code, share in self.landings.failures.items()},
            "nominal": {"x": x, "theta": theta},
            "bias": {"position": abs(dx), "angle": abs(dtheta), "x": dx, "theta": dtheta},
            "deviation": {"x": spread[0], "theta": spread[1]},
            "quantiles": {name: quantiles(errors) for name, errors in self.errors.items()},
            "sensitivity": {
                name: dict(zip(("x", "theta"), self.derivatives[name], strict=True))
                | {"share": dict(zip(("x", "theta"), self.shares[name], strict=True))}
                for name in self.sampler.names
            },
            "delay_inside": {"early": self.delays.early, "late": self.delays.late},
            "time": self.seconds,
        }
        table: dict[str, Any] = plain(entries)
        return table

    def summary(self) -> str:
        """The sweep as text."""
        return sweep_summary(self.plan, self.label, self.to_dict())

    def save(self, folder: str | Path) -> None:
        """Write sweep.json and sweep.csv; InputError if that cannot be done."""
        with filling(Path(folder), SWEEP_FILES) as scratch:
            self._write_samples(scratch / "sweep.csv")
            write_json(scratch / "sweep.json", self.to_dict())

    def _write_samples(self, path: Path) -> None:
        """A row a sample: its number, parameters, landing and success (0 or 1)."""
        names, landings = self.sampler.names, self.landings
        header = ["sample", *names, "x", "theta", "flight_time", "success", "held"]
        columns = [self.numbers, *self.values.T, *landings.pose.T, self.success, landings.sticks]
        formats = ["%d", *["%.9g"] * (len(names) + 3), "%d", "%d"]
        with path.open("w", encoding="utf-8") as file:
            file.write(",".join(header) + "\n")
            for first in range(0, self.samples, ROWS):
                rows = np.column_stack([column[first : first + ROWS] for column in columns])
                np.savetxt(file, rows, delimiter=",", fmt=formats)

    def _rest_entries(self) -> dict[str, Any]:
        """How many of the first samples rest where [rest] wants them, and their share."""
        if self.rests is None:
            return {}
        rate = _rate(np.arange(self.rests.of) < self.rests.rests)
        return {"rests": self.rests.to_dict() | rate}

    @property
    def _lands(self) -> bool:
        return bool(np.isfinite(self.landings.pose[:, 0]).any())


def _rate(successes: Flags) -> dict[str, float]:
    """Share of the throws and its Wilson 95 % interval (Wilson 1927)."""
    total = successes.size
    rate, narrow = float(successes.mean()), NORMAL_95**2 / total
    middle = (rate + narrow / 2) / (1 + narrow)
    half = math.sqrt(narrow * (rate * (1 - rate) + narrow / 4)) / (1 + narrow)
    return {"rate": rate, "low": max(middle - half, 0.0), "high": min(middle + half, 1.0)}


def pose_errors(plan: Plan, landings: Verdicts, nominal: Verdicts) -> dict[str, Array]:
    """Distances (N,) from the nominal landing: position [m], angle [rad], pose error `scaled`
    [m]."""
    dx, dtheta = (landings.pose - nominal.pose).T[:2]
    turn = dtheta if plan.target.theta is not None else 0.0
    scaled = plan.scene.object.pose_error(dx, turn)
    return {"position": np.abs(dx), "angle": np.abs(dtheta), "scaled": scaled}
