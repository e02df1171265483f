"""The page of `play`: the target is moved, and the throw follows."""

from __future__ import annotations

import gc
import math
import random
import re
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import throwplan as tp
from browser import browsing, needs_browser
from page_client import (
    BROKEN,
    CAMERA,
    answer,
    connected,
    controls,
    odd_message,
    packed,
    replay,
    send,
    update,
)
from throwplan.planner.play import PlayPage, first_plan, sweep_delays
from throwplan.planner.show import empty_page, run_panel


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


def test_a_target_out_of_reach_is_said_at_the_start(free_port) -> None:
    scene = tp.load_scene("hand-flip")
    planner = tp.Planner(scene.aimed_at(scene.target.in_plane(5.0, scene.target.theta)))
    with empty_page("hand-flip", free_port()) as (_, server):
        found = PlayPage(server, planner, first_plan(planner))
        assert found.strip.content.startswith("**the scene's target is out of reach**; shown is")
        assert found.plan.solved and found.plan.target.x < 5.0 == found.place[0].value
        found.end()


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


def test_what_does_not_go_is_said_and_the_last_throw_stays_pale(page: Any) -> None:
    found, _ = page
    before, body = found.panel.throw, found.panel.view.box
    assert body.opacity is None
    found.place[0].value = 50.0
    found.plans.finish()
    words = re.match(r"\*\*out of reach\*\*: nearest possible x ([\d.]+) m", found.strip.content)
    assert found.panel.throw is before and body.opacity < 0.5
    # The floor shows that too.
    found.maps.finish()
    low, high, margin = found.reach.T
    assert high[-1] == pytest.approx(float(words[1]), abs=0.01)
    assert low[0] < 1.2 and (low[1:] == high[:-1]).all() and margin.max() > 0.1
    found.place[0].value = 1.2
    found.plans.finish()
    assert body.opacity is None


def test_wrong_wishes_are_refused_and_planning_goes_on(page: Any) -> None:
    found, _ = page
    found.place[1].value = 0.2
    assert found.strip.content == "**wrong input**: target y: only for a scene with [robot]"
    found.place[1].value, found.place[0].value = 0.0, 1.15
    found.plans.finish()
    assert found.plan.target.x == 1.15


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
def test_the_browser_moves_the_target_and_saves_the_plan(
    page: Any, tmp_path: Path, monkeypatch, capfd
) -> None:
    found, address = page
    monkeypatch.chdir(tmp_path)
    found.folder.value = "mine"
    field = "[...document.querySelectorAll('input')].find(i => i.value == '1.2')"
    button = "[...document.querySelectorAll('button')].find(b => b.innerText == 'save the plan')"
    with browsing(address) as browser:
        said(browser, "solved: landing error", field)
        browser.value(f"{field}.focus(), {field}.select()")
        browser.type("40")
        said(browser, "out of reach: nearest possible x")
        browser.value(f"{button}.click()")
        said(browser, f"written to {tmp_path / 'mine'}")
        # A plan may replace a plan; the browser sends nothing that the page refuses.
        browser.value(f"{button}.click()")
        said(browser, "working...")
        said(browser, f"written to {tmp_path / 'mine'}")
    assert capfd.readouterr().err == ""
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


@pytest.mark.parametrize("upgrade", [False, True])
def test_only_the_page_itself_may_ask(page: Any, upgrade: bool, capfd: Any) -> None:
    """A foreign page names itself as the origin, or has made this machine's address its own."""
    _, address = page
    port = address.rpartition(":")[2]
    taken = ("127.0.0.1", f"127.0.0.1:{port}", f"LOCALHOST:{port}", "localhost:9000")
    for host in taken:
        for origin in ({}, {"Origin": f"http://{host}"}):
            assert answer(address, {"Host": host} | origin, upgrade) == (101 if upgrade else 200)
    assert capfd.readouterr().err == ""
    own = f"http://127.0.0.1:{port}"
    foreign = ("http://evil.example", "http://localhost:3000", own + ".evil.example", "null", "")
    headers = [{"Host": f"127.0.0.1:{port}", "Origin": origin} for origin in foreign]
    hosts = (f"evil.example:{port}", "127.0.0.1.evil.example", "localhost.", "192.168.0.1", "")
    headers += [{"Host": host} for host in hosts]
    headers += [{"Host": host, "Origin": f"http://{host}"} for host in hosts] + [{}]
    headers += [{"Host": f"127.0.0.1:{port}", "host": f"127.0.0.1:{port}"}]
    for one in headers:
        assert answer(address, one, upgrade) == 403, one
        said = capfd.readouterr().err
        assert said.startswith("throwplan: the page: a request is refused: "), said
        assert said.count("\n") == 1


def test_odd_messages_are_named_and_the_page_goes_on(page: Any, capfd, caplog) -> None:
    found, address = page
    any_of, count, done = random.Random(1), 300, threading.Event()

    def keep_playing() -> None:
        while not done.is_set():
            run_panel(found.panel, 0.05)

    with ThreadPoolExecutor() as pool:
        playing = pool.submit(keep_playing)
        try:
            for _ in range(count // 20):
                with connected(address) as browser:
                    its = controls(browser)
                    send(browser, packed("ViewerCameraMessage", **CAMERA))
                    found.panel.play(True)
                    for _ in range(19):
                        send(browser, odd_message(any_of, its))
                    send(browser, any_of.choice(BROKEN))
                assert not playing.done()
        finally:
            done.set()
        playing.result()
    gc.collect()
    lines = capfd.readouterr().err.splitlines()
    assert all(re.match(r"throwplan: the page: a (message|connection) is ", s) for s in lines), (
        lines
    )
    assert len(lines) == count and max(map(len, lines)) < 400
    assert not [record for record in caplog.records if record.levelname == "ERROR"]
    # Numbers that are too large are wrong input, which the page itself shows.
    with connected(address) as browser:
        its = controls(browser)
        send(browser, packed("ViewerCameraMessage", **CAMERA))
        for value, words in ((1e300, "wrong input"), (1.15, "solved")):
            send(browser, update(its["x [m]"], value))
            wait_for(lambda words=words: found.strip.content.startswith(f"**{words}**"))
    assert found.plan.target.x == 1.15


def wait_for(condition: Any) -> None:
    """Waits until it holds, at most a minute."""
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_plans_are_saved_below_the_working_folder_only(page: Any, tmp_path, monkeypatch) -> None:
    found, _ = page
    here, outside = tmp_path / "here", tmp_path / "outside"
    for folder in (here / "mine", outside):
        folder.mkdir(parents=True)
    monkeypatch.chdir(here)
    (here / "link").symlink_to(outside)
    (here / "circle").symlink_to("circle")
    (here / "mine" / "throw.png").write_text("a photo")
    (here / "other").mkdir()
    (here / "other" / "plan.json").write_text('{"status": "of the holidays"}')
    below = ("..", "../outside", str(outside), "link", "link/new", "mine/../../new", "/", "~/../..")
    refusals = dict.fromkeys((*below, ".", "mine/.."), "must be below")
    refusals |= {"": "is empty", "circle": "loop", "a\0b": "null", "x" * 999: "too long"}
    refusals |= {"mine": "belongs to no plan", "other": "belongs to no plan"}
    before = sorted(tmp_path.rglob("*"))
    for name, words in refusals.items():
        found.folder.value = name
        with pytest.raises(tp.InputError, match=words):
            found.save()
    assert sorted(tmp_path.rglob("*")) == before
    assert (here / "mine" / "throw.png").read_text() == "a photo"


def test_floor_and_reach_are_below_all_that_is_shown(page: Any) -> None:
    found, address = page
    found.place[2].value = -0.4
    found.plans.finish()
    found.maps.finish()
    floor = found.panel.view.floor
    assert found.plan.target.z == -0.4 and floor < -0.4
    with connected(address) as browser:
        places = {
            message["name"]: message["position"]
            for message in replay(browser)
            if message["type"] == "SetPositionMessage"
        }
    assert places["/floor"][2] == floor
    assert places["/reach"][2] == pytest.approx(floor, abs=0.005)
