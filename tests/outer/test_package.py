"""The package: what is public, what a scene does not import, the wheel."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import types
import zipfile
from pathlib import Path

import pytest
import throwplan as tp

ROOT = Path(__file__).parent.parent.parent


def test_public_names_are_classes_and_functions() -> None:
    """No module under the name of a function that it holds."""
    names = {
        *("plan", "simulate", "sweep", "simulate_batch", "load_scene", "Planner", "Pose", "Scene"),
        *("Plan", "read_plan", "replay", "reach_map", "identify", "load_throws", "scene_names"),
        *("InputError", "ThrowplanError"),
    }
    assert names <= set(tp.__all__)
    for name in tp.__all__:
        value = getattr(tp, name)
        assert callable(value) and not isinstance(value, types.ModuleType), name
    assert issubclass(tp.InputError, tp.ThrowplanError)


def python(code: str, **options) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, **options
    )
    return done.stdout.strip()


def test_a_hand_scene_imports_neither_ruckig_nor_matplotlib_nor_scipy() -> None:
    code = (
        "import sys, throwplan as tp; assert tp.plan('hand-box').status == 'solved'; "
        "print([m for m in ('ruckig', 'matplotlib', 'scipy', 'PIL') if m in sys.modules])"
    )
    assert python(code) == "[]"


def test_listing_scenes_imports_no_solver() -> None:
    code = (
        "import sys; from throwplan.planner.cli import main; main(['scenes', '--json']); "
        "print([m for m in ('ruckig', 'matplotlib', 'scipy') if m in sys.modules])"
    )
    assert python(code).endswith("[]")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder, copy = tmp_path_factory.mktemp("wheel"), tmp_path_factory.mktemp("source") / "throwplan"
    # The copy keeps the build from writing into the checkout.
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listing.stdout.split():
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(folder)]
    command += ["--no-build-isolation", "--disable-pip-version-check", str(copy)]
    subprocess.run(command, check=True, capture_output=True)
    return next(folder.glob("*.whl"))


@pytest.mark.slow
def test_wheel_holds_the_package_and_its_data(wheel) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for name in ("py.typed", "__main__.py", "problems/scenes/cup.toml", "problems/arms/panda.toml"):
        assert f"throwplan/{name}" in names
    assert not [n for n in names if n.startswith(("tests", "throwplan/tests", "models", "planner"))]
    assert "throwplan/setup.py" not in names
    # Every module of the rooms, none forgotten in pyproject's list of packages.
    for layer in ("core", "models", "problems", "planner"):
        for path in (ROOT / layer).rglob("*.py"):
            assert f"throwplan/{path.relative_to(ROOT)}" in names


@pytest.mark.slow
def test_wheel_works_when_installed_elsewhere(wheel, tmp_path) -> None:
    site = tmp_path / "site"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    command += ["--disable-pip-version-check", "--target", str(site), str(wheel)]
    subprocess.run(command, check=True, capture_output=True)
    environment = os.environ | {"PYTHONPATH": str(site)}
    where = python("import throwplan; print(throwplan.__file__)", env=environment, cwd=tmp_path)
    assert where.startswith(str(site))
    done = subprocess.run(
        [sys.executable, "-m", "throwplan", "plan", "hand-box", "--json", "--out", "here"],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        cwd=tmp_path,
    )
    assert json.loads(done.stdout)["status"] == "solved"
    files = {path.name for path in (tmp_path / "here").iterdir()}
    assert files == {"plan.json", "motion.csv", "throw.png", "throw.gif"}
