"""MuJoCo's model of the release, and runs of release and flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array, sticking_state
from ...problems import Cup, InputError, Scene
from ..rest import (
    COLUMN,
    CUP_WALL,
    ContactModel,
    body_of,
    enters_cup,
    has_hand,
    is_in_cup,
    is_still,
    load_mujoco,
    plane_poses,
    pose_of,
)
from ..throw import Throw

#: Friction of the bar against cup, floor, hand and column.
FRICTION = 0.4
#: Time [s] of the replay before the opening.
LEAD = 0.05


@dataclass(frozen=True)
class ReplayEnd:
    """The bar at the end of a replay into a cup.

    inside: its CoM is inside the cup's radius and its lower end in the cup; for a bar that still
    moves 4 s after landing, during the last second; at_rest: it does not move; entered: its lower
    end was `insertion` below the rim at some time; touched_rim: it hit the wall before; pose: x, y,
    z [m] and theta [rad], y across the throw's plane.
    """

    inside: bool
    entered: bool
    touched_rim: bool
    at_rest: bool
    pose: tuple[float, float, float, float]

    def words(self) -> list[str]:
        """The end of the replay as lines for people."""
        x, _, z, theta = self.pose
        where = f"x {x:.3f} m, z {z:.3f} m, theta {math.degrees(theta):.1f} deg"
        if self.inside:
            state = "comes to rest" if self.at_rest else "still rocks, 4 s after landing,"
            ending = f"{state} in the cup: {where}"
        elif self.at_rest:
            ending = f"does NOT end in the cup: it rests at {where}"
        else:
            ending = f"does NOT end in the cup: 4 s after landing it moves at {where}"
        if not (self.entered or self.touched_rim):
            return [ending, "does not go in at all"]
        touch = "touches the cup's wall or rim" if self.touched_rim else "clears wall and rim"
        return [ending, f"{touch} on the way in"]


@dataclass(frozen=True)
class SimulatedFlight:
    """The bar over `times` (N,) [s]: its CoM x, z [m] and theta [rad] (3, N) in the throw's plane.

    theta counts turns. touched: bodies that it hit, in order; rest: None without a cup.
    """

    times: Array
    poses: Array
    touched: tuple[str, ...] = ()
    rest: ReplayEnd | None = None


def release_run(throw: Throw, step: float, points: int) -> tuple[Array, Array]:
    """Times (N,) [s] from the opening to its end, and the bar's pose and twist (N, 6).

    The hand follows the sent motion as driven joints do; the bar starts in its grip `LEAD`
    before the opening and is held by friction alone from then on.
    """
    mujoco = load_mujoco()
    scene, profile = throw.scene, throw.scene.gripper.profile()
    steps = int(np.clip(round(profile.opening / step), 200, 50_000))
    step = profile.opening / steps
    lead = min(round(min(LEAD, throw.opening_time) / step), 20_000)
    times = throw.opening_time + step * np.arange(-lead, steps + 1.0)
    hand = throw.hand(times)
    pose, twist = hand.pose.T, hand.twist.T
    drive = hand_inertia(scene) * np.diff(twist, axis=0) / step
    share = scene.patch.faces / pads_of(scene) / points
    force = share * profile.force(times[:-1] + step / 2 - throw.opening_time)

    model = release_model(scene, step, points)
    data = mujoco.MjData(model)
    qpos, qvel, bar = data.qpos, data.qvel, slice(model.nq - 3, None)
    start = sticking_state(pose[0], twist[0], scene.grasp.angle, scene.com_offset)
    data.ctrl[:] = force[0]
    # The pads settle on the bar.
    for _ in range(200):
        qpos[:3], qvel[:3], qpos[bar], qvel[bar] = pose[0], twist[0], start[:3], start[3:]
        mujoco.mj_step(model, data)
    qpos[bar], qvel[bar] = start[:3], start[3:]
    states = np.empty((len(times), 6))
    for k in range(len(force)):
        states[k, :3], states[k, 3:] = qpos[bar], qvel[bar]
        qpos[:3], qvel[:3] = pose[k], twist[k]
        data.qfrc_applied[:3] = drive[k]
        data.ctrl[:] = force[k]
        mujoco.mj_step(model, data)
    states[-1, :3], states[-1, 3:] = qpos[bar], qvel[bar]
    if not np.isfinite(states).all():
        raise InputError("replay: MuJoCo's steps blew up in the release")
    return times[lead:], states[lead:]


def fly_alone(
    throw: Throw, detach: Array, start: float, end: float, step: float
) -> SimulatedFlight:
    """The flight from `start` to `end` [s] without collisions; detach (6,): see `fly`."""
    mujoco = load_mujoco()
    made = ContactModel.of(throw.scene, step, 0.0, 0.0)
    made.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    made.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data, state = mujoco.MjData(made.model), made.state(detach[None])[0]
    data.qpos[:], data.qvel[:] = state[1:8], state[8:]
    times = start + step * np.arange(math.ceil((end - start) / step) + 1.0)
    states = np.empty((len(times), len(state)))
    for row in states:
        row[1:8], row[8:] = data.qpos, data.qvel
        mujoco.mj_step(made.model, data)
    return SimulatedFlight(times, plane_poses(states, detach[2]))


def fly(
    throw: Throw, detach: Array, start: float, end: float, step: float, restitution: float
) -> SimulatedFlight:
    """The flight from `start` to `end` [s], with a cup until the bar rests, at most 4 s longer.

    detach (6,): pose and twist of the bar at `start`. A bar rests that was still for 0.1 s.
    """
    mujoco, scene, cup = load_mujoco(), throw.scene, throw.scene.cup
    made = ContactModel.of(scene, step, restitution, FRICTION, arm=True)
    model, state = made.model, made.state(detach[None])[0]
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = state[1:8], state[8:]
    last = end if cup is None else end + 4.0
    count = max(math.ceil((last - start) / step), 1)
    times = start + step * np.arange(count + 1.0)
    hand = _hand_in_plane(throw, times) if has_hand(scene) else None
    moved, bodies = target_travel(throw, times), map(model.body, range(model.nbody))
    column = [body.mocapid[0] for body in bodies if body.name == COLUMN]
    geoms = (model.geom(i).name for i in range(model.ngeom))
    names = [body_of(name) for name in geoms]
    states, touched, still = np.empty((count + 1, len(state))), dict[str, int](), 0
    for k in range(count + 1):
        states[k, 1:8], states[k, 8:] = data.qpos, data.qvel
        if k == count:
            break
        if hand is not None:
            data.mocap_pos[0], data.mocap_quat[0] = hand[0][k], hand[1][k]
            data.mocap_pos[0, 0] -= moved[k]
        data.mocap_pos[column, 0] = -moved[k]
        mujoco.mj_step(model, data)
        contacts = {names[geom] for geom in data.contact.geom.ravel()} if data.ncon else set()
        for name in sorted(contacts - {"bar"}):
            touched.setdefault(name, k)
        still = still + 1 if is_still(states[k : k + 1]) else 0
        if cup is not None and still * step >= 0.1 and times[k] > end:
            break
    states, times, at_rest = states[: k + 1], times[: k + 1], still * step >= 0.1
    poses = plane_poses(states, detach[2])
    if cup is None:
        return SimulatedFlight(times, poses, tuple(touched))
    wall = float(times[touched[CUP_WALL]]) if CUP_WALL in touched else math.inf
    rest = end_in_cup(scene, cup, np.column_stack([times, states[:, 1:]]), wall, at_rest, detach[2])
    return SimulatedFlight(times, poses, tuple(touched), rest)


def end_in_cup(
    scene: Scene, cup: Cup, states: Array, wall: float, at_rest: bool, theta: float
) -> ReplayEnd:
    """The end of a bar with MuJoCo's states (K, 14) in the throw's plane, with their times [s].

    wall [s]: when it first touched the cup's wall, infinite if never. theta [rad]: see
    `plane_poses`.
    """
    times, at_end = states[:, 0], states[:, 0] >= states[-1, 0] - (0.0 if at_rest else 1.0)
    x, y, z = (float(value) for value in states[-1, 1:4])
    inside = bool(is_in_cup(scene, cup, *pose_of(states[at_end])).all())
    entered = times[enters_cup(scene, cup, *pose_of(states))]
    rim = wall < entered.min(initial=math.inf)
    pose = x, y, z, float(plane_poses(states, theta)[2, -1])
    return ReplayEnd(inside, entered.size > 0, bool(rim), at_rest, pose)


def _hand_in_plane(throw: Throw, times: Array) -> tuple[Array, Array]:
    """Places (N, 3) [m] and quaternions (N, 4) of the hand in the model's frame at times (N,)."""
    x, z, theta = throw.manipulator.hand(throw.to_rest).at(times).pose
    zero, half = 0.0 * x, theta / 2
    return np.column_stack([x, zero, z]), np.column_stack([np.cos(half), zero, -np.sin(half), zero])


def target_travel(throw: Throw, times: Array) -> Array:
    """Distance [m] of a target that moves at `times` (N,) [s] beyond the landing."""
    return np.asarray(throw.target.speed * (times - throw.deciding.landing_time))


def pads_of(scene: Scene) -> int:
    """Number of pads in the model: two stand for more faces."""
    return min(int(scene.contact.faces), 2)


def release_model(scene: Scene, step: float, points: int) -> Any:
    """The hand, its pads and the bar, which moves in the throw's plane only.

    points: contact points of a pad, on a ring of radius c r_p, so that they bear the patch's
    torque; a motor presses each. A single point has torsional friction instead, the ellipsoid of
    the limit surface. Pads have no size: the bar cannot slip out of them.
    """
    mujoco, contact, bar = load_mujoco(), scene.patch, scene.object
    spec = empty_spec(scene, step)
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    bodies = [spec.worldbody.add_body(name=name) for name in ("hand", "bar")]
    for body, armature in zip(bodies, (hand_inertia(scene), 0.0), strict=True):
        for axis in ([1, 0, 0], [0, 0, 1]):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=armature)
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, -1, 0], armature=armature)
    hand, carried = bodies
    weigh(hand, 1e-3, [1e-6] * 3)
    weigh(carried, bar.mass, [bar.inertia] * 3)
    reach, untouched = 10 * bar.length + 1, {"contype": 0, "conaffinity": 0}
    box, sphere = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE
    carried.add_geom(name="bar", type=box, size=[reach, 1, reach], **untouched)
    radius, torsion = contact.torsion_arm if points > 1 else 0.0, contact.torsion_arm
    # Pads are spheres of 1 m on a plate 2 m thick: heavy enough to sink in by 0.1 m at most.
    mass = max(1e-5, scene.gripper.profile().full * (2 * step) ** 2 / 0.1) / points
    for side in (1, -1)[: pads_of(scene)]:
        for k in range(points):
            name, angle = f"pad{side}_{k}", 2 * math.pi * k / points
            place = [radius * math.cos(angle), 2.0 * side, radius * math.sin(angle)]
            pad = hand.add_body(pos=place)
            pad.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, -side, 0])
            weigh(pad, mass, [1e-9] * 3)
            pad.add_geom(name=name, type=sphere, size=[1, 0, 0], **untouched)
            pair = spec.add_pair(geomname1=name, geomname2="bar", condim=3 if points > 1 else 4)
            # Sliding friction twice, then torsion: a length times the friction.
            pair.friction = [*[contact.friction] * 2, torsion * contact.friction, 1e-5, 1e-5]
            pair.solref = [2 * step, 1]
            motor = spec.add_actuator(target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_motor()
    return spec.compile()


def empty_spec(scene: Scene, step: float) -> Any:
    """An empty world with the scene's gravity, for loads that friction alone holds."""
    mujoco = load_mujoco()
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step, [0, 0, -scene.gravity]
    # Stiffness of friction over that of the normal force: below 1e6 loaded contacts creep. At 1e9
    # line searches of 50 steps, MuJoCo's limit, end too early: bars sink through plates.
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 1e9
    spec.option.tolerance, spec.option.ls_iterations = 1e-14, 200
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    return spec


def weigh(body: Any, mass: float, inertia: list[float]) -> None:
    """Give a body its mass and its moments of inertia about its own axes."""
    body.explicitinertial, body.mass, body.inertia = True, mass, inertia


def hand_inertia(scene: Scene) -> float:
    """Mass and moment of inertia [kg, kg m^2] of the driven hand, which no bar can push."""
    bar = scene.object
    return 1e4 * max(bar.mass, bar.inertia + bar.mass * scene.com_offset**2)
