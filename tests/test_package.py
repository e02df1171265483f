"""The package: import directions, what a scene does not import, the wheel elsewhere."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LAYERS = ("models", "problems", "planner")


@pytest.mark.parametrize("layer", LAYERS)
def test_imports_point_one_way(layer: str) -> None:
    """models import nothing of ours, problems only models; planner both."""
    allowed = LAYERS[: LAYERS.index(layer) + 1]
    for path in (ROOT / layer).glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == 2:
                assert node.module is not None
                assert node.module.split(".")[0] in allowed, f"{path}: {node.module}"
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [alias.name for alias in node.names]
                module = getattr(node, "module", None) or ""
                assert not any(name.startswith("throwplan") for name in [*names, module]), path


def test_models_know_no_files_and_no_solvers() -> None:
    for path in (ROOT / "models").glob("*.py"):
        text = path.read_text()
        assert "nlpsol" not in text and "open(" not in text and "tomllib" not in text


def run_python(code: str, **options) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, **options
    )
    return done.stdout


def test_a_hand_scene_imports_neither_ruckig_nor_matplotlib_nor_scipy() -> None:
    code = (
        "import sys, throwplan as tp; assert tp.plan('hand-box').solved; "
        "print([m for m in ('ruckig', 'matplotlib', 'scipy', 'PIL') if m in sys.modules])"
    )
    assert run_python(code).strip() == "[]"


def test_listing_scenes_imports_no_solver() -> None:
    code = (
        "import sys; from throwplan.planner.cli import main; main(['scenes', '--json']); "
        "print([m for m in ('ruckig', 'matplotlib', 'scipy') if m in sys.modules])"
    )
    assert run_python(code).strip().endswith("[]")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--disable-pip-version-check", "-w", str(folder)]
    # The copy keeps the build from writing into the checkout.
    copy = tmp_path_factory.mktemp("source") / "throwplan"
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in listing.stdout.split():
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((ROOT / name).read_bytes())
    subprocess.run([*command, str(copy)], check=True, capture_output=True)
    return next(folder.glob("*.whl"))


def test_wheel_holds_the_package_and_its_data(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for name in ("py.typed", "__main__.py", "problems/scenes/cup.toml", "problems/arms/panda.toml"):
        assert f"throwplan/{name}" in names
    assert not [n for n in names if n.startswith(("tests", "throwplan/tests", "models", "planner"))]


def test_wheel_works_when_installed_elsewhere(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    subprocess.run(
        [*command, "--disable-pip-version-check", "--target", str(site), str(wheel)],
        check=True,
        capture_output=True,
    )
    environment = os.environ | {"PYTHONPATH": str(site)}
    where = run_python("import throwplan; print(throwplan.__file__)", env=environment, cwd=tmp_path)
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
