"""`[contact] shape` through the command line: simulated, planned, swept, identified, refused."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
import throwplan as tp
from builders import MADE_PRODUCT, MADE_THROWS

#: Lines of [contact] for each shape.
LINES = {
    "ellipsoid": 'shape = "ellipsoid"\ncoefficients = [1.0, 1.2, 1.1, 0.1, 0.3, -0.2]',
    "quartic": 'shape = "quartic"\ncoefficients = '
    "[1.2, 0, 0, 2, 0, 2.5, 0, 0, 0, 0.1, 1, 0.2, 2, 0, 1]",
    "two-points": 'shape = "two-points"',
}
#: The quartic is the general one; `make test` takes it alone.
SHAPES = ["quartic", *(pytest.param(s, marks=pytest.mark.slow) for s in LINES if s != "quartic")]


def written(folder: Path, scene: str, lines: str) -> Path:
    """A built-in scene with more lines in [contact], as a file."""
    text = (Path(tp.__file__).parent / "problems" / "scenes" / f"{scene}.toml").read_text()
    path = folder / "mine.toml"
    path.write_text(text.replace("[contact]\n", f"[contact]\n{lines}\n"))
    return path


def test_two_points_are_simulated_as_the_patch_of_two_points(tmp_path, run) -> None:
    path = written(tmp_path, "drop", LINES["two-points"])
    found = run("simulate", path, "--json").json["models"]
    turns = {name: found[name]["detach"]["omega"] for name in ("ls-step", "patch", "sp")}
    assert turns["ls-step"] == pytest.approx(turns["patch"], abs=5e-4)
    assert turns["sp"] == pytest.approx(-1.035, abs=0.02)  # it does not know the shape
    assert turns["ls-step"] == pytest.approx(-1.0786, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("shape", LINES)
def test_each_shape_is_thrown_and_swept(shape, tmp_path, run) -> None:
    path = written(tmp_path, "pose", LINES[shape])
    plan = run("plan", path, "--json", "--out", tmp_path / "out").json
    assert plan["status"] == "solved"
    error = plan["error"]["limit_surface"]
    assert error["position"] < 2e-4 and error["angle"] < 1e-3
    kept = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert f"'shape': '{shape}'" in str(kept)
    swept = run("sweep", path, "--samples", "64", "--json").json
    assert swept["model"] == "ls-step" and swept["held"]["rate"] == 1.0
    assert swept["nominal"]["x"] == pytest.approx(plan["target"]["x"], abs=2e-4)


@pytest.mark.parametrize("shape", SHAPES)
def test_each_shape_is_identified(shape, tmp_path, run) -> None:
    """Throws by the shape are fitted by the shape: the product of friction and radius is found."""
    folder = Path(shutil.copytree(MADE_THROWS, tmp_path / "made"))
    head, table = folder / "dataset.toml", folder / "throws.csv"
    head.write_text(f"{LINES[shape]}\n{head.read_text()}")
    rows = list(csv.DictReader(table.read_text().splitlines()))[::10]
    data = tp.load_throws(folder).picked(list(range(0, 90, 10)))
    landings = tp.thrown(data, "ls-step", {"friction": 0.8, "patch_radius": 0.0031})
    lines = [",".join(rows[0])]
    for row, (x, theta) in zip(rows, landings.tolist(), strict=True):
        lines.append(",".join((row | {"x": f"{x}", "theta": f"{theta}"}).values()))
    table.write_text("\n".join(lines))
    (found,) = json.loads(run("identify", folder, "--json", "--out", tmp_path / "fit").out)
    assert found["fit"]["product"]["value"] == pytest.approx(MADE_PRODUCT, rel=0.02)
    assert f'shape = "{shape}"' in (tmp_path / "fit" / "contact.toml").read_text()


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('shape = "round"', "must be one of ellipsoid, quartic, two-points"),
        ('shape = "quartic"', "quartic takes 15 numbers, not 0"),
        ("coefficients = [1.0]", "only with shape"),
        ('shape = "ellipsoid"\ncoefficients = [1, 1, 1, 2, 0, 0]', "the surface is not"),
        ('shape = "ellipsoid"\ncoefficients = [1, 1, 1, inf, 0, 0]', "finite"),
    ],
)
def test_a_shape_that_is_none_is_refused_in_one_line(lines, words, tmp_path, refused) -> None:
    line = refused("plan", written(tmp_path, "pose", lines))
    assert words in line and "[contact]" in line
