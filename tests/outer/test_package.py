"""Fails if the wheel lacks a file, a command imports what it does not need, or hides an extra."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from throwplan import pictures

ROOT = Path(__file__).parent.parent.parent
#: Packages beside the core.
PACKAGES = ("models", "problems", "planner", "cli", "cycles", "lab", "pictures", "robots")


def test_a_plan_has_its_path_and_picture(plan_of, saved, table, tmp_path) -> None:
    plan = plan_of("pose")
    path, release = plan.path(), plan.to_dict()["release"]
    landed = np.interp(release["landing_time"], path.times, path.poses[:, 0])
    assert landed == pytest.approx(plan.to_dict()["landing"]["sent"]["x"], abs=2e-3)
    assert path.times[-1] == pytest.approx(release["landing_time"], abs=1e-3)
    assert path.poses.shape == path.hand.shape == (len(path.times), 3)
    motion = table(saved("pose") / "motion.csv")
    q = np.column_stack([motion[f"q{j}"] for j in range(1, 8)])
    both = min(len(q), len(path.times))
    np.testing.assert_allclose(path.joints[:both], q[:both], atol=1e-9)
    pictures.draw(plan, tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 1000


def python(code: str, **options) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, **options
    )
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["plan", "hand-box"], ("ruckig", "matplotlib", "scipy", "mujoco", "viser", "PIL")),
        (["scenes"], ("ruckig", "matplotlib", "scipy")),
    ],
)
def test_a_command_imports_only_what_it_needs(words, names) -> None:
    code = f"import sys; from throwplan.cli import main; assert not main({words} + ['--json'])"
    assert python(f"{code}; print([m for m in {names} if m in sys.modules])").endswith("[]")


@pytest.mark.parametrize(
    ("module", "line", "package"),
    [
        ("mujoco", "replay {plan}", "mujoco-core"),
        ("rosbags.typesys", "export {plan} --ros {new}", "rosbags"),
        ("pylibfranka", "run --yes {plan} --robot 127.0.0.1", "pylibfranka"),
        ("viser", "view {plan} --no-browser", "viser"),
        ("yourdfpy", "import-robot {plan}/plan.json --out {new}.toml", "yourdfpy"),
    ],
)
def test_an_extra_that_is_not_there_is_named(
    module, line, package, saved, tmp_path, refused, monkeypatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    said = refused(line.format(plan=saved("fr3"), new=tmp_path / "new"))
    assert f"pip install {package}" in said and not list(tmp_path.iterdir())


def run(*command: object, cwd: Path = ROOT) -> str:
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """A copy, which keeps builds from writing into the checkout."""
    copy = tmp_path_factory.mktemp("source") / "throwplan"
    for name in run("git", "ls-files", "--cached", "--others", "--exclude-standard").split():
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((ROOT / name).read_bytes())
    return copy


@pytest.fixture(scope="module")
def wheel(source, tmp_path_factory) -> Path:
    """By way of the source distribution, which must have all that a wheel is built from."""
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "setup.py", "--quiet", "sdist", "--dist-dir", folder, cwd=source)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder]
    run(*command, "--no-build-isolation", "--disable-pip-version-check", *folder.glob("*.gz"))
    return next(folder.glob("*.whl"))


def system_of(library: bytes) -> tuple[str, int]:
    """Format of a shared library, and the number of its processor there."""
    if library[:4] == b"\x7fELF":
        return "ELF", int.from_bytes(library[18:20], "little")
    assert library[:4] == b"\xcf\xfa\xed\xfe"
    return "Mach-O", int.from_bytes(library[4:8], "little")


@pytest.mark.slow
def test_release_has_a_core_for_each_platform(source, tmp_path) -> None:
    """Without zig, which compiles for all of them, there is none. For Windows zig first builds the
    system's own libraries, which takes a minute: its wheel is left to `make wheels`."""
    pytest.importorskip("ziglang")
    tools = Path(sys.executable).parent
    kinds = {
        "manylinux_2_28_x86_64": ("_core.so", "ELF", 62),
        "manylinux_2_28_aarch64": ("_core.so", "ELF", 183),
        "macosx_11_0_arm64": ("_core.dylib", "Mach-O", 0x0100000C),
    }
    order = ("make", "-o", ".venv/wheels", "wheels", f"PLATFORMS={' '.join(kinds)}")
    told = run(*order, f"BIN={tools}", f"DIST={tmp_path}", cwd=source)
    # What auditwheel finds that they need of glibc.
    needed = [int(minor) for minor in re.findall(r'"manylinux_2_(\d+)_\w+"\.', told)]
    assert len(needed) >= 2 and max(needed) <= 28
    sources = (path.read_bytes() for path in sorted((source / "core").glob("*.[ch]")))
    hashed = hashlib.sha256(b"".join(sources)).hexdigest()
    for platform, (name, *kind) in kinds.items():
        with zipfile.ZipFile(next(tmp_path.glob(f"throwplan-*-py3-none-{platform}.whl"))) as wheel:
            cores = [n for n in wheel.namelist() if "/_core." in n]
            assert cores == [f"throwplan/core/{name}"]
            library = wheel.read(cores[0])
        assert [*system_of(library)] == kind and hashed.encode() in library
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        kept = {name.partition("/")[2] for name in files.getnames()}
    assert {
        str(path.relative_to(source))
        for path in source.rglob("*")
        if path.is_file() and not str(path.relative_to(source)).startswith((".", "build"))
    } <= kept


@pytest.mark.slow
def test_wheel_holds_the_package_and_its_data(wheel) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for name in ("py.typed", "__main__.py", "problems/scenes/cup.toml", "problems/arms/panda.toml"):
        assert f"throwplan/{name}" in names
    assert {name.split("/")[0].partition("-")[0] for name in names} == {"throwplan"}
    assert not [
        n
        for n in names
        if n.startswith(("throwplan/tests", "throwplan/benchmarks", "throwplan/oracle"))
    ]
    assert "throwplan/setup.py" not in names
    for layer in ("core", *PACKAGES):
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
