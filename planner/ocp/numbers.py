"""The numbers of a scene for its NLP: structure, parameter values and bounds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import PlanarArm
from ...problems import Mesh, Pose, Scene
from ..check import PALM_TIMES, Guard, Mover
from .asked import USUAL, Margins
from .assembly import Nlp
from .context import JERK_UNIT, Structure
from .integration import NODES, SLIP_UNIT, TURN_UNIT
from .nlp import ThrowNlp
from .window import Window

Array = npt.NDArray[np.float64]

#: Depths of the lower end at which the NLP asks for the cup's clearance: at first, and after
#: the check has seen too little in between.
CUP_DEPTHS = (4, 12)
#: Cost weights: relative acceleration squared, relative jerk squared, carry time [1/s].
WEIGHTS = (10.0, 1.0, 2.0)
#: Share of the acceleration limit counted on for braking.
BRAKE_SHARE = 0.95
#: Longest flight that is searched [s].
FLIGHT_MAX = 3.0
#: Instants of the rest of the flight, where it falls back, and from when on [s].
LATER, LATER_FIRST = 40, 0.1
#: Parts of a carry interval at whose ends grip and held bar are looked at: at first, when guarded.
INSTANTS = (2, 8)
#: Instants of the flight at which it keeps the bar off the base column.
PASSING = 40
#: Room [m] that these instants keep, for what lies between them.
PASSING_ROOM = 0.004
#: Share of landing bounds kept back: the exact model lands a little differently.
LANDING_ROOM = 0.02
#: Price of the mean square load (m/s^2)^2 over the window of a quiet release.
QUIET_WEIGHT = 10.0
#: What counts as no load at all [m/s^2].
QUIET_HAIR = 0.05
#: Price of the scenarios' mean square scaled miss [1/m^2].
SCENARIO_WEIGHT = 1e4
#: Room [m] that the NLP keeps for what lies between its nodes, smoothing and correction: beside
#: the cup; of what is carried beside floor and column; of the flying bar beside the hand.
CUP_ROOM, HELD_ROOM, PALM_ROOM = 0.001, 0.001, 0.008


def structure_of(
    scene: Scene,
    mover: Mover,
    angle: bool,
    *,
    guards: frozenset[Guard] = frozenset(),
    elastic: bool = False,
    robust: str = "",
    window: Window | None = None,
) -> Structure:
    """What the scene's NLP consists of.

    angle: whether the target fixes theta. guards: which of the rows that seldom decide
    are in: "carry" looks at grip and held bar more often and at the arm too, "flight" keeps
    the ends of the flying bar off the hand's body and asks more of the cup, "passing" keeps the
    bar off the base column, "return" keeps all of it off the hand, and for the rest of the
    flight.
    robust, window: what is asked of the hand over that window.
    """
    workspace, landing = scene.workspace, scene.landing
    palm = workspace is not None and workspace.palm_clearance is not None
    column = workspace is not None and workspace.column_radius is not None
    bounds: list[str] = []
    if landing is not None:
        bounds += ["speed_min"] if landing.speed_min > 0 else []
        bounds += ["speed_max"] if landing.speed_max is not None else []
        bounds += ["rate_max"] if landing.rate_max is not None else []
    return Structure(
        carry=scene.mesh.carry,
        opening=scene.mesh.opening,
        integrator=scene.mesh.integrator,
        substeps=scene.mesh.substeps if scene.mesh.integrator == "rk4" else 1,
        jerk_control=mover.jerk_control,
        free_start=mover.start is None,
        angle=angle,
        pivot=angle or scene.com_offset > 0 or scene.cup is not None,
        cup=0 if scene.cup is None else CUP_DEPTHS["flight" in guards],
        landing=tuple(bounds),
        floor=workspace is not None and workspace.floor is not None,
        column=column,
        hand=scene.arm is not None and workspace is not None,
        instants=INSTANTS["carry" in guards],
        arm="carry" in guards,
        palm=len(PALM_TIMES) if guards & {"flight", "return"} and palm else 0,
        later=LATER if "return" in guards and palm else 0,
        passing=PASSING if "passing" in guards and column else 0,
        elastic=elastic,
        early=0 if window is None else window.early,
        late=0 if window is None else window.late,
        robust="quiet" if robust == "scenarios" else robust,
        scenarios=len(window.delays) if window is not None and robust == "scenarios" else 0,
        slowing=mover.planning.slowing is not None,
        torque=scene.torque is not None,
    )


def parameter_values(
    scene: Scene,
    mover: Mover,
    target: Pose,
    window: Window | None = None,
    margins: Margins = USUAL.margins,
) -> dict[str, Any]:
    """Values of every parameter that an NLP of this scene may have.

    margins: beyond the usual ones.
    """
    body, contact, profile = scene.body, scene.patch, scene.gripper.profile()
    limits = mover.planning
    nodes = opening_nodes(scene.mesh, profile.opening)
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
        "interval": np.diff(nodes),
        "grip_force": profile.force(_instants(scene.mesh, nodes).ravel()),
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
    if window is not None:
        values |= _window_values(scene, window, nodes)
    if limits.jerk is not None:
        values["jerk_max"] = limits.jerk
    if scene.torque is not None:
        assert isinstance(mover.kinematics, PlanarArm)
        limits_of = scene.torque.of(mover.kinematics.arm, mover.kinematics.throwing_joints)
        values["torque_max"] = (1 - scene.torque.margin - margins.torque) * np.array(limits_of)
    if limits.slowing is not None:
        names = ("slowing", "slowing_offset", "slowing_upper", "slowing_lower")
        values |= dict(zip(names, limits.slowing, strict=True))
    if mover.start is not None:
        values["start"] = mover.start
    if scene.workspace is not None:
        workspace = scene.workspace
        values["floor"] = (workspace.floor or 0.0) + HELD_ROOM
        values["column_radius"] = (workspace.column_radius or 0.0) + HELD_ROOM
        values["column_height"] = (workspace.column_height or 0.0) + HELD_ROOM
        values["passing_room"] = PASSING_ROOM + margins.passing
        values["column_room"] = HELD_ROOM
        values["held_room"] = margins.held
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
        values["cup_radius"], values["cup_clearance"] = (
            chord,
            cup.clearance + CUP_ROOM + margins.cup,
        )
        values["lower_end"] = lower_end(scene, target)
    return values


def _window_values(scene: Scene, window: Window, nodes: Array) -> dict[str, Any]:
    """The window's lengths, the price of a load in it, and the scenarios' grip forces."""
    profile, step = scene.gripper.profile(), window.step
    times = np.concatenate(
        [
            step * np.arange(-window.early, 0),
            nodes,
            nodes[-1] + step * np.arange(1, window.late + 1),
        ]
    )
    values: dict[str, Any] = {
        "window_step": step,
        "window": times[-1] - times[0],
        "quiet_arm": scene.object.length / 2,
        "quiet_weight": QUIET_WEIGHT,
        "quiet_hair": QUIET_HAIR,
        "scenario_weight": SCENARIO_WEIGHT,
    }
    instants = _instants(scene.mesh, times).ravel()
    for number, delay in enumerate(window.delays):
        values[f"grip_force_{number}"] = profile.force(instants - delay)
    return values


def opening_nodes(mesh: Mesh, opening: float) -> Array:
    """Times (opening + 1,) [s] of the shooting nodes, from the start of the force's fall."""
    shares = np.linspace(0.0, 1.0, mesh.opening + 1)
    return np.asarray(opening * (1.0 - (1.0 - shares) ** mesh.grading))


def _instants(mesh: Mesh, nodes: Array) -> Array:
    """Times (intervals, k) at which the NLP needs the grip force."""
    shares = np.array(NODES)
    if mesh.integrator == "rk4":
        shares = np.linspace(0.0, 1.0, 2 * mesh.substeps + 1)
    return np.asarray(nodes[:-1, None] + np.diff(nodes)[:, None] * shares)


def _palm_values(scene: Scene) -> dict[str, Any]:
    """The hand's body, grown by the clearance and half the bar's width."""
    if scene.arm is None or scene.workspace is None:
        return {}
    tool, grown = scene.arm.tool, scene.object.width / 2 + PALM_ROOM
    grown += scene.workspace.palm_clearance or 0.0
    return {
        "body_back": tool.palm_back,
        "body_front": tool.palm_front,
        "body_half_width": tool.palm_half_width,
        "palm_times": PALM_TIMES,
        "later_first": LATER_FIRST,
        "palm_back": tool.palm_back + grown,
        "palm_front": tool.palm_front - grown,
        "palm_half_width": tool.palm_half_width + grown,
    }


def with_accelerations(nlp: ThrowNlp, x: Array, intervals: Array) -> Array:
    """`x` with the collocation's unknowns set to each interval's mean acceleration.

    intervals (opening,) [s]. For guesses, which know the relative states at the nodes.
    """
    s = nlp.structure
    if s.integrator != "gauss":
        return x
    size = 3 if s.pivot else 2
    units = np.array([SLIP_UNIT, SLIP_UNIT, TURN_UNIT][:size])
    before = np.zeros(size)
    for k, dt in enumerate(intervals, start=s.opens):
        after = x[nlp.places["rel", k + 1]][size:]
        x[nlp.places["acc", k]] = np.tile((after - before) / dt / units, 2)
        before = after
    return x


def lower_end(scene: Scene, target: Pose) -> float:
    """Distance [m] from the CoM to the end that lands lower; negative: the grasped end."""
    theta = 0.0 if target.theta is None else target.theta
    ahead = scene.object.length - scene.object.com
    return ahead if math.sin(theta) < 0 else -scene.object.com


def bounds(
    nlp: Nlp, scene: Scene, mover: Mover, window: Window | None = None
) -> tuple[Array, Array]:
    """Lower and upper bounds of the decision vector."""
    limits, dwell = mover.planning, scene.gripper.profile().dwell
    lead = 0.0 if window is None else window.early * window.step
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
    low: dict[str, Any] = {"q": limits.q_min, "t_f": 0.0}
    # The opening command comes the dwell and the mean delay before the opening, and not
    # before the start.
    low["T"] = max(dwell + scene.mean_delay - lead, 0.02)

    def bound(name: str, side: int) -> Any:
        if side > 0:
            return high.get(name[:3] if name.startswith("t_f") else name, unbounded[0])
        if name.endswith(("_short", "_far")):
            return 0.0
        return low.get(name[:3] if name.startswith("t_f") else name, -high.get(name, unbounded[0]))

    return nlp.fill(lambda name, _: bound(name, -1)), nlp.fill(lambda name, _: bound(name, 1))
