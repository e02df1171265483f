"""The numbers of a scene for its NLP: structure, parameter values and bounds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ..problems.scene import Pose, Scene
from .context import JERK_UNIT, Structure
from .mover import Mover
from .ocp import Nlp

Array = npt.NDArray[np.float64]

#: Depths of the lower end at which the NLP asks for the cup's clearance.
CUP_DEPTHS = 4
#: Cost weights: relative acceleration squared, relative jerk squared, carry time [1/s].
WEIGHTS = (10.0, 1.0, 2.0)
#: Share of the acceleration limit counted on for braking.
BRAKE_SHARE = 0.8
#: Longest flight that is searched [s].
FLIGHT_MAX = 3.0
#: Times after detach [s] at which the NLP keeps the bar off the hand's body.
PALM_TIMES = (0.015, 0.03, 0.05, 0.075, 0.105, 0.14, 0.18, 0.23)
#: Share of landing bounds kept back: the exact model lands a little differently.
LANDING_ROOM = 0.02
#: Room the NLP keeps beside cup and workspace for smoothing and correction [m].
ROOM = 0.001


def structure_of(
    scene: Scene, mover: Mover, angle: bool, *, palm: bool = False, elastic: bool = False
) -> Structure:
    """What the scene's NLP consists of.

    angle: whether the target fixes theta. palm: whether the hand's body is among the
    constraints; it seldom decides, so it comes in only after the check has seen it.
    """
    workspace, landing = scene.workspace, scene.landing
    bounds: list[str] = []
    if landing is not None:
        bounds += ["speed_min"] if landing.speed_min > 0 else []
        bounds += ["speed_max"] if landing.speed_max is not None else []
        bounds += ["rate_max"] if landing.rate_max is not None else []
    return Structure(
        carry=scene.mesh.carry,
        opening=scene.mesh.opening,
        substeps=scene.mesh.substeps,
        jerk_control=mover.jerk_control,
        free_start=mover.start is None,
        angle=angle,
        pivot=angle or scene.com_offset > 0 or scene.cup is not None,
        cup=CUP_DEPTHS if scene.cup is not None and not elastic else 0,
        landing=tuple(bounds),
        floor=workspace is not None and workspace.floor is not None,
        column=workspace is not None and workspace.column_radius is not None,
        palm=len(PALM_TIMES) if palm else 0,
        elastic=elastic,
    )


def parameter_values(scene: Scene, mover: Mover, target: Pose) -> dict[str, Any]:
    """Values of every parameter that an NLP of this scene may have."""
    body, contact, profile = scene.body, scene.patch, scene.gripper.profile()
    limits = mover.planning
    instants = 2 * scene.mesh.opening * scene.mesh.substeps + 1
    values: dict[str, Any] = {
        "mass": body.mass,
        "inertia": body.inertia,
        "com_offset": body.com_offset,
        "friction": contact.friction,
        "patch_radius": contact.patch_radius,
        "torsion": contact.torsion,
        "faces": contact.faces,
        "gravity": scene.gravity,
        "grasp_angle": scene.grasp.angle,
        "full_grip": profile.full,
        "sticking_limit": 1.0 - scene.mesh.sticking_margin,
        "opening_time": profile.opening,
        "grip_force": profile.force(np.linspace(0.0, profile.opening, instants)),
        "epsilon": scene.mesh.epsilon,
        "dq_max": limits.dq,
        "ddq_max": limits.ddq,
        "q_mid": (limits.q_min + limits.q_max) / 2,
        "q_half": (limits.q_max - limits.q_min) / 2,
        "weights": WEIGHTS,
        "braking": BRAKE_SHARE * limits.ddq,
        "ahead": scene.object.length - scene.object.com,
        "behind": scene.object.com,
        "half_width": scene.object.width / 2,
        "target_x": target.plane_x,
        "target_z": target.z,
        "target_theta": 0.0 if target.theta is None else target.theta,
        "price_x": 100.0,
        "price_theta": 100.0 * scene.object.length / 2,
    }
    if limits.jerk is not None:
        values["jerk_max"] = limits.jerk
    if mover.start is not None:
        values["start"] = mover.start
    if scene.workspace is not None:
        workspace = scene.workspace
        values["floor"] = (workspace.floor or 0.0) + ROOM
        values["column_radius"] = (workspace.column_radius or 0.0) + ROOM
        values["column_height"] = (workspace.column_height or 0.0) + ROOM
        values |= _palm_values(scene)
    if scene.landing is not None:
        landing = scene.landing
        values["speed_min"] = landing.speed_min * (1 + LANDING_ROOM)
        values["speed_max"] = (landing.speed_max or 0.0) * (1 - LANDING_ROOM)
        values["rate_max"] = (landing.rate_max or 0.0) * (1 - LANDING_ROOM)
    if scene.cup is not None:
        cup = scene.cup
        values["cup_x"], values["cup_rim"], values["cup_insertion"] = cup.x, cup.rim, cup.insertion
        # The bar is as thick as it is wide, so a round cup is narrower beside its middle.
        chord = math.sqrt(cup.radius**2 - (scene.object.width / 2) ** 2)
        values["cup_radius"], values["cup_clearance"] = chord, cup.clearance + ROOM
        values["lower_end"] = lower_end(scene, target)
    return values


def _palm_values(scene: Scene) -> dict[str, Any]:
    """The hand's body, grown by the clearance and half the bar's width."""
    if scene.arm is None or scene.workspace is None:
        return {}
    tool, grown = scene.arm.tool, scene.object.width / 2 + 5 * ROOM
    grown += scene.workspace.palm_clearance or 0.0
    return {
        "palm_times": PALM_TIMES,
        "palm_front": tool.palm_front - grown,
        "palm_half_width": tool.palm_half_width + grown,
    }


def lower_end(scene: Scene, target: Pose) -> float:
    """Distance [m] from the CoM to the end that lands lower; negative: the grasped end."""
    theta = 0.0 if target.theta is None else target.theta
    ahead = scene.object.length - scene.object.com
    return ahead if math.sin(theta) < 0 else -scene.object.com


def bounds(nlp: Nlp, scene: Scene, mover: Mover) -> tuple[Array, Array]:
    """Lower and upper bounds of the decision vector."""
    limits, dwell = mover.planning, scene.gripper.profile().dwell
    unbounded = np.full(6, np.inf)
    high: dict[str, Any] = {
        "q": limits.q_max,
        "dq": limits.dq,
        "ddq": limits.ddq,
        "c": limits.ddq if limits.jerk is None else limits.jerk / JERK_UNIT,
        "T": scene.mesh.carry_max,
        "t_f": FLIGHT_MAX,
    }
    if not mover.jerk_control:
        high["c"] = limits.ddq
    low: dict[str, Any] = {"q": limits.q_min, "T": max(dwell, 0.02), "t_f": 0.0}

    def bound(name: str, side: int) -> Any:
        if side > 0:
            return high.get(name, unbounded[0])
        if name.endswith(("_short", "_far")):
            return 0.0
        return low.get(name, -high.get(name, unbounded[0]))

    return nlp.fill(lambda name, _: bound(name, -1)), nlp.fill(lambda name, _: bound(name, 1))
