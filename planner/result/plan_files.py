"""Plans as files: writing and reading plan.json and motion.csv."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...models import Array, ReadOnly
from ...models.robot import PlanarArm
from ...problems import InputError, Scene
from ...problems.files import read_csv, read_json
from ...problems.scene_files import scene_from_table
from ..throw import TICK, Manipulator, Samples, Throw, make_manipulator
from .over_time import timeline

Status = Literal["solved", "not_found"]
#: Version of plan.json; `read_plan` refuses other versions.
FORMAT = 1
#: Columns of a free hand's motion.csv: poses, velocities, accelerations.
HAND_COLUMNS = (("x", "z", "theta"), ("vx", "vz", "omega"), ("ax", "az", "alpha"))
#: Files of a plan's folder; the pictures of an earlier plan go.
FILES = ("motion.csv", "plan.json", "throw.png", "throw.gif")
#: Folder in it, of the throw that lands nearest to a target to which none was found.
NEAREST = "nearest"


def joint_samples(
    kinematics: PlanarArm, azimuth: float, samples: Samples
) -> tuple[Array, Array, Array]:
    """q, dq, ddq of all joints of the arm, each (N, joints), in the plane at `azimuth` [rad]."""
    q = kinematics.all_joints(samples.q, azimuth)
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    throwing = [joint - 1 for joint in kinematics.throwing_joints]
    dq[:, throwing], ddq[:, throwing] = samples.dq, samples.ddq
    return q, dq, ddq


@dataclass(frozen=True, repr=False, eq=False)
class SavedThrow(Throw):
    """A throw read from files; status, message, robust: of its plan.json."""

    status: Status = "solved"
    message: str = ""
    robust: bool = False


@dataclass(frozen=True, repr=False, eq=False)
class PlanPath(ReadOnly):
    """A throw over time, from rest until the object lands; with [rest] until it rests.

    times (N,) [s], every millisecond; poses (N, 3): x, z [m], theta [rad] of the object's CoM in
    the throw's vertical plane; hand (N, 3): of the pads' centre; joints (N, joints) [rad]: of an
    arm, None for a free hand. The arm rests after its motion.
    """

    times: Array
    poses: Array
    hand: Array
    joints: Array | None


def path_of(throw: Throw) -> PlanPath:
    """The throw every millisecond."""
    line, kinematics = timeline(throw), throw.manipulator.kinematics
    joints = None
    if isinstance(kinematics, PlanarArm):
        moving = throw.path.at(line.times).pose.T
        joints = kinematics.all_joints(moving, throw.target.plane.azimuth)
    return PlanPath(line.times, line.com.T, line.hand.T, joints)


def read_plan(path: str | Path) -> SavedThrow:
    """The throw of a plan.json (or its folder) and its motion.csv, simulated again.

    Constraints of one's own are not in the file: the message says that they are not checked again.
    InputError for a missing file, a file that is no plan, another version, a plan without a throw,
    one that a release law of one's own throws, and samples that do not fit its scene.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "plan.json"
    plan = _plan_object(path)
    own = plan.get("own", {})
    if law := own.get("release"):
        cure = "which is not in the file: use the plan in Python, or plan it again there"
        raise InputError(f"{path}: is thrown by the release law {law}, {cure}")
    with complete(path, "is not a complete plan file"):
        scene = scene_from_table(plan["definition"])
        opening_time = float(plan["release"]["opening_time"])
    manipulator = make_manipulator(scene)
    samples = read_samples(path.parent / "motion.csv", _columns(manipulator))
    end = float(samples.times[-1])
    if not 0.0 <= opening_time <= end:
        raise InputError(f"{path}: opening_time = {opening_time:g}: must be within motion.csv")
    words: dict[str, Any] = {key: str(plan.get(key, "")) for key in ("status", "message")}
    if own.get("constraints"):
        words["message"] += f"; not checked again: {', '.join(map(str, own['constraints']))}"
    words["robust"] = bool(plan.get("robust"))
    throw = SavedThrow(scene, manipulator, samples.path, opening_time, samples, **words)
    if not throw.lands:
        raise InputError(f"{path}: its throw never falls to the target's height")
    if scene.target is None or scene.target.velocity is None:
        return throw
    return dataclasses.replace(throw, scene=scene.aimed_at(scene.target.at(throw.landing_time)))


def check_hits(path: str | Path, option: str = "--nearest") -> None:
    """InputError for the plan.json (or its folder) of a throw that lands beside its target, which
    `option` takes all the same."""
    path = Path(path)
    file = path / "plan.json" if path.is_dir() else path
    found = read_json(file) if file.is_file() else None
    if isinstance(found, dict) and found.get("short_of") is not None:
        raise InputError(
            f"{file}: this throw lands beside its target, as near as one was found; "
            f"{option} takes it all the same"
        )


def entries_of(plan: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """plan.json of a plan's `to_dict`, with the scene that `read_plan` needs."""
    own: dict[str, Any] = {}
    if scene.release is not None:
        own["release"] = scene.release.__name__
    if scene.constraints:
        own["constraints"] = [one.name for one in scene.constraints]
    return {"format": FORMAT, **plan, **({"own": own} if own else {}), "definition": scene.table()}


@contextmanager
def complete(path: Path, words: str) -> Iterator[None]:
    """InputError, naming the path, in these words for what the block misses in a file."""
    try:
        yield
    except InputError as error:
        raise error.within(str(path)) from None
    except KeyError as error:
        raise InputError(f"{path}: {words}: no {error}") from None
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: {words} ({error})") from None


def _json_plan(path: Path) -> dict[str, Any]:
    """The JSON object of a plan of any version and status."""
    plan = read_json(path)
    if not isinstance(plan, dict) or "status" not in plan:
        raise InputError(f"{path}: is not a plan file")
    return plan


def _plan_object(path: Path) -> dict[str, Any]:
    """The JSON object of a solved plan of this version."""
    plan = _json_plan(path)
    version = plan.get("format")
    if version != FORMAT:
        description = "an older version" if version is None else f"version {version!r}"
        raise InputError(f"{path}: a plan file of {description}, must be {FORMAT}: plan it again")
    if plan["status"] != "solved":
        raise InputError(f"{path}: the plan is {plan['status']}: it holds no throw")
    return plan


def _columns(manipulator: Manipulator) -> list[str]:
    """The columns of motion.csv with the planned coordinates, their rates and accelerations."""
    kinematics = manipulator.kinematics
    if isinstance(kinematics, PlanarArm):
        joints = kinematics.throwing_joints
        return [f"{prefix}{j}" for prefix in ("q", "dq", "ddq") for j in joints]
    return [name for row in HAND_COLUMNS for name in row[: manipulator.size]]


def read_samples(path: Path, names: Sequence[str]) -> Samples:
    """Columns of a motion.csv: coordinates, then their rates, then their accelerations."""
    rows = read_csv("motion", str(path), None, ("t", *names))
    if len(rows) < 2 or np.abs(rows[:, 0] - TICK * np.arange(len(rows))).max() > 1e-6:
        raise InputError(f"{path}: t must go from 0 in steps of {TICK:g}")
    return Samples(*np.split(rows[:, 1:], 3, axis=1))
