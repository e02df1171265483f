"""One-call functions over the planner."""

from __future__ import annotations

from pathlib import Path

from ..problems.load import load_scene
from ..problems.scene import Pose, Scene
from .plan import Plan
from .planner import Planner, SolverName
from .simulate import Simulation
from .simulate import simulate as _simulate
from .starts import Turns


def plan(
    scene: Scene | str | Path,
    target: Pose | None = None,
    *,
    solver: SolverName = "auto",
    turns: Turns = "exact",
) -> Plan:
    """Plan one throw of a scene (or of a built-in name or TOML file).

    To plan many targets of one scene make a `Planner`, which builds its NLP once.
    Raises InputError for wrong input; every other end is the plan's status.
    """
    return Planner(as_scene(scene)).plan(target, solver=solver, turns=turns)


def simulate(scene: Scene | str | Path, model: str = "all") -> dict[str, Simulation]:
    """The scene's given hand motion through a release model or all; by model name."""
    return _simulate(as_scene(scene), model)


def as_scene(scene: Scene | str | Path) -> Scene:
    """A scene as it is, or loaded."""
    return scene if isinstance(scene, Scene) else load_scene(scene)
