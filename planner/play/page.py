"""The page: a target to drag, sliders, and the latest plan."""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import InputError, Pose, Scene
from ..planner import Planner
from ..reach import ReachMap, reach_map
from ..result import Plan, check_overwrites, throw_of
from ..show import RED, Panel, space_throw
from .around import (
    bands,
    cloud_words,
    delay_of,
    draw_cloud,
    draw_reach,
    lift_reach,
    reach_legend,
    sweep_delays,
    with_delay,
)
from .latest_only import LatestOnlyWorker, OutdatedError


@dataclass(frozen=True)
class PageSettings:
    """Settings of the page.

    quick_patience [s]: of a plan while the target may still move; patience [s]: once it stands; a
    plan cannot be interrupted. close_time [s]: longest wait for current work when the page closes.
    slider_range: of friction and opening time, as shares of the scene's values. longest_delay [ms]:
    of the slider. samples: sampled throws of a map. unreachable [m]: distance beyond every throw,
    whose nearest landing is the edge of the reach. angle_match [rad]: largest difference of that
    landing's angle from the target's.
    """

    quick_patience: float = 0.5
    patience: float = 3.0
    close_time: float = 1.0
    slider_range: tuple[float, float] = (0.5, 1.5)
    longest_delay: float = 30.0
    samples: int = 20_000
    unreachable: float = 20.0
    angle_match: float = math.radians(10.0)


SETTINGS = PageSettings()


@dataclass(frozen=True)
class PlanRequest:
    """Target and scene of a plan.

    delay [s]: half range of opening delays to plan against, or None.
    """

    target: Pose
    scene: Scene
    delay: float | None

    @property
    def map_inputs(self) -> tuple[Scene, float, float | None]:
        """The inputs of the map of the reach."""
        return self.scene, self.target.z, self.target.theta


class PlayPage:
    """Plans for the values of its controls, and shows the plan.

    planner, plan: at the start. `panel.advance` plays the throw; reach (N, 3): the bands on the
    floor. viser calls back from other threads, so a lock guards the state; one thread makes plans,
    another one maps.
    """

    def __init__(self, server: Any, planner: Planner, plan: Plan) -> None:
        self._planner, self._scene, self._base = planner, planner.scene, planner.check()
        self.plan, self._lock, self._button = plan, threading.RLock(), threading.Lock()
        words = plan_words(plan)
        if plan.target != self._base:
            words = f"**the scene's target is out of reach**; shown is the nearest throw: {words}"
        self.strip = server.gui.add_markdown(words)
        self._add_controls(server)
        self._add_buttons(server.gui)
        self.panel = Panel(server, space_throw(throw_of(plan)))
        server.gui.add_html(reach_legend())
        view = self.panel.view
        self.panel.go(self.panel.throw.throw.opening_time)
        self._drawn: dict[str, Any] = {}
        self._nearest = server.scene.add_frame("/nearest", show_axes=False, visible=False)
        view.add_bar("/nearest/bar", RED, 0.5)
        self._aim, self._last = self._base, self.request
        view.aim(self._aim)
        self._reach_map: ReachMap | None = None
        self._map_planner, self.reach = planner, np.zeros((0, 3))
        self.plans, self.maps = LatestOnlyWorker(self._plan), LatestOnlyWorker(self._map)
        self.maps.submit(self._last)

    @property
    def request(self) -> PlanRequest:
        """The request of the controls."""
        scene, base = self._scene, self._base
        theta = None if self.theta is None else math.radians(self.theta.value)
        place = dict(zip("xyz", (control.value for control in self.place), strict=True))
        contact, gripper = scene.contact, scene.gripper
        if self.friction.value != contact.friction:
            contact = dataclasses.replace(contact, friction=self.friction.value)
        if self.opening is not None and self.opening.value != 1e3 * (gripper.opening or 0.0):
            gripper = dataclasses.replace(gripper, opening=self.opening.value / 1e3)
        if contact is not scene.contact or gripper is not scene.gripper:
            scene = scene.replace(contact=contact, gripper=gripper)
        delay = self.delay.value / 1e3 if self.robust.value else None
        return PlanRequest(dataclasses.replace(base, theta=theta, **place), scene, delay)

    def _add_controls(self, server: Any) -> None:
        """Numbers and sliders, and arrows at the target that drag it."""
        gui, scene, base = server.gui, self._scene, self._base
        free = (True, scene.robot is not None, scene.cup is None)
        # A range moves with its middle.
        middle_x, middle_angle = (", middle" if half else "" for half in base.half_widths)
        labels = f"x{middle_x} [m]", "y [m]", "z [m]"
        self.place = [
            gui.add_number(label, getattr(base, name), step=0.001, visible=moves)
            for name, label, moves in zip("xyz", labels, free, strict=True)
        ]
        self.theta = self.opening = None
        if base.theta is not None:
            at = math.degrees(base.theta)
            self.theta = gui.add_slider(
                f"angle{middle_angle} [deg]", at - 180.0, at + 180.0, 1.0, at
            )
        low, high = SETTINGS.slider_range
        at = scene.contact.friction
        self.friction = gui.add_slider("friction", low * at, high * at, 0.01, at)
        if scene.gripper.opening is not None:
            at = 1e3 * scene.gripper.opening
            self.opening = gui.add_slider("opening [ms]", low * at, high * at, 1.0, at)
        self.arrows = server.scene.add_transform_controls(
            "/drag",
            scale=0.2,
            active_axes=free,
            disable_rotations=True,
            depth_test=False,
            position=self._position,
        )
        self.arrows.on_update(lambda _: self._read_arrows())
        half = min(max(1e3 * delay_of(scene), 0.5), SETTINGS.longest_delay)
        self.delay = gui.add_slider("delay up to ± [ms]", 0.5, SETTINGS.longest_delay, 0.5, half)
        self.robust = gui.add_checkbox("plan against delays", False)
        sliders = (self.theta, self.friction, self.opening, self.delay, self.robust)
        for control in (*self.place, *sliders):
            if control is not None:
                control.on_update(lambda _: self._update())

    def _add_buttons(self, gui: Any) -> None:
        """Buttons for throws and files."""
        throw = gui.add_button("throw")
        delays = gui.add_button("throw with random delays")
        self.folder = gui.add_text("folder", f"out/{self._scene.name}")
        save = gui.add_button("save the plan")
        self.status = gui.add_markdown("")
        throw.on_click(lambda _: self.throw())
        delays.on_click(lambda _: self._with_status(self.throw_delayed))
        save.on_click(lambda _: self._with_status(self.save))

    @property
    def _position(self) -> tuple[float, ...]:
        return tuple(control.value for control in self.place)

    def _read_arrows(self) -> None:
        # Each change of a control moves the arrows to all controls: these are as before the first.
        dragged = tuple(float(value) for value in self.arrows.position)
        with self._lock:
            for control, value in zip(self.place, dragged, strict=True):
                control.value = value

    def _update(self) -> None:
        """The user or the page changed a control."""
        with self._lock:
            try:
                request = self.request
                if request == self._last:
                    return
                last, self._last = self._last, request
                if not np.allclose(self._position, self.arrows.position, rtol=0.0, atol=1e-9):
                    self.arrows.position = self._position
                self._aim = self._planner.check(request.target)
            except InputError as error:
                self.strip.content = f"**wrong input**: {error}"
                return
            self.panel.view.aim(self._aim)
        self.plans.submit(request)
        if request.map_inputs != last.map_inputs:
            self.maps.submit(request)

    def _plan(self, request: PlanRequest) -> None:
        """Plan quickly; if that fails and no newer request waits, plan patiently."""
        scene, robust = request.scene, None
        try:
            if request.delay is not None:
                scene, robust = with_delay(scene, request.delay), "auto"
            if scene != self._planner.scene:
                self.strip.content = "planning..."
                self._planner = Planner(scene)
            plan_for = partial(self._planner.plan, request.target, warm=self.plan, robust=robust)
            plan = plan_for(patience=SETTINGS.quick_patience)
            done = plan.solved and plan.robust != "nominal"
            if not done and not self.plans.waiting:
                self.strip.content = "planning..."
                plan = plan_for(patience=SETTINGS.patience)
        except InputError as error:
            self.strip.content = f"**wrong input**: {error}"
            return
        if not self.plans.ended:
            self._show(plan)

    def _show(self, plan: Plan) -> None:
        """Show a plan's throw; without one, the nearest landing beside the last throw, faded."""
        with self._lock:
            if plan.solved:
                self.plan = plan
                self._drop("cloud")
                self.panel.change(space_throw(throw_of(plan)))
                self.panel.view.aim(self._aim)
                if "reach" in self._drawn:
                    lift_reach(self._drawn["reach"], self.panel.view.floor)
            self.panel.view.fade(not plan.solved)
            self._nearest.visible = plan.nearest is not None
            if plan.nearest is not None:
                self.panel.view.place(self._nearest, plan.nearest)
            self.strip.content = plan_words(plan)

    def _map(self, request: PlanRequest) -> None:
        """Draw the reach at the target's height and angle, then extend it to its edge."""
        reach, target = self._reach_map, request.target
        try:
            if reach is None or (reach.scene, reach.z) != (request.scene, target.z):
                self._map_planner = Planner(request.scene)
                check, samples = self._check_outdated, SETTINGS.samples
                reach = reach_map(request.scene, target.z, samples, progress=check)
                self._reach_map = reach
            self._draw_reach(reach, target, None)
            if reach.reachable:
                self._check_outdated()
                farthest = self._farthest(target)
                self._check_outdated()
                self._draw_reach(reach, target, farthest)
        except InputError:
            return

    def _farthest(self, target: Pose) -> float | None:
        """x [m] of the farthest landing at about the target's angle; None without one."""
        beyond = target.middle.changed(x=SETTINGS.unreachable, y=0.0, velocity=None, arrival=None)
        nearest = self._map_planner.plan(beyond).nearest
        if nearest is None:
            return None
        turn = nearest.changed(x=SETTINGS.unreachable, y=0.0, z=target.z).distance(beyond, 1.0)
        return nearest.plane_x if turn < SETTINGS.angle_match else None

    def _draw_reach(self, reach: ReachMap, target: Pose, farthest: float | None) -> None:
        with self._lock:
            self._drop("reach")
            view, at = self.panel.view, self._base
            self.reach = bands(reach, target.theta, farthest)
            self._drawn["reach"] = draw_reach(view.scene, self.reach, reach.scene, at, view.floor)

    def _check_outdated(self, *_: int) -> None:
        if self.maps.waiting:
            raise OutdatedError

    def _drop(self, name: str) -> None:
        """Remove a drawing."""
        if name in self._drawn:
            self._drawn.pop(name).remove()

    def throw(self) -> None:
        """Play the throw from its start."""
        self.panel.go(0.0)
        self.panel.play(True)

    def throw_delayed(self) -> str:
        """Throws the plan under opening delays; returns the result as text."""
        plan, half = self.plan, self.delay.value / 1e3
        swept = sweep_delays(plan, half)
        with self._lock:
            if plan is self.plan:
                self._drop("cloud")
                self._drawn["cloud"] = draw_cloud(self.panel.view.scene, swept)
        return cloud_words(swept, half)

    def save(self) -> str:
        """Writes the plan shown; returns a sentence with the folder."""
        folder = folder_below(Path.cwd(), self.folder.value)
        check_overwrites(folder)
        self.plan.save(folder)
        return f"written to {folder}"

    def _with_status(self, work: Callable[[], str]) -> None:
        """Show the result of a button's work; one click at a time, others are lost."""
        if not self._button.acquire(blocking=False):
            return
        self.status.content = "working..."
        try:
            self.status.content = work()
        except InputError as error:
            self.status.content = f"**{error}**"
        finally:
            self._button.release()

    def end(self) -> None:
        """Stops planning."""
        self.maps.end(SETTINGS.close_time)
        self.plans.end(SETTINGS.close_time)


def folder_below(place: Path, name: str) -> Path:
    """The folder `name` below `place`, links followed; InputError if it is not below.

    A page takes names from whoever reaches it, so they may mean no other place.
    """
    if not name.strip():
        raise InputError("folder: is empty; type the name of a folder for the plan's files")
    try:
        place, folder = place.resolve(), (place / name).resolve()
        # Up to Python 3.12, resolve() raises this itself.
        if any(path.is_symlink() for path in (folder, *folder.parents)):
            raise RuntimeError(f"Symlink loop from {folder}")
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"folder {name!r}: {error}") from None
    if place not in folder.parents:
        raise InputError(f"folder {name}: must be below {place}, where the command was started")
    return folder


def first_plan(planner: Planner) -> Plan:
    """The scene's throw; without one, the throw to the nearest possible landing."""
    plan = planner.plan()
    if plan.solved or plan.nearest is None:
        return plan
    nearest = planner.plan(plan.nearest)
    return nearest if nearest.solved else plan


def plan_words(plan: Plan) -> str:
    """The result of a plan, for the page."""
    build = plan.time["build"]
    took = f"{1e3 * (plan.time['total'] - build):.0f} ms"
    if build > 1e-3:
        took += f" after {1e3 * build:.0f} ms for building the problem"
    if plan.throw is None or not plan.solved:
        name = plan.status.replace("_", " ")
        return f"**{name}**: {plan.message.removeprefix(f'{name}: ')}; {took}"
    landings, place = [], ""
    if plan.goal.is_region:
        landing = plan.throw.deciding.landing
        place = f"lands at {plan.goal.in_plane(landing.x, landing.theta).words}; "
    for model, name in ((STEPPED_SURFACE, "limit surface"), (SLIDING_PIVOT, "sliding pivot")):
        x, theta = plan.throw.deciding.with_model(model).miss(plan.goal)
        turn = "" if plan.goal.theta is None else f", {math.degrees(abs(theta)):.2f}°"
        error = f"{1e3 * abs(x):.2f} mm{turn}"
        landings.append(f"{error if math.isfinite(x) else 'no landing'} by the {name}")
    if plan.robust:
        landings.append(f"robust by {plan.robust}")
    if plan.rests is not None:
        landings.append(plan.rests.words)
    return f"**solved**: {place}landing error {'; '.join(landings)}; planned in {took}"
