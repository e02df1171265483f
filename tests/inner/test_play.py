"""Fails if the throw on the page of `play` does not follow its target, its pads or wrong input."""

from __future__ import annotations

import math
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import pytest
import throwplan as tp
from throwplan.pictures.space import PlayPage, empty_page, first_plan


@contextmanager
def playing(planner: tp.Planner, port: int) -> Any:
    """The page of a planner, and its address."""
    with empty_page("play", port) as (address, server):
        page = PlayPage(server, planner, first_plan(planner))
        yield page, address
        page.end()


@pytest.fixture(scope="module")
def served(planner_of, free_port):
    with playing(planner_of("hand-flip"), free_port()) as found:
        yield found


@pytest.fixture
def page(served: Any) -> PlayPage:
    """The page of `hand-flip` after a plan for its own target."""
    found = served[0]
    found.place[0].value = 1.2
    wait_for(lambda: found.status.content.startswith("**solved**") and found.plan.target.x == 1.2)
    return found


def wait_for(condition: Callable[[], bool]) -> None:
    """Waits until it holds, at most a minute."""
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_the_throw_follows_the_target(page: PlayPage) -> None:
    for i in range(20):
        page.place[0].value = 1.0 + 0.01 * i
    page.theta.value = 260.0
    wait_for(lambda: page.plan.target.x == pytest.approx(1.19))
    assert math.degrees(page.plan.target.theta) == pytest.approx(260.0)
    wait_for(lambda: page.panel.throw.bar[-1, 0, 3] == pytest.approx(1.19, abs=0.01))
    page.theta.value = 270.0


def test_without_a_throw_the_last_stays_pale_beside_the_nearest_landing(page: PlayPage) -> None:
    body = page.panel.view.box
    page.place[0].value = 50.0
    wait_for(lambda: page.status.content.startswith("**not found**"))
    wait_for(lambda: body.opacity is not None and body.opacity < 0.5)
    assert page.plan.target.x < 1.3
    page.place[0].value = 1.2
    wait_for(lambda: body.opacity is None)


def test_planning_goes_on_after_wrong_input(page: PlayPage) -> None:
    page.place[1].value = 0.2
    wait_for(lambda: page.status.content.startswith("**wrong input**: target y: "))
    page.place[1].value, page.place[0].value = 0.0, 1.15
    wait_for(lambda: page.plan.target.x == 1.15)


def test_other_pads_are_planned_with(page: PlayPage) -> None:
    page.friction.value, page.opening.value = 0.9, 40.0
    wait_for(lambda: page.plan.scene.gripper.opening == 0.04)
    assert page.plan.scene.contact.friction == 0.9
    page.friction.value, page.opening.value = 1.0, 50.0


def test_the_page_answers_this_machine_only(served: Any) -> None:
    """A page for all addresses of the machine would answer at each of 127.0.0.0/8."""
    port = int(served[1].rpartition(":")[2])
    with urllib.request.urlopen(f"http://127.0.0.1:{port}") as answer:
        assert answer.status == 200 and answer.read()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"http://127.0.0.2:{port}")
