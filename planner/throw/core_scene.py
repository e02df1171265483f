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
    bar, body, patch, cup, arm = scene.object, scene.body, scene.patch, scene.cup, scene.arm
    limit = patch.force_limit(scene.gripper.profile().full)
    workspace, column = scene.workspace, column_of(scene)
    found = SceneC(
        gravity=scene.gravity,
        mass=body.mass,
        inertia=body.inertia,
        com_offset=body.com_offset,
        grasp_angle=scene.grasp.angle + hand_error,
        force=limit,
        torque=limit * patch.torsion_arm,
        behind=bar.com,
        ahead=bar.length - bar.com,
        half_width=bar.width / 2,
        cup_speed=0.0 if scene.target is None else scene.target.speed,
        # Below 0 is what the scene does not have.
        column_radius=-1.0,
        palm_half_width=-1.0,
        palm_clearance=-1.0,
        tool_length=-1.0,
        cup_radius=-1.0,
    )
    if column is not None:
        found.column_radius, found.column_height = column
    if arm is not None:
        tool = arm.tool
        found.palm_back, found.palm_front = tool.palm_back, tool.palm_front
        found.palm_half_width = tool.palm_half_width
        if workspace is not None and workspace.palm_clearance is not None:
            found.palm_clearance = workspace.palm_clearance
        if scene.tool_speed is not None:
            found.tool_length = tool.tcp
    if cup is not None:
        found.cup_x, found.cup_rim, found.cup_insertion = cup.x, cup.rim, cup.insertion
        # The bar is as thick as it is wide, so a round cup is narrower off its middle.
        found.cup_radius = math.sqrt(cup.radius**2 - (bar.width / 2) ** 2)
    return found


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
