"""The result of planning: the throw, status, landings, errors, motion; as JSON and as files."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from ...problems import InputError, Pose, Scene
from ...problems.files import filling, plain, write_json
from ..ocp import peak_load
from ..throw import Manipulator, Throw, torque_limits
from ..uncertainty import DelayTolerance, RestCount, warnings
from ..verdict import CalibratedLanding, Verdict, calibrated_landing, measures_of, verdict_on
from .active_limits import ActiveLimit, Bound
from .beyond_recommended import exceeded, exceeded_entries
from .motion import SentMotion
from .motion_files import read_motion, write_motion
from .plan_files import FILES, NEAREST, PlanPath, SavedThrow, Status, entries_of, path_of, read_plan
from .planned_throw import PlannedThrow
from .summary import summary

#: Keys of a release's times in the JSON.
MOMENTS = ("command_time", "opening_time", "detach_time", "landing_time")


@dataclass(frozen=True, repr=False)
class Plan:
    """Result of planning. Times in s; see `to_dict` for all other units and frames.

    status: "solved", or "not_found", which says something about the search and nothing about the
    world. nearest: then the throw found that lands nearest, as a plan that is solved at its own
    landing; binding: the limits that hold it there, or, without one, the limit at which most starts
    ended; bound: what proves that nothing reaches the target. starts: how many were tried.
    short_of: the target of a nearest throw, which it misses.

    robust: whether throws that succeed more often under [uncertainty] were looked for; sampled: of
    how many samples the throw succeeds, in words, where they chose it.
    """

    scene: Scene
    manipulator: Manipulator
    target: Pose
    status: Status
    message: str
    throw: PlannedThrow | None
    nearest: Plan | None = None
    binding: tuple[ActiveLimit, ...] = ()
    bound: Bound | None = None
    solver: str = ""
    starts: int = 0
    iterations: int = 0
    variables: int = 0
    constraints: int = 0
    time: dict[str, float] = field(default_factory=dict)
    alternatives: tuple[Plan, ...] = ()
    short_of: Pose | None = None
    robust: bool = False
    sampled: str = ""

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        return f"Plan({self.scene.name}: {self.status}, {self.message})"

    @cached_property
    def verdict(self) -> Verdict:
        """The limits that the throw breaks, and warnings about a solved one."""
        if self.throw is None:
            return Verdict()
        deciding = self.throw.deciding
        judged = verdict_on(deciding, self.goal)
        if not self.solved:
            return judged
        findings = (*judged.findings, *warnings(deciding, self.target, self.robust))
        for claim in (self.calibrated, self.rests):
            findings += () if claim is None else claim.findings
        return replace(judged, findings=findings)

    @property
    def goal(self) -> Pose:
        """The target at the time of the landing."""
        moves = self.throw is not None and self.target.velocity is not None
        return self.target.at(self.throw.landing_time) if moves and self.throw else self.target

    @property
    def rests(self) -> RestCount | None:
        """How often the object comes to rest where [rest] wants it.

        None without [rest] and without a throw.
        """
        return self.throw.rests if self.throw is not None and self.solved else None

    @property
    def calibrated(self) -> CalibratedLanding | None:
        """What [calibration] says of the landing; None without it and without a throw."""
        if self.throw is None or not self.solved:
            return None
        return calibrated_landing(self.throw.deciding, self.goal)

    @cached_property
    def delay(self) -> DelayTolerance | None:
        """What an unknown delay of the gripper does to the throw.

        Made of some hundred throws, so `to_dict` leaves it out. None without a throw, and for a
        scene that knows the delay by its [uncertainty].
        """
        section = self.scene.uncertainty
        if self.throw is None or not self.solved or (section is not None and section.delay):
            return None
        return DelayTolerance.of(self.throw.deciding, self.target)

    @cached_property
    def exceeds(self) -> dict[str, tuple[float, float]]:
        """What the throw takes beyond the recommendations of the arm's and the gripper's maker,
        and these, SI units: of torque_rate, torque, tool_speed and grip_force those that it
        exceeds."""
        return {} if self.throw is None else exceeded(self.throw.deciding)

    @property
    def assumed(self) -> tuple[str, ...]:
        """Names of the values that neither the scene, a maker nor a measurement gives, such as
        "gripper.dwell"; "uncertainty.delay" where samples of it decide."""
        scene = self.scene
        sampled = self.robust or scene.rest is not None or scene.uncertainty is not None
        sampled = sampled or scene.weights.quiet > 0.0
        spreads = scene.assumed_spreads if sampled else ()
        return (*scene.assumed, *(f"uncertainty.{name}" for name in spreads))

    @property
    def solved(self) -> bool:
        """Whether the verdict on the throw that is sent has no broken limit."""
        return self.status == "solved"

    def to_dict(self) -> dict[str, Any]:
        """The plan as JSON: SI units, radians; poses in the base frame for an arm."""
        return {
            "scene": self.scene.name,
            "status": self.status,
            "message": self.message,
            "target": self.target.table,
            **self._landing_entries(),
            "nearest": self._nearest_entries(),
            "binding": [one.to_dict() for one in self.binding],
            "bound": self.bound and self.bound.to_dict(),
            "starts": self.starts,
            "exceeds": exceeded_entries(self.exceeds),
            "assumed": list(self.assumed),
            "solver": {"name": self.solver, "iterations": self.iterations},
            "nlp": {"variables": self.variables, "constraints": self.constraints},
            **self._optional_entries(),
            "time": {"build": 0.0, "guess": 0.0, "solve": 0.0, "smooth": 0.0, "check": 0.0}
            | {"total": 0.0}
            | self.time,
        }

    def _nearest_entries(self) -> dict[str, Any] | None:
        """Where the nearest throw lands, and its errors to the target."""
        if self.nearest is None or self.nearest.throw is None:
            return None
        landing, goal = self.nearest.throw.deciding.landing, self.nearest.short_of or self.target
        dx, dtheta = goal.miss(landing.x, landing.theta)
        x, z, theta = landing.pose
        pose = self._json_pose((x, z, theta))
        return {
            **(pose | ({"theta": None} if goal.theta is None else {})),
            "error": plain({"position": abs(dx), "angle": abs(dtheta)}),
            "pose_error": plain(self.scene.object.pose_error(dx, dtheta)),
        }

    def _landing_entries(self) -> dict[str, Any]:
        """Landings, their errors, and the times of the release."""
        landing = dict.fromkeys(("planned", "exact", "sent", "limit_surface"))
        error, release = dict.fromkeys(landing), dict.fromkeys(MOMENTS)
        if self.throw is not None:
            poses = self.throw.landings
            landing = {name: self._json_pose(pose) for name, pose in poses.items()}
            error = {name: self._json_error(poses[name]) for name in poses}
            release = {name: plain(getattr(self.throw.deciding, name)) for name in MOMENTS}
        return {"landing": landing, "error": error, "release": release}

    def _optional_entries(self) -> dict[str, Any]:
        """Entries of some plans only: torques of an arm with masses, robustness, alternatives."""
        more: dict[str, Any] = {}
        throw, arm = self.throw, self.scene.arm
        if throw is not None:
            more["decides"] = throw.decides
        more["findings"] = [finding.to_dict() for finding in self.verdict.findings]
        if self.verdict.warnings:
            more["warning"] = "; ".join(finding.words for finding in self.verdict.warnings)
        if throw is not None and arm is not None and torque_limits(self.scene) is not None:
            measures, limit = measures_of(throw.deciding), self.scene.torque_rate
            more["torque"] = {
                "use": float(measures.torque[0].max()),
                "rate": float(measures.value("rate")[0]),
                "rate_limit": limit,
                "load_step": throw.deciding.load_steps.tolist(),
            }
        if self.short_of is not None:
            more["short_of"] = self.short_of.table
        if self.scene.notes:
            more["notes"] = list(self.scene.notes)
        for name, claim in (("calibration", self.calibrated), ("rest", self.rests)):
            if claim is not None:
                more[name] = claim.to_dict()
        if self.robust:
            more["robust"] = True
        if self.peak_load is not None:
            more["peak_load"] = self.peak_load
        if self.alternatives:
            more["alternatives"] = [
                {key: other._landing_entries()[key] for key in ("landing", "release")}
                | {"effort": None if other.throw is None else other.throw.effort}
                for other in self.alternatives
            ]
        return more

    def save(self, folder: str | Path) -> None:
        """Write plan.json and, for a throw, motion.csv.

        Without a throw to the target the files of the nearest one are in the folder `nearest`.
        Raises InputError, and leaves the folder as it was, if it cannot be written.
        """
        with filling(Path(folder), (*FILES, NEAREST)) as scratch:
            self._write(scratch)
            if self.nearest is not None:
                (scratch / NEAREST).mkdir()
                self.nearest._write(scratch / NEAREST)

    def _write(self, folder: Path) -> None:
        """Writes the files into a folder."""
        if self.solved:
            write_motion(self.sent_motion(), folder / "motion.csv")
        aimed = self.scene.aimed_at(self.target)
        write_json(folder / "plan.json", entries_of(self.to_dict(), aimed))

    def sent_motion(self) -> SentMotion:
        """The motion that is sent; InputError for a plan without a throw."""
        return SentMotion.of(self.sent_throw())

    def sent_throw(self) -> Throw:
        """The throw that is sent; InputError for a plan without one."""
        if self.throw is None or not self.solved:
            raise InputError(f"the plan is {self.status}: it holds no throw")
        throw, scene = self.throw.deciding, self.scene.aimed_at(self.goal)
        return throw if throw.scene == scene else throw.in_scene(scene)

    def path(self) -> PlanPath:
        """The throw over time: times, poses of the object and the hand, joints.

        InputError for a plan without a throw.
        """
        return path_of(self.sent_throw())

    def summary(self, verbose: bool = False, folder: str | None = None) -> str:
        """The plan as lines for people: at most ten, without those of `alternatives`.

        verbose: also the solver, all margins, notes, and warnings in full. folder: where its files
        are, for the commands to go on with.
        """
        return summary(self, verbose, folder)

    @cached_property
    def peak_load(self) -> float | None:
        """The largest load on the pads once the earliest opening has left a quarter of the grip, as
        a share of the full grip's friction limit; None without a throw to the target."""
        return None if self.throw is None or not self.solved else peak_load(self.throw.deciding)

    def error_sent(self) -> tuple[float, float]:
        """(position [m], angle [rad]) error of the deciding landing; NaN without a throw."""
        if self.throw is None:
            return math.nan, math.nan
        dx, dtheta = self.throw.deciding.miss(self.goal)
        return abs(dx), abs(dtheta)

    def _json_pose(self, pose: tuple[float, float, float]) -> Any:
        """In-plane (x, z, theta) as JSON, turned to the target's azimuth for an arm."""
        x, z, theta = pose
        if self.scene.robot is None:
            return plain({"x": x, "z": z, "theta": theta})
        x_base, y_base, _ = map(float, self.target.plane.points(x, z))
        return plain({"x": x_base, "y": y_base, "z": z, "theta": theta})

    def _json_error(self, pose: tuple[float, float, float]) -> Any:
        position, angle = self.goal.miss(pose[0], pose[2])
        return plain({"position": abs(position), "angle": abs(angle)})

    def json(self) -> str:
        """`to_dict` as a JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)


def throw_of(plan: Plan | Throw | str | Path) -> Throw:
    """The throw of a solved plan, of a plan.json or of its folder; InputError without one."""
    if isinstance(plan, str | Path):
        return read_plan(plan)
    return plan if isinstance(plan, Throw) else plan.sent_throw()


class Sendable(Protocol):
    """What a motion is sent of: a plan, a cycle."""

    def sent_motion(self) -> SentMotion:
        """The motion; InputError without one."""


#: What a motion is taken from.
Source = SentMotion | Throw | Sendable | str | Path


def sent_motion(source: Source) -> SentMotion:
    """The motion of a plan, a throw, a cycle, or of their files; InputError without one."""
    if isinstance(source, SentMotion):
        return source
    if isinstance(source, str | Path):
        return read_motion(source)
    return SentMotion.of(source) if isinstance(source, Throw) else source.sent_motion()


def plan_of(plan: Plan | SavedThrow | str | Path) -> Plan:
    """A plan, also from a saved one: its throw as sent, without the NLP behind it; InputError
    without a throw."""
    if isinstance(plan, Plan):
        return plan
    saved = plan if isinstance(plan, SavedThrow) else read_plan(plan)
    throw = PlannedThrow(saved.path, saved.deciding, math.nan, (0, 0))
    known = saved.scene, saved.manipulator, saved.scene.aim
    return Plan(*known, "solved", saved.message, throw, robust=saved.robust)
