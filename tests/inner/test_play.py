"""The page of `play`: the target is moved, and the throw follows."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
import throwplan as tp
from browser import browsing, needs_browser
from throwplan.planner.play import PlayPage, first_plan
from throwplan.planner.show import empty_page


@pytest.fixture
def page(free_port):
    """The page of `hand-flip`, and its address."""
    planner = tp.Planner("hand-flip")
    with empty_page("hand-flip", free_port()) as (address, server):
        found = PlayPage(server, planner, first_plan(planner))
        yield found, address
        found.end()


def test_the_throw_follows_the_target(page: Any) -> None:
    found, _ = page
    assert found.strip.content.startswith("**solved**")
    for control, value in ((found.x, 1.1), (found.z, 0.3), (found.theta, 260.0)):
        control.value = value
        found.plans.finish()
    goal = found.plan.target
    assert (goal.x, goal.z, math.degrees(goal.theta)) == pytest.approx((1.1, 0.3, 260.0))
    bar = found.panel.throw.bar[-1, :3, 3]
    assert bar[0] == pytest.approx(1.1, abs=0.01)


def test_only_the_newest_wish_is_planned(page: Any) -> None:
    found, _ = page
    for i in range(20):
        found.x.value = 1.0 + 0.01 * i
    found.plans.finish()
    assert found.plan.target.x == pytest.approx(1.19)


def test_what_does_not_go_is_said_and_the_last_throw_stays(page: Any) -> None:
    found, _ = page
    before = found.panel.throw
    found.x.value = 50.0
    found.plans.finish()
    assert found.strip.content.startswith("**out of reach**: nearest possible")
    assert found.panel.throw is before


def test_other_pads_are_planned_with(page: Any) -> None:
    found, _ = page
    found.friction.value, found.opening.value = 0.9, 40.0
    found.plans.finish()
    assert found.strip.content.startswith("**solved**")
    assert (found.plan.scene.contact.friction, found.plan.scene.gripper.opening) == (0.9, 0.04)


@pytest.mark.slow
@needs_browser
def test_a_number_typed_in_the_browser_moves_the_target(page: Any) -> None:
    found, address = page
    field = "[...document.querySelectorAll('input')].find(i => i.value == '1.2')"
    with browsing(address) as browser:
        end = time.monotonic() + 60
        while not browser.value(f"!!{field}") and time.monotonic() < end:
            time.sleep(0.2)
        browser.value(f"{field}.focus(), {field}.select()")
        browser.type("40")
        said = ""
        while "out of reach" not in said and time.monotonic() < end:
            time.sleep(0.2)
            said = browser.value("document.body.innerText")
    assert "out of reach: nearest possible x" in said
    assert found.x.value == 40.0
