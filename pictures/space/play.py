"""The page of `play`: a target to drag, and the throw that follows."""

from __future__ import annotations

import dataclasses
import math
import threading
from typing import Any

from ...models import SLIDING_PIVOT, STEPPED_SURFACE
from ...planner import Plan, Planner, throw_of
from ...problems import InputError, Pose, Scene
from ..style import RED
from .motion import space_motion
from .server import Panel

#: Time limits [s] of the plans for one target: the target may move while it plans, so the first
#: plan is quick; the second is made where the first one fails and the target still stands.
PATIENCE = (0.5, 3.0)
#: Least and largest friction and opening time, as shares of the scene's.
RANGE = (0.5, 1.5)


class PlayPage:
    """Plans for the target, friction and opening time of its controls, and shows the plan.

    plan: the latest solved plan; panel: plays its throw. viser calls back from threads of its own.
    One more thread plans, each time for the newest values.
    """

    def __init__(self, server: Any, planner: Planner, plan: Plan) -> None:
        self.plan, self._planner, self._scene = plan, planner, planner.scene
        self._target = planner.check()
        self._changed, self._showing, self.ended = threading.Event(), threading.Lock(), False
        self.status = server.gui.add_markdown(plan_words(plan))
        self._add_controls(server)
        self.panel = Panel(server, space_motion(throw_of(plan)))
        self.panel.go(self.panel.throw.throw.opening_time)
        self._nearest = server.scene.add_frame("/nearest", show_axes=False, visible=False)
        self.panel.view.add_bar("/nearest/bar", RED, 0.5)
        threading.Thread(target=self._follow, daemon=True).start()

    def _add_controls(self, server: Any) -> None:
        """Add numbers, sliders, and the arrows that drag the target."""
        gui, scene, target = server.gui, self._scene, self._target
        # A hand throws along x only; a cup stays at its height.
        axes = (True, scene.robot is not None, scene.opening is None)
        self.place = [
            gui.add_number(f"{name} [m]", getattr(target, name), step=0.001, visible=moves)
            for name, moves in zip("xyz", axes, strict=True)
        ]
        self.theta = self.opening = None
        if target.theta is not None:
            at = math.degrees(target.theta)
            self.theta = gui.add_slider("angle [deg]", at - 180.0, at + 180.0, 1.0, at)
        at = scene.contact.friction
        self.friction = gui.add_slider("friction", RANGE[0] * at, RANGE[1] * at, 0.01, at)
        if scene.gripper.opening is not None:
            at = 1e3 * scene.gripper.opening
            self.opening = gui.add_slider("opening [ms]", RANGE[0] * at, RANGE[1] * at, 1.0, at)
        self._arrows = server.scene.add_transform_controls(
            "/drag", scale=0.2, active_axes=axes, disable_rotations=True, depth_test=False
        )
        self._arrows.position = [control.value for control in self.place]
        self._arrows.on_update(lambda _: self._drag())
        for control in (*self.place, self.theta, self.friction, self.opening):
            if control is not None:
                control.on_update(self._update)

    def _drag(self) -> None:
        """The user moved the arrows."""
        for control, value in zip(self.place, self._arrows.position, strict=True):
            control.value = float(value)

    def _update(self, event: Any) -> None:
        """A control changed: by the user, or, without a client, by this program."""
        if event.client is not None:
            self._arrows.position = [control.value for control in self.place]
        self._changed.set()

    def _request(self) -> tuple[Pose, Scene]:
        """Target and scene of the controls; InputError for a target that does not fit the scene."""
        scene, contact, gripper = self._scene, self._scene.contact, self._scene.gripper
        theta = None if self.theta is None else math.radians(self.theta.value)
        place = dict(zip("xyz", (control.value for control in self.place), strict=True))
        # Compared first: a slider may round the scene's own value.
        if self.friction.value != contact.friction:
            contact = dataclasses.replace(contact, friction=self.friction.value)
        if self.opening is not None and self.opening.value != 1e3 * (gripper.opening or 0.0):
            gripper = dataclasses.replace(gripper, opening=self.opening.value / 1e3)
        if contact is not scene.contact or gripper is not scene.gripper:
            scene = scene.replace(contact=contact, gripper=gripper)
        target = dataclasses.replace(self._target, theta=theta, **place)
        return self._planner.check(target), scene

    def _follow(self) -> None:
        """Plan for each change of the controls until the page ends."""
        while not self.ended:
            try:
                self._plan(*self._request())
            except InputError as error:
                self._show(f"**wrong input**: {error}")
            self._changed.wait()
            self._changed.clear()

    def _plan(self, target: Pose, scene: Scene) -> None:
        """Plan for a target, and show the plan."""
        if scene != self._planner.scene:
            self._show("planning...")
            self._planner = Planner(scene)
        for patience in PATIENCE:
            plan = self._planner.plan(target, warm=self.plan, patience=patience)
            if plan.solved or self._changed.is_set():
                break
        self._show(plan_words(plan), plan)

    def _show(self, status: str, plan: Plan | None = None) -> None:
        """Show a status, and a plan's throw or, without one, the last throw faded and the nearest
        possible landing; nothing after the end, when viser's server takes no more."""
        with self._showing:
            if self.ended:
                return
            self.status.content = status
            if plan is None:
                return
            view = self.panel.view
            if plan.solved:
                self.plan = plan
                self.panel.change(space_motion(throw_of(plan)))
            view.aim(plan.target)
            view.fade(not plan.solved)
            self._nearest.visible = plan.nearest is not None
            if plan.nearest is not None:
                view.place(self._nearest, plan.nearest.target)

    def end(self) -> None:
        """Stop planning; a plan under way is not shown."""
        with self._showing:
            self.ended = True
        self._changed.set()


def first_plan(planner: Planner) -> Plan:
    """The scene's throw; without one, the one that lands nearest."""
    plan = planner.plan()
    return plan if plan.nearest is None else plan.nearest


def plan_words(plan: Plan) -> str:
    """Status, landing errors by both release models, and planning time, as Markdown."""
    took = f"{1e3 * plan.time['total']:.0f} ms"
    if plan.throw is None or not plan.solved:
        status = plan.status.replace("_", " ")
        return f"**{status}**: {plan.message.removeprefix(f'{status}: ')}; {took}"
    errors = []
    for model, name in ((STEPPED_SURFACE, "limit surface"), (SLIDING_PIVOT, "sliding pivot")):
        x, theta = plan.throw.deciding.with_model(model).miss(plan.goal)
        turn = "" if plan.goal.theta is None else f", {math.degrees(abs(theta)):.2f}°"
        error = f"{1e3 * abs(x):.2f} mm{turn}" if math.isfinite(x) else "no landing"
        errors.append(f"{error} by the {name}")
    return f"**solved**: landing error {'; '.join(errors)}; planned in {took}"
