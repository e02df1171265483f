"""Fails if the core leaves its memory or the behaviour that C defines, by compiled-in checks."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: Packages beside the core.
PACKAGES = ("models", "problems", "planner", "cli", "cycles", "lab", "pictures", "robots")
CHECKS = ["-O0", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined"]
CHECKS += ["-fno-sanitize-recover=all"]

#: Python that calls the core.
TRIAL = """
import numpy as np, throwplan as tp
from throwplan import robots
from builders import loud
plans = [tp.plan(loud(name), patience=60.0) for name in ("near-cup", "box", "flip", "fr3")]
assert all(plan.status == "solved" for plan in plans)
for model in ("sp", "ls-step", "sp-paper"):
    masses = np.linspace(0.1, 0.4, 257)
    drops = tp.simulate_batch(tp.load_scene("drop"), model, mass=masses)
    assert np.isfinite(drops.detach).all()
    assert tp.simulate("drop", model)[model].to_dict()["status"] == "ok"
    for plan in plans[:2]:
        tp.sweep(plan, 300, model=model)
plans[-1].save(folder)
motion = robots.joint_motion(folder)
seen = robots.Recording(motion.times, motion.q, motion.q, (motion.throw.command_time,))
assert seen.to_dict(motion)["succeeds"]
planner = tp.Planner(loud("pose"))
plan, tick = planner.plan(patience=60.0), 0
session, there = robots.follow(planner, plan), plan.target.changed(x=plan.target.x + 0.06)
while (sent := session.throw.samples) and session.update(
    1e-3 * tick, sent.q[tick], sent.dq[tick], there if tick > 40 else plan.target
).status not in ("committed", "stopped"):
    tick += 5
"""

#: CasADi loads its plugins with RTLD_DEEPBIND, which the address sanitizer refuses.
DLOPEN = """
#define _GNU_SOURCE
#include <dlfcn.h>
void *dlopen(const char *name, int flags)
{
    void *(*next)(const char *, int) = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
    return next(name, flags & ~RTLD_DEEPBIND);
}
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """A folder that holds the package with a core of its own."""
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")
    package = tmp_path_factory.mktemp("sanitized") / "throwplan"
    shutil.copytree(
        ROOT / "core", package / "core", ignore=shutil.ignore_patterns("_core.*", "_binding.py")
    )
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, package)
    for item in [*ROOT.glob("*.py"), *(ROOT / name for name in PACKAGES)]:
        if not (package / item.name).exists():
            (package / item.name).symlink_to(item)
    build = [sys.executable, "setup.py", "--quiet", "build_ext", "--inplace"]
    compiler = os.environ | {"CC": " ".join(["gcc", *CHECKS])}
    subprocess.run(build, cwd=package, env=compiler, check=True)
    command = ["gcc", "-shared", "-fPIC", "-x", "c", "-", "-o", str(package.parent / "dlopen.so")]
    subprocess.run(command, input=DLOPEN, text=True, check=True)
    return package.parent


@pytest.mark.slow
def test_the_core_keeps_to_its_memory_and_to_c(package, tmp_path) -> None:
    command = ["gcc", "-print-file-name=libasan.so"]
    runtime = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    environment = os.environ | {
        "LD_PRELOAD": f"{package / 'dlopen.so'} {runtime}",
        # Python frees little at its end.
        "ASAN_OPTIONS": "detect_leaks=0:verify_asan_link_order=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONPATH": f"{package}{os.pathsep}{ROOT}{os.pathsep}{ROOT / 'tests'}",
    }
    core = str(package / "throwplan" / "core" / "_core.so")
    loaded = f'assert {core!r} in open("/proc/self/maps").read()'
    code = f"folder = {str(tmp_path)!r}\n{TRIAL}\n{loaded}"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:5000]
