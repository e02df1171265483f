"""Variants of the release models by name: what they are, and that `all` leaves them out."""

from __future__ import annotations

import json

import pytest
import throwplan as tp
from throwplan.planner.check.simulate import MODELS, VARIANTS
from throwplan.planner.cli import main


@pytest.fixture(scope="module")
def rates() -> dict[str, float]:
    """omega at detach of the drop by every model and variant."""
    scene = tp.load_scene("drop")
    found = {name: tp.simulate(scene, name)[name] for name in (*MODELS, *VARIANTS)}
    return {name: float(one.release.com_twist[2, -1]) for name, one in found.items()}


def test_variants_are_asked_for_by_name(capsys) -> None:
    assert main(["simulate", "drop-2cm", "--model", "ls-step-quartic", "--json"]) == 0
    models = json.loads(capsys.readouterr().out)["models"]
    assert list(models) == ["ls-step-quartic"] and models["ls-step-quartic"]["status"] == "ok"
    assert main(["simulate", "drop-2cm", "--model", "ls-step-rotated"]) == 0
    header, row = capsys.readouterr().out.splitlines()[1:3]
    assert len(header) == len(row) and row.split()[0] == "ls-step-rotated"


def test_all_leaves_them_out() -> None:
    assert set(tp.simulate("drop-2cm")) == set(MODELS)
    assert not set(MODELS) & set(VARIANTS)


def test_an_unknown_name_lists_them_and_help_mentions_them(capsys) -> None:
    assert main(["simulate", "drop", "--model", "ls-step-quartc"]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "did you mean 'ls-step-quartic'?" in line
    assert all(name in line for name in (*MODELS, *VARIANTS))
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    assert "ils-radau" in capsys.readouterr().out


def test_other_integrators_and_norms_agree_with_the_plain_model(rates) -> None:
    assert rates["ils-radau"] == pytest.approx(rates["ils"], rel=1e-5)
    assert rates["ils-bdf"] == pytest.approx(rates["ils"], rel=1e-5)
    assert rates["ils-consistent"] == pytest.approx(rates["ils"], rel=5e-3)
    assert rates["sp-euler"] == pytest.approx(rates["sp"], rel=1e-3)
    assert rates["sp-paper-euler"] == pytest.approx(rates["sp-paper"], rel=1e-3)
    assert rates["patch-hertz"] == pytest.approx(rates["patch"], rel=2e-3)


def test_other_surfaces_agree_between_stepping_and_the_smoothed_law(rates) -> None:
    for shape in ("rotated", "quartic"):
        assert rates[f"ls-step-{shape}"] == pytest.approx(rates[f"ils-{shape}"], rel=0.02)
        assert abs(rates[f"ls-step-{shape}"] / rates["ls-step"] - 1) > 2e-3


def test_softer_bristles_let_the_bar_turn_further(rates) -> None:
    assert rates["lugre-1e5"] < rates["lugre-1e6"] < rates["lugre"] < rates["patch"]
