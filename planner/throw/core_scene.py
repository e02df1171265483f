"""What of a scene the compiled core measures throws by."""

from __future__ import annotations

import math

import numpy as np

from ...core import SceneC, library
from ...models import Array
from ...problems import Scene


def column_of(scene: Scene) -> tuple[float, float] | None:
    """Half the width [m] of the base column where the bar meets it, and its height.

    None without one, and for an arm that throws beside it.
    """
    workspace, target = scene.workspace, scene.target
    if workspace is None or workspace.column_radius is None or workspace.column_height is None:
        return None
    lateral = 0.0 if target is None else abs(target.lateral)
    beside = max(lateral - scene.object.width / 2, 0.0)
    if beside >= workspace.column_radius:
        return None
    return math.sqrt(workspace.column_radius**2 - beside**2), workspace.column_height


def core_scene(scene: Scene, hand_error: float) -> SceneC:
    """What of the scene the compiled core measures a throw by; hand_error [rad]: its angle's."""
    speed = 0.0 if scene.target is None else scene.target.speed
    bar, body, patch, cup, arm = scene.object, scene.body, scene.patch, scene.cup, scene.arm
    limit = patch.force_limit(scene.gripper.profile().full)
    workspace, column = scene.workspace, column_of(scene)
    # Widths of what a scene does not have are negative.
    palm = (0.0, 0.0, -1.0)
    if arm is not None:
        palm = arm.tool.palm_back, arm.tool.palm_front, arm.tool.palm_half_width
    clearance = None if workspace is None or arm is None else workspace.palm_clearance
    mouth = (0.0, 0.0, -1.0, 0.0, 0.0)
    if cup is not None:
        # The bar is as thick as it is wide, so a round cup is narrower off its middle.
        half = math.sqrt(cup.radius**2 - (bar.width / 2) ** 2)
        mouth = cup.x, cup.rim, half, cup.insertion, speed
    return SceneC(
        *(scene.gravity, body.mass, body.inertia, body.com_offset),
        scene.grasp.angle + hand_error,
        *(limit, limit * patch.torsion_arm),
        *(bar.com, bar.length - bar.com, bar.width / 2),
        *((-1.0, 0.0) if column is None else column),
        *palm,
        -1.0 if clearance is None else clearance,
        -1.0 if arm is None or scene.tool_speed is None else arm.tool.tcp,
        *mouth,
    )


def cup_entries(scene: Scene, detach: Array, flight: Array) -> Array:
    """Least clearance (N,) [m] of the bars' way into the scene's cup; -inf for those that miss it.

    detach (N, 6): CoM pose and twist; flight (N,): seconds until the landing height. The way in is
    from the lower end's passing the rim plane until it is `insertion` below; the clearance is
    the least distance of outline and wall or rim, negative outside. The bar is taken as thick as
    it is wide, so in a round cup the walls are nearer than `radius` off the middle.
    """
    found = np.empty(len(detach))
    states, times = np.ascontiguousarray(detach), np.ascontiguousarray(flight, float)
    library().cup_entries(core_scene(scene, 0.0), len(detach), states, times, found)
    return found
