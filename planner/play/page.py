"""The page: a target to drag, sliders, and what the newest plan says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import InputError, Pose, Scene
from ..plan import PATIENCE, Planner
from ..result import Plan, throw_of
from ..show import Panel, View, space_throw
from .newest import Newest

#: How long [s] a throw is looked for while the target may still move.
QUICK = 0.5
#: Friction and opening time go to these shares of the scene's.
SHARES = (0.5, 1.5)


@dataclass(frozen=True)
class Wanted:
    """What is asked for: the target; friction; the gripper's opening time [s], if one number."""

    target: Pose
    friction: float
    opening: float | None

    def scene(self, scene: Scene) -> Scene:
        """The scene with these pads and this gripper; itself if it has them."""
        contact = scene.contact.changed(friction=self.friction)
        gripper = scene.gripper.changed(opening=self.opening)
        if (contact, gripper) == (scene.contact, scene.gripper):
            return scene
        return scene.replace(contact=contact, gripper=gripper)


class PlayPage:
    """Plans what its controls ask for, and shows it.

    planner, plan: where it begins. `panel.advance` plays the throw that is shown.
    """

    def __init__(self, server: Any, planner: Planner, plan: Plan) -> None:
        self._planner, self._scene = planner, planner.scene
        self.plan = plan
        self._base = planner.check()
        self.strip = server.gui.add_markdown(plan_words(plan))
        self._add_controls(server)
        self.panel = Panel(server, View(server, space_throw(throw_of(plan))))
        self.panel.go(self.panel.throw.throw.opening_time)
        self._last = self.wanted
        self.plans = Newest(self._plan)

    @property
    def wanted(self) -> Wanted:
        """What the controls say."""
        theta = None if self.theta is None else math.radians(self.theta.value)
        target = self._base.in_plane(self.x.value, theta).changed(z=self.z.value)
        opening = self._scene.gripper.opening if self.opening is None else self.opening.value / 1e3
        return Wanted(target, self.friction.value, opening)

    def _add_controls(self, server: Any) -> None:
        gui, scene, base = server.gui, self._scene, self._base
        self.x = gui.add_number("x [m]", base.plane_x, min=-100.0, max=100.0, step=0.001)
        self.z = gui.add_number("z [m]", base.z, min=-100.0, max=100.0, step=0.001)
        self.z.visible = scene.cup is None
        self.theta = self.opening = None
        if base.theta is not None:
            degrees = math.degrees(base.theta)
            low, high = degrees - 180.0, degrees + 180.0
            self.theta = gui.add_slider("angle [deg]", low, high, 1.0, degrees)
        low, high = (share * scene.contact.friction for share in SHARES)
        self.friction = gui.add_slider("friction", low, high, 0.01, scene.contact.friction)
        if scene.gripper.opening is not None:
            opening = 1e3 * scene.gripper.opening
            low, high = (share * opening for share in SHARES)
            self.opening = gui.add_slider("opening [ms]", low, high, 1.0, opening)
        self._add_gizmo(server)
        for control in (self.x, self.z, self.theta, self.friction, self.opening):
            if control is not None:
                control.on_update(lambda _: self._changed())

    def _add_gizmo(self, server: Any) -> None:
        """Arrows at the target along x, and z where there is no cup."""
        from viser.transforms import SO3

        plane, free = self._base.plane, self._scene.cup is None
        along = plane.points(1.0, 0.0) - plane.points(0.0, 0.0)
        axes = np.column_stack([along, np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, 1.0]])
        self._gizmo = server.scene.add_transform_controls(
            "/drag",
            scale=0.2,
            active_axes=(True, False, free),
            disable_sliders=not free,
            disable_rotations=True,
            depth_test=False,
            wxyz=SO3.from_matrix(axes).wxyz,
            position=plane.points(self.x.value, self.z.value),
        )

        def dragged(_: Any) -> None:
            place = self._gizmo.position
            self.x.value = float((place - plane.points(0.0, 0.0)) @ along)
            if free:
                self.z.value = float(place[2])

        self._gizmo.on_update(dragged)

    def _changed(self) -> None:
        """Somebody moved a control, or the page itself did."""
        wanted = self.wanted
        if wanted == self._last:
            return
        self._last = wanted
        place = self._base.plane.points(self.x.value, self.z.value)
        if not np.allclose(place, self._gizmo.position, rtol=0.0, atol=1e-9):
            self._gizmo.position = place
        self.plans.ask(wanted)

    def _plan(self, wanted: Wanted) -> None:
        try:
            scene = wanted.scene(self._scene)
            if scene != self._planner.scene:
                self.strip.content = "planning..."
                self._planner = Planner(scene)
            target = self._planner.check(wanted.target)
            plan = self._planner.plan(target, warm=self.plan, patience=QUICK)
            if not plan.solved and not self.plans.waiting:
                self.strip.content = "planning..."
                plan = self._planner.plan(target, warm=self.plan)
        except InputError as error:
            self.strip.content = f"**wrong input**: {error}"
            return
        if plan.solved:
            self.plan = plan
            self.panel.change(space_throw(throw_of(plan)))
        self.strip.content = plan_words(plan)

    def end(self) -> None:
        """Stops planning."""
        self.plans.end(PATIENCE)


def first_plan(planner: Planner) -> Plan:
    """The scene's throw; where there is none, the one to the nearest possible landing."""
    plan = planner.plan()
    if plan.solved or plan.nearest is None:
        return plan
    nearest = planner.plan(plan.nearest)
    return nearest if nearest.solved else plan


def plan_words(plan: Plan) -> str:
    """What came of a plan, for the page."""
    took = f"{1e3 * plan.time['total']:.0f} ms"
    if plan.throw is None or not plan.solved:
        name = plan.status.replace("_", " ")
        return f"**{name}**: {plan.message.removeprefix(f'{name}: ')}; {took}"
    landings = []
    for model in (STEPPED_SURFACE, SLIDING_PIVOT):
        x, theta = plan.throw.final.by(model).miss(plan.goal)
        turn = "" if plan.goal.theta is None else f", {math.degrees(abs(theta)):.2f}°"
        landings.append(f"{1e3 * abs(x):.2f} mm{turn} off by {model}")
    return f"**solved**: lands {'; '.join(landings)}; planned in {took}"
