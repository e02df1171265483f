"""Kernels and machine code: the usual answers, and the same ones where there is no compiler."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest
import throwplan as tp

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler here"
)


def test_unknown_way_of_compiling() -> None:
    with pytest.raises(tp.InputError, match="compiling = 'perhaps': must be one of no, cached"):
        tp.Planner(tp.load_scene("hand-box"), compiling="perhaps")


# Compiled, in a process and with a cache folder of its own.

PLANS = """
import json, time, sys, throwplan as tp
scene, found = tp.load_scene("hand-box"), []
for compiling in sys.argv[2:]:
    planner = tp.Planner(scene, compiling=compiling)
    answer = planner.plan().to_dict()
    until = time.monotonic() + 300
    while compiling == "background" and not planner.compiled and time.monotonic() < until:
        time.sleep(0.2)
        answer = planner.plan().to_dict()
    found.append([compiling, planner.compiled, answer["status"], answer["landing"]["exact"]["x"]])
print(json.dumps(found))
"""


@needs_compiler
@pytest.mark.slow
def test_the_background_compiles_for_this_planner_and_the_next(tmp_path) -> None:
    environment = os.environ | {"THROWPLAN_CACHE": str(tmp_path), "THROWPLAN_COMPILE": "1"}
    command = [sys.executable, "-c", PLANS, str(tmp_path), "no", "background", "cached"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    (_, none, *one), (_, later, *two), (_, at_once, *three) = json.loads(done.stdout)
    assert (none, later, at_once) == (False, True, True)
    for status, x in (one, two, three):
        assert status == "solved" and x == pytest.approx(one[1], abs=1e-6)
