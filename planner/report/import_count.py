"""What a fresh process imports to plan one scene."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import time
from dataclasses import dataclass

from ...problems import Scene

#: Libraries that take long to import, by the name of their module.
HEAVY = ("numpy", "casadi", "scipy", "ruckig", "matplotlib", "PIL", "distributed")
#: Longest such process [s].
PATIENCE = 300.0

_PLAN = """
import pickle, sys
before = set(sys.modules)
import throwplan as tp
scene, robust = pickle.load(sys.stdin.buffer)
plan = tp.Planner(scene, compiling="no").plan(robust=robust)
import json
print(json.dumps([plan.status, sorted(set(sys.modules) - before)]))
"""


@dataclass(frozen=True)
class Imports:
    """What planning a scene imported beyond Python's own start.

    modules: how many; heavy: which of HEAVY; seconds: the whole process; status: the plan's.
    """

    modules: int
    heavy: tuple[str, ...]
    seconds: float
    status: str


def imports_of(scene: Scene, robust: str | None = None) -> Imports:
    """Plans `scene` in a process of its own, nothing compiled, and looks at its modules."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", _PLAN],
        input=pickle.dumps((scene, robust)),
        capture_output=True,
        check=True,
        timeout=PATIENCE,
        env=os.environ | {"THROWPLAN_COMPILE": "0"},
    )
    seconds = time.perf_counter() - start
    status, modules = json.loads(done.stdout)
    heavy = tuple(name for name in HEAVY if name in modules)
    return Imports(len(modules), heavy, seconds, status)
