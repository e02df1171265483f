"""Section `calibration`: regions from measured throws against hidden truths.

A hidden truth is a robot whose joints lag, pads of another friction and radius that press as Hertz
says on a mesh, a gripper that jitters, and a camera with noise. The planner knows none of it: it
plans by its scene, sees where the throws land, and calibrates.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from throwplan import (
    Calibrated,
    Gripper,
    Plan,
    Planner,
    Pose,
    Response,
    Scene,
    calibrate,
    load_scene,
)
from throwplan.models import Array, Body, Contact, Flags, FlightLaw, Indices, Trajectory
from throwplan.models.release import ReleaseBatch
from throwplan.models.release.patch import PatchRelease
from throwplan.planner.identify import conformal_region
from throwplan.planner.show import BLUE, GREY, ORANGE, Row, Table
from throwplan.planner.validation import SynthesisConfig, make_throws

from .page import Effort, Picture, ReportSection, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Seed of truths, throws and targets.
SEED = 33
#: Data sets: quick, full.
SETS = (6, 300)
#: Throws of a data set from which is calibrated.
COUNTS = (9, 20, 60)
#: The number whose calibrations plan new throws.
PLANNED = 20
#: New throws of a data set: at the old aims, and plans with the calibration.
NEW, PLANS = 20, 3
#: Level of the regions.
LEVEL = 0.9
#: Places of the plans that are thrown and measured, and their range: x [m], theta [rad].
PLACES, X, THETA = 150, (1.14, 1.24), (-0.15, 0.15)
#: Standard deviations of the opening [s], and of a measured landing: x [m], theta [rad].
JITTER, NOISE = 0.003, (0.001, math.radians(0.5))
#: Factor by which friction and radius are off at most; shortest and longest lag [s] of the joints.
FACTOR, LAG = 1.25, (0.002, 0.020)
#: Steps of the patch over the opening, at most 0.1 mm from those of 8 times as many.
STEPS = 500
#: Data sets of recordings to which friction is fitted, too, and throws of each.
FITTED, RECORDED = (1, 24), 10
#: Grip [N, s] of the recordings; contact that the grip holds in all of them: friction, radius [m].
GRIP, HELD = Gripper(force=220.0, dwell=0.05, opening=0.06), (0.8, 0.0031)
#: Bias in scatters from which aiming by it must halve the error.
LARGE = 3.0


@dataclass(frozen=True)
class Truth:
    """What the planner does not know: friction, patch radius [m], lag [s] of the joints."""

    friction: float
    patch_radius: float
    lag: float

    @classmethod
    def drawn(cls, scene: Scene, rng: np.random.Generator) -> Truth:
        """A truth beside the scene's contact."""
        rough, wide = (float(f) for f in FACTOR ** rng.uniform(-1.0, 1.0, 2))
        contact = scene.contact
        lag = float(rng.uniform(*LAG))
        return cls(contact.friction * rough, contact.patch_radius * wide, lag)

    def measured(self, plans: Sequence[Plan], which: Indices, rng: np.random.Generator) -> Array:
        """Measured landings (N, 2), x [m] and theta [rad], of the plans' throws `which` (N,)."""
        scene, opening = plans[0].scene, plans[0].scene.gripper.profile().opening
        times = np.arange(-0.002, opening + 0.003, 0.001)
        hands = {int(i): self._hand(plans[i]) for i in np.unique(which)}
        late = JITTER * rng.standard_normal(len(which))
        poses = [
            hands[int(i)].at(delay + times).pose.T for i, delay in zip(which, late, strict=True)
        ]
        grip, count = scene.gripper.profile(), len(which)
        batch = ReleaseBatch(
            count,
            Body(*(np.full(count, value) for value in vars(scene.body).values())),
            Contact(np.full(count, self.friction), np.full(count, self.patch_radius)),
            grip,
            Trajectory.through(times, np.array(poses)),
            np.full(count, opening),
            np.full(count, grip.full),
            scene.gravity,
        )
        detach = PatchRelease(pressure="hertz").throw(batch, STEPS).detach
        landing = FlightLaw(scene.gravity).land(detach, plans[0].target.z)[:, :2]
        return np.asarray(landing + np.array(NOISE) * rng.standard_normal((count, 2)))

    def _hand(self, plan: Plan) -> Trajectory:
        """The hand of a plan's motion, counted from its opening, with joints that lag."""
        assert plan.throw is not None
        sent, rate = plan.throw.samples, np.full(plan.throw.samples.q.shape[1], 1.0 / self.lag)
        q = Response(rate, 0.0 * rate).all(sent.q).T
        pose = np.array([np.ravel(part) for part in plan.manipulator.motion(q, 0 * q, 0 * q)[0]])
        return Trajectory.through(sent.times - plan.throw.opening_time, pose.T)


def make(effort: Effort) -> ReportSection:
    """Regions of three numbers of throws, then plans by those of one."""
    count, fits, scene = effort.of(*SETS), effort.of(*FITTED), load_scene("pose")
    rng, step = np.random.default_rng(SEED), effort.counter(count + fits)
    rows = list[Row]()
    with tempfile.TemporaryDirectory() as name:
        bench = Bench.made(scene, rng, Path(name))
        for number in range(1, count + 1):
            rows.append({"set": number} | bench.set_row(rng))
            step()
    fitted = list[Row]()
    for number in range(1, fits + 1):
        fitted.append({"set": number} | _fitted_row(number))
        step()
    table = Table("calibration-sets", "Data sets with hidden truths: regions, errors", rows)
    words = "Recordings to which friction and radius were fitted, too: new throws inside"
    others = Table("calibration-fitted", words, fitted)
    caption = "Median error of the new plans of each data set, aimed with the bias and without."
    return ReportSection(
        "calibration",
        "Calibrated by measured throws",
        [*_figures(table), _fitted_words(others)],
        [table, others, _summary(table)],
        [Picture("calibration", caption, _picture(table))],
    )


@dataclass(frozen=True)
class Bench:
    """What all data sets share: the planner without a calibration, and plans that are thrown."""

    planner: Planner
    first: Plan
    plans: list[Plan]
    folder: Path

    @classmethod
    def made(cls, scene: Scene, rng: np.random.Generator, folder: Path) -> Bench:
        """Solved plans at random places, saved under their numbers."""
        planner = Planner(scene, library=False)
        bench = cls(planner, planner.plan(), [], folder)
        while len(bench.plans) < PLACES:
            plan = planner.plan(_place(scene, rng), warm=bench.first)
            if plan.solved:
                plan.save(folder / str(len(bench.plans)), draw=False)
                bench.plans.append(plan)
        return bench

    def set_row(self, rng: np.random.Generator) -> Row:
        """One data set: its truth, what new throws do, and plans with the calibration."""
        scene, most = self.planner.scene, max(COUNTS)
        truth = Truth.drawn(scene, rng)
        which = rng.permutation(PLACES)[: most + NEW]
        landing = truth.measured(self.plans, which, rng)
        predicted = [plan.throw.deciding.landing for plan in self.plans if plan.throw is not None]
        residuals = landing - np.array([(predicted[i].x, predicted[i].theta) for i in which])
        row: Row = {
            "friction": truth.friction,
            "patch_radius [mm]": 1e3 * truth.patch_radius,
            "lag [ms]": 1e3 * truth.lag,
        }
        for count in COUNTS:
            half = conformal_region(residuals[:count], LEVEL)
            off = np.abs(residuals[most:] - residuals[:count].mean(axis=0))
            row[f"inside of {NEW}, {count} throws"] = int((off <= half).all(axis=1).sum())
            row[f"position [mm], {count} throws"] = 1e3 * float(half[0])
            row[f"angle [deg], {count} throws"] = math.degrees(half[1])
        found = self._calibrated(which[:PLANNED], landing[:PLANNED])
        row |= self._planned(found, truth, rng)
        mean = residuals.mean(axis=0)
        away = scene.object.pose_error(*(residuals - mean).T)
        row["bias [mm]"] = 1e3 * scene.object.pose_error(*mean.tolist())
        row["scatter [mm]"] = 1e3 * float(np.median(away))
        return row

    def _calibrated(self, which: Indices, landing: Array) -> Calibrated:
        """The calibration of the scene by throws, as a user's file has them."""
        path = self.folder / "throws.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("plan", "x", "theta"))
            writer.writerows(
                (i, *pose) for i, pose in zip(which.tolist(), landing.tolist(), strict=True)
            )
        return calibrate(path, self.planner.scene, LEVEL)

    def _planned(self, found: Calibrated, truth: Truth, rng: np.random.Generator) -> Row:
        """New plans at new places: errors of their throws, with the calibration and without.

        All plans start from that of the scene's own target: throws of one kind.
        """
        scene, errors, inside, holds = self.planner.scene, list[Array](), 0, 0
        calibrated = Planner(found.apply(scene), library=False)
        places = [_place(scene, rng) for _ in range(PLANS)]
        for planner, first in ((calibrated, calibrated.plan()), (self.planner, self.first)):
            plans = [planner.plan(place, warm=first) for place in places]
            solved = [plan for plan in plans if plan.solved]
            landing = truth.measured(solved, np.arange(len(solved)), rng)
            miss = np.array([p.target.miss(*at) for p, at in zip(solved, landing, strict=True)])
            errors.append(1e3 * scene.object.pose_error(*miss.T))
            if planner is calibrated:
                within = (np.abs(miss) <= (found.section.position, found.section.angle)).all(axis=1)
                like = np.array([plan.to_dict()["calibration"]["holds"] for plan in solved])
                inside, holds = int((within & like).sum()), int(like.sum())
        return {
            "plans": len(errors[0]),
            "plans like the throws": holds,
            "plans inside": inside,
            "error with bias [mm]": float(np.median(errors[0])),
            "error without [mm]": float(np.median(errors[1])),
        }


def _fitted_row(seed: int) -> Row:
    """Synthetic recordings of another contact than the scene's; some calibrate and fit.

    How many of the others land inside, by residuals of fits to the others and by those of one fit.
    """
    rng, scene = np.random.default_rng(seed), load_scene("pose")
    friction, radius = (float(v) for v in HELD * FACTOR ** rng.uniform(0.0, 1.0, 2))
    making = SynthesisConfig(friction=friction, patch_radius=radius, repeats=3, seed=seed)
    data, _ = make_throws(making)
    order = rng.permutation([i for i, t in enumerate(data.throws) if t.factors["com"] == "com1"])
    used, new = (data.picked(part.tolist()) for part in np.split(order, [RECORDED]))
    contact = dataclasses.replace(scene.contact, friction=HELD[0], patch_radius=HELD[1])
    found = calibrate(used, scene.replace(gripper=GRIP, contact=contact), LEVEL, fit=True)
    plain = found.scene.replace(calibration=None)
    off, own = (calibrate(one, plain, LEVEL).residuals.landing for one in (new, used))
    row: Row = {"friction": friction, "patch_radius [mm]": 1e3 * radius, "new throws": len(off)}
    for name, known in (("inside", found.residuals.landing), ("inside, same fit", own)):
        half = conformal_region(known, LEVEL)
        row[name] = int((np.abs(off - known.mean(axis=0)) <= half).all(axis=1).sum())
    return row


def _fitted_words(table: Table) -> str:
    """Coverage where friction was fitted."""
    inside, same, new = (
        _column(table, name) for name in ("inside", "inside, same fit", "new throws")
    )
    shares = inside / new
    error = shares.std(ddof=1) / math.sqrt(len(new)) if len(new) > 1 else math.nan
    return (
        f"With friction and radius fitted to {RECORDED} recordings, in {len(new)} data sets: each "
        f"predicted by the fit to the others, {100 * shares.mean():.1f} % of new throws land "
        f"inside (standard error {100 * error:.1f} %); predicted by the fit to all "
        f"{100 * same.sum() / new.sum():.1f} %."
    )


def _place(scene: Scene, rng: np.random.Generator) -> Pose:
    """A random target."""
    return scene.aim.in_plane(float(rng.uniform(*X)), float(rng.uniform(*THETA)))


def _column(table: Table, name: str) -> Array:
    """A column of numbers (N,)."""
    return np.array([float(str(value)) for value in table.column(name)])


def _summary(table: Table) -> Table:
    """By the number of throws: how many new ones land in the region, and its size."""
    rows = list[Row]()
    for count in COUNTS:
        inside = _column(table, f"inside of {NEW}, {count} throws")
        rows.append(
            {
                "throws": count,
                "guaranteed": math.ceil(LEVEL * (count + 1) - 1e-9) / (count + 1),
                "new throws inside": float(inside.mean() / NEW),
                "position, median [mm]": float(
                    np.median(_column(table, f"position [mm], {count} throws"))
                ),
                "angle, median [deg]": float(
                    np.median(_column(table, f"angle [deg], {count} throws"))
                ),
            }
        )
    return Table("calibration", "Regions of 90 %, by the number of throws", rows, short=True)


def _large(table: Table) -> Flags:
    """Flags (N,) of the data sets whose bias is large."""
    return _column(table, "bias [mm]") >= LARGE * _column(table, "scatter [mm]")


def _figures(table: Table) -> list[str]:
    """Coverage of regions and plans, and what the bias does to the error."""
    large, plans, like, within = (
        _large(table),
        *(_column(table, f"plans{name}").sum() for name in ("", " like the throws", " inside")),
    )
    inside = ", ".join(
        f"{100 * _column(table, f'inside of {NEW}, {n} throws').mean() / NEW:.1f} % after {n}"
        for n in COUNTS
    )
    with_bias, without = (_column(table, f"error {name} [mm]") for name in ("with bias", "without"))
    sentences = [
        f"{len(large)} data sets, each of another hidden truth: regions of 90 % hold, of {NEW} new "
        f"throws of each, {inside} throws.",
        f"New plans at other places, aimed with the bias of {PLANNED} throws: "
        f"{100 * like / plans:.1f} % of {plans:.0f} are like the measured throws, and "
        f"{100 * within / like:.1f} % of these land inside.",
        f"The median error of new plans is {np.median(with_bias):.1f} mm with the bias and "
        f"{np.median(without):.1f} mm without (position plus angle times half the length).",
    ]
    if large.any():
        ratio = np.median(with_bias[large]) / np.median(without[large])
        sentences.append(
            f"{large.sum()} sets whose bias is {LARGE:g} times their scatter or more: "
            f"{np.median(with_bias[large]):.1f} mm with the bias, "
            f"{np.median(without[large]):.1f} mm without: {ratio:.2f} times."
        )
    return sentences


def _picture(table: Table) -> Figure:
    """Errors with the bias and without, over the bias in scatters."""
    figure, axes = panels(6.4, 4.2)
    axis, ratio = axes[0, 0], _column(table, "bias [mm]") / _column(table, "scatter [mm]")
    for name, colour in (("without", ORANGE), ("with bias", BLUE)):
        errors = _column(table, f"error {name} [mm]")
        axis.plot(ratio, errors, "o", color=colour, ms=4, mec="white", mew=0.4, label=name)
    axis.axvline(LARGE, color=GREY, lw=0.8)
    axis.set(xlabel="bias over scatter", ylabel="median error of new plans [mm]", yscale="log")
    axis.legend()
    return figure
