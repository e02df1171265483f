"""The page of `play`: the target is moved, and the throw follows."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path
from typing import Any

import pytest
import throwplan as tp
from browser import browsing, needs_browser
from throwplan.planner.play import PlayPage, first_plan, sweep_delays
from throwplan.planner.show import empty_page


@pytest.fixture(scope="module")
def served(free_port):
    """The page of `hand-flip`, and its address."""
    planner = tp.Planner("hand-flip")
    with empty_page("hand-flip", free_port()) as (address, server):
        found = PlayPage(server, planner, first_plan(planner))
        controls = [*found.place, found.theta, found.friction, found.opening, found.robust]
        yield found, address, [(control, control.value) for control in controls]
        found.end()


@pytest.fixture
def page(served: Any):
    """The same as it was at first."""
    found, address, values = served
    for control, value in values:
        control.value = value
    found.plans.finish()
    return found, address


def test_the_throw_follows_the_target(page: Any) -> None:
    found, _ = page
    assert found.strip.content.startswith("**solved**")
    x, _, z = found.place
    for control, value in ((x, 1.1), (z, 0.3), (found.theta, 260.0)):
        control.value = value
    found.plans.finish()
    goal = found.plan.target
    assert (goal.x, goal.z, math.degrees(goal.theta)) == pytest.approx((1.1, 0.3, 260.0))
    bar = found.panel.throw.bar[-1, :3, 3]
    assert bar[0] == pytest.approx(1.1, abs=0.01)


def test_only_the_newest_wish_is_planned(page: Any) -> None:
    found, _ = page
    for i in range(20):
        found.place[0].value = 1.0 + 0.01 * i
    found.plans.finish()
    assert found.plan.target.x == pytest.approx(1.19)


def test_what_does_not_go_is_said_and_the_last_throw_stays(page: Any) -> None:
    found, _ = page
    before = found.panel.throw
    found.place[0].value = 50.0
    found.plans.finish()
    words = re.match(r"\*\*out of reach\*\*: nearest possible x ([\d.]+) m", found.strip.content)
    assert found.panel.throw is before
    # The floor shows that too.
    found.maps.finish()
    low, high, margin = found.reach.T
    assert high[-1] == pytest.approx(float(words[1]), abs=0.01)
    assert low[0] < 1.2 and (low[1:] == high[:-1]).all() and margin.max() > 0.1


def test_wrong_wishes_are_refused_and_planning_goes_on(page: Any) -> None:
    found, _ = page
    found.place[1].value = 0.2
    assert found.strip.content == "**wrong input**: target y: only for a scene with [robot]"
    found.place[1].value, found.place[0].value = 0.0, 1.15
    found.plans.finish()
    assert found.plan.target.x == 1.15
    found.folder.value = ""
    with pytest.raises(tp.InputError, match="folder: is empty"):
        found.save()


def test_other_pads_are_planned_with(page: Any) -> None:
    found, _ = page
    found.friction.value, found.opening.value = 0.9, 40.0
    found.plans.finish()
    assert found.strip.content.startswith("**solved**")
    assert (found.plan.scene.contact.friction, found.plan.scene.gripper.opening) == (0.9, 0.04)


def test_the_plan_is_thrown_and_thrown_off_time(page: Any) -> None:
    found, _ = page
    shares = []
    for delay in (0.5, 30.0):
        found.delay.value = delay
        good, throws = map(int, re.match(r"(\d+) of (\d+) throws", found.throw_delayed()).groups())
        shares.append(good / throws)
    assert shares[0] > 2 * shares[1]
    found.panel.play(False)
    found.throw()
    assert found.panel.playing and found.panel.time == 0.0


@pytest.mark.slow
def test_a_plan_against_delays_bears_more_of_them(page: Any) -> None:
    found, _ = page
    found.delay.value = 4.0
    before = sweep_delays(found.plan, 0.004).success.mean()
    found.robust.value = True
    found.plans.finish()
    assert found.plan.robust and found.plan.scene.uncertainty.delay.uniform == 0.004
    assert sweep_delays(found.plan, 0.004).success.mean() > before


@pytest.mark.slow
@needs_browser
def test_the_browser_moves_the_target_and_saves_the_plan(page: Any, tmp_path: Path) -> None:
    found, address = page
    found.folder.value = str(tmp_path / "mine")
    field = "[...document.querySelectorAll('input')].find(i => i.value == '1.2')"
    button = "[...document.querySelectorAll('button')].find(b => b.innerText == 'save the plan')"
    with browsing(address) as browser:
        said(browser, "solved: landing error", field)
        browser.value(f"{field}.focus(), {field}.select()")
        browser.type("40")
        said(browser, "out of reach: nearest possible x")
        browser.value(f"{button}.click()")
        said(browser, f"written to {tmp_path / 'mine'}")
    assert found.place[0].value == 40.0
    assert tp.read_plan(tmp_path / "mine").opening_time == found.panel.throw.throw.opening_time


def said(browser: Any, words: str, there: str = "true") -> None:
    """Waits until the page says that, and something is there."""
    end = time.monotonic() + 60
    while not browser.value(f"document.body.innerText.includes('{words}') && !!{there}"):
        assert time.monotonic() < end, browser.value("document.body.innerText")
        time.sleep(0.2)


def test_a_region_is_moved_as_a_pose(free_port: Any) -> None:
    scene = tp.load_scene("hand-box")
    wide = tp.Region(x=(1.1, 1.3), z=scene.target.z)
    planner = tp.Planner(scene.replace(target=wide))
    with empty_page("hand-box", free_port()) as (_, server):
        found = PlayPage(server, planner, first_plan(planner))
        found.place[0].value = 1.1
        found.plans.finish()
        assert found.strip.content.startswith("**solved**")
        assert found.plan.target.table["x"] == [1.0, 1.2]
        assert found.plan.throw.deciding.miss()[0] == pytest.approx(0.0, abs=1e-4)
        found.end()
