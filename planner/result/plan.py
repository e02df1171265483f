"""What planning gives back: status, landings, errors, motion; as JSON and as files."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ...models import SLIDING_PIVOT, STEPPED_SURFACE
from ...models import Path as Motion
from ...problems import Pose, Scene, plain
from ..check import Mover, Samples, Throw, torque_limits
from ..ocp import USUAL, Asked, Optimum, Solution, ThrowNlp
from .files import Draw, PlanPath, draw_plan, path_of, save_plan, sent_throw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Status = Literal["solved", "out_of_reach", "not_converged"]
#: Times of a release, by their names in the JSON.
MOMENTS = ("command_time", "opening_time", "detach_time", "landing_time")
#: The same for people.
MOMENT_WORDS = ("gripper command", "starts opening", "bar free", "lands")


@dataclass(frozen=True, repr=False)
class PlannedThrow:
    """The throw behind a plan: where it comes from and what the models make of it.

    planned: its motion up to detach; final: what is sent, by the model of the tolerance; effort:
    the NLP's cost of that motion; nlp_size: variables and constraints of its NLP; asked: what
    that has beyond the usual constraints; aim: how far from the target (dx [m], dtheta [rad])
    its landing is put, so that this one is at it. nlp, solution, landing_of_nlp (x, z [m], theta
    [rad]): of a throw that is an NLP's solution; optimum: of one that was moved from there.
    """

    planned: Motion
    final: Throw
    effort: float
    nlp_size: tuple[int, int]
    asked: Asked = USUAL
    aim: tuple[float, float] = (0.0, 0.0)
    nlp: ThrowNlp | None = None
    solution: Solution | None = None
    landing_of_nlp: tuple[float, float, float] | None = None
    optimum: Optimum | None = None

    @cached_property
    def exact(self) -> Throw:
        """The planned motion by the sliding pivot."""
        if self.scene.robot is None:
            return self.final.sliding_pivot
        return replace(self.final, path=self.planned, model=SLIDING_PIVOT)

    @cached_property
    def planned_landing(self) -> tuple[float, float, float]:
        """Where the smoothed model lands: x, z [m], theta [rad].

        Of a moved throw: as far from the exact model as at its optimum.
        """
        if self.optimum is None or self.landing_of_nlp is not None:
            return self.landing_of_nlp or (math.nan, math.nan, math.nan)
        (x, z, theta), (dx, turn) = self.exact.landing.pose, self.optimum.smoothing
        return x + dx, z, theta + turn

    @property
    def scene(self) -> Scene:
        """Aimed at the target."""
        return self.final.scene

    @property
    def mover(self) -> Mover:
        """What moves the hand."""
        return self.final.mover

    @property
    def opening_time(self) -> float:
        """When the grip force starts to fall [s] on the motion's clock."""
        return self.final.opening_time

    @property
    def samples(self) -> Samples:
        """What motion.csv holds."""
        return self.final.samples

    @property
    def sent(self) -> Throw | None:
        """What is sent by the sliding pivot; None for a hand, checked as planned."""
        return None if self.scene.robot is None else self.final.sliding_pivot

    @property
    def limit_surface(self) -> Throw:
        """What is sent by the limit surface."""
        return self.final.limit_surface

    @property
    def decides(self) -> str:
        """Whose landing makes it solved: "limit_surface", "sent", for a hand "exact"."""
        if self.scene.tolerance.model == STEPPED_SURFACE:
            return "limit_surface"
        return "exact" if self.sent is None else "sent"

    @cached_property
    def apart(self) -> tuple[float, float]:
        """How far apart sliding pivot and limit surface land: x [m], theta [rad]."""
        pivot, surface = self.final.sliding_pivot.landing, self.limit_surface.landing
        return abs(pivot.x - surface.x), abs(pivot.theta - surface.theta)

    @property
    def landing_time(self) -> float:
        """When the object lands [s] on the motion's clock."""
        return self.final.landing_time

    def words(self, goal: Pose) -> str:
        """How far from `goal` it lands, for people."""
        dx, dtheta = self.final.miss(goal)
        turn = "" if goal.theta is None else f" and {math.degrees(abs(dtheta)):.3f} deg"
        return f"lands {1e3 * abs(dx):.3f} mm{turn} from the target"


@dataclass(frozen=True, repr=False)
class Plan:
    """Result of planning. Times in s; see `to_dict` for the units and frames of the rest.

    robust: the method that made it so, empty if none; peak_load: then, the largest share of
    the grip's friction limit that the pads would transmit while they may open.
    """

    scene: Scene
    mover: Mover
    target: Pose
    status: Status
    message: str
    throw: PlannedThrow | None
    nearest: Pose | None = None
    binding: tuple[str, ...] = ()
    solver: str = ""
    iterations: int = 0
    attempts: int = 0
    variables: int = 0
    constraints: int = 0
    time: dict[str, float] = field(default_factory=dict)
    alternatives: tuple[Plan, ...] = ()
    robust: str = ""
    peak_load: float | None = None

    def __repr__(self) -> str:
        """A line: its arrays would fill a screen."""
        return f"Plan({self.scene.name}: {self.status}, {self.message})"

    @property
    def warning(self) -> str:
        """A line where the two release models differ by more than the tolerance; else empty."""
        if self.throw is None:
            return ""
        (x, theta), tolerance = self.throw.apart, self.scene.tolerance
        turn = 0.0 if self.target.theta is None else theta
        if x <= tolerance.position and turn <= tolerance.angle:
            return ""
        if not math.isfinite(x):
            return "only one of sliding pivot and limit surface comes down to the target's height"
        return (
            f"sliding pivot and limit surface land {1e3 * x:.1f} mm and "
            f"{math.degrees(theta):.1f} deg apart, more than the tolerance of "
            f"{1e3 * tolerance.position:g} mm and {math.degrees(tolerance.angle):g} deg"
        )

    @property
    def goal(self) -> Pose:
        """The target where it is when the object lands."""
        moves = self.throw is not None and self.target.velocity is not None
        return self.target.at(self.throw.landing_time) if moves and self.throw else self.target

    @property
    def solved(self) -> bool:
        """Whether the checked landing is inside the tolerance and nothing is broken."""
        return self.status == "solved"

    def to_dict(self) -> dict[str, Any]:
        """The plan as JSON: SI units, radians; poses in the base frame for an arm."""
        landing = dict.fromkeys(("planned", "exact", "sent", "limit_surface"))
        error, release = dict.fromkeys(landing), dict.fromkeys(MOMENTS)
        if self.throw is not None:
            poses = self._poses(self.throw)
            landing = {name: pose and self._json_pose(pose) for name, pose in poses.items()}
            error = {name: self._json_error(poses[name]) for name in error}
            release = self._moments(self.throw)
        nearest = self.nearest
        return {
            "scene": self.scene.name,
            "status": self.status,
            "message": self.message,
            "target": self.target.table,
            "landing": landing,
            "error": error,
            "release": release,
            "nearest": None
            if nearest is None
            else nearest.changed(velocity=None, arrival=None).table,
            "binding": list(self.binding),
            "solver": {
                "name": self.solver,
                "iterations": self.iterations,
                "attempts": self.attempts,
            },
            "nlp": {"variables": self.variables, "constraints": self.constraints},
            **self._more(),
            "time": {"build": 0.0, "guess": 0.0, "solve": 0.0, "smooth": 0.0, "check": 0.0}
            | {"total": 0.0, "draw": None}
            | self.time,
        }

    def _poses(self, throw: PlannedThrow) -> dict[str, tuple[float, float, float] | None]:
        """Landings (x, z, theta) in the throw's plane, by the names of the JSON."""
        return {
            "planned": throw.planned_landing,
            "exact": throw.exact.landing.pose,
            "sent": None if throw.sent is None else throw.sent.landing.pose,
            "limit_surface": throw.limit_surface.landing.pose,
        }

    def _moments(self, throw: PlannedThrow) -> dict[str, float | None]:
        """When [s] the command is sent, the force starts to fall, is zero, the object lands."""
        profile, opening = self.scene.gripper.profile(), throw.opening_time
        detach = opening + profile.opening
        command = opening - profile.dwell - self.scene.mean_delay
        landing = plain(detach + throw.final.landing.flight_time)
        return dict(zip(MOMENTS, (command, opening, detach, landing), strict=True))

    def _more(self) -> dict[str, Any]:
        """What only some plans have: torques, of an arm with masses; robustness, alternatives."""
        more: dict[str, Any] = {}
        throw, arm = self.throw, self.scene.arm
        if throw is not None:
            more["decides"] = throw.decides
        if self.warning:
            more["warning"] = self.warning
        if throw is not None and arm is not None and torque_limits(self.scene) is not None:
            torques, rates = throw.final.torques, arm.limits.torque_rate
            most = None if rates is None else min(rates)
            use = float(torques.use.max())
            more["torque"] = {"use": use, "rate": torques.rate, "rate_limit": most}
        if self.scene.notes:
            more["notes"] = list(self.scene.notes)
        if self.robust:
            more["robust"] = {"method": self.robust, "peak_load": self.peak_load}
        if self.alternatives:
            more["alternatives"] = [
                {
                    "landing": other.to_dict()["landing"],
                    "release": other.to_dict()["release"],
                    "effort": None if other.throw is None else other.throw.effort,
                }
                for other in self.alternatives
            ]
        return more

    def save(self, folder: str | Path, draw: Draw = True) -> Plan:
        """Write plan.json and, for a throw, motion.csv and (draw) throw.png, throw.gif.

        draw: "png" draws throw.png alone, False neither. Returns the plan with the time of
        drawing. Raises InputError if the folder cannot be written; then nothing is left behind.
        """
        return save_plan(self, Path(folder), draw)

    def draw(self, file: str | Path | None = None) -> Figure:
        """The picture of the throw, a Matplotlib figure; written to `file` (.png) if that is given.

        InputError for a plan without a throw.
        """
        return draw_plan(self, None if file is None else Path(file))

    def path(self) -> PlanPath:
        """The throw over time: times, poses of the object and the hand, joints.

        InputError for a plan without a throw.
        """
        return path_of(sent_throw(self))

    def summary(self) -> str:
        """The plan in some lines for people: status, errors, moments, solver."""
        result, scene = self.to_dict(), self.scene
        solver, error = result["solver"], result["error"]
        lines = [f"{scene.name}: {self.status}" + (f", {self.message}" if self.solved else "")]
        lines.append(f"  target {self.target.words}")
        for name, off in error.items():
            if off is not None and off["position"] is not None:
                note = ", which decides" if name == result["decides"] else ""
                position, angle = 1e3 * off["position"], math.degrees(off["angle"])
                label = name.replace("_", " ")
                lines.append(f"  {label:14} error {position:8.3f} mm {angle:8.3f} deg{note}")
        if self.warning:
            lines.append(f"  warning: {self.warning}")
        floor = None if scene.workspace is None else scene.workspace.floor
        if floor is not None and self.target.z < floor:
            lines.append(
                f"  note: the target is below the floor of [workspace], z {floor:g} m, which only "
                "arm,\n        hand and held bar keep; the bar may touch it before"
            )
        if self.throw is not None:
            lines.append(f"  {_moments(result['release'])}")
            use = 100 * self.throw.exact.grip_use
            lines.append(f"  grip at most {use:.0f} % of its friction limit before it opens")
        if "torque" in result:
            lines.append(f"  {_torque_words(**result['torque'])}")
        lines.append(
            f"  {solver['name']}, {solver['iterations']} iterations in {solver['attempts']} "
            f"solves, {self.variables} variables, {self.constraints} constraints, "
            f"{result['time']['total']:.2f} s"
        )
        if self.robust:
            lines.append(
                f"  robust by {self.robust}: while they may open, the pads transmit at most "
                f"{100 * (self.peak_load or 0.0):.1f} % of the grip's friction limit"
            )
        for number, other in enumerate(result.get("alternatives", ()), start=1):
            moments = other["release"]
            flight = 1e3 * (moments["landing_time"] - moments["detach_time"])
            lines.append(
                f"  alternative {number}: effort {other['effort']:.2f}, opening at "
                f"{1e3 * moments['opening_time']:.0f} ms, flight {flight:.0f} ms"
            )
        lines += [f"  note: {words}" for words in scene.notes]
        if scene.gripper.raw:
            grip = scene.gripper.profile()
            lines.append(
                f"  grip from the recording: full {grip.full:.4g} N, dwell "
                f"{1e3 * grip.dwell:.1f} ms, opening {1e3 * grip.opening:.1f} ms"
            )
        return "\n".join(lines)

    def error_sent(self) -> tuple[float, float]:
        """(position [m], angle [rad]) error of the landing that counts; NaN without a throw."""
        if self.throw is None:
            return math.nan, math.nan
        error = self._json_error(self.throw.final.landing.pose)
        return error["position"], error["angle"]

    def _json_pose(self, pose: tuple[float, float, float]) -> Any:
        """In-plane (x, z, theta) as JSON, turned to the target's azimuth for an arm."""
        x, z, theta = pose
        if self.scene.robot is None:
            return plain({"x": x, "z": z, "theta": theta})
        x_base, y_base, _ = map(float, self.target.plane.points(x, z))
        return plain({"x": x_base, "y": y_base, "z": z, "theta": theta})

    def _json_error(self, pose: tuple[float, float, float] | None) -> Any:
        if pose is None:
            return None
        angle = 0.0 if self.target.theta is None else abs(pose[2] - self.target.theta)
        position = abs(pose[0] - self.goal.plane_x)
        return plain({"position": position, "angle": angle})

    def json(self) -> str:
        """`to_dict` as a JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)


def _moments(release: dict[str, float | None]) -> str:
    """The release's times for people."""
    return ", ".join(
        f"{words} {value:.3f} s"
        for words, value in zip(MOMENT_WORDS, release.values(), strict=True)
        if value is not None
    )


def _torque_words(use: float, rate: float, rate_limit: float | None) -> str:
    """The joints' torques for people."""
    most = "" if rate_limit is None else f" (recommended: {rate_limit:.0f})"
    return f"joint torques at most {100 * use:.0f} % of their limits, rate {rate:.0f} N m/s{most}"
