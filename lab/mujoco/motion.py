"""A motion in MuJoCo as one simulation, from its first sample until its last object lies."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array
from ...planner import TICK, Carry, SentMotion, is_still, load_mujoco
from ...problems import InputError
from .world import MotionWorld, grasp_pose, object_name, open_width, thickness

#: Time [s] at the end of a grasp, or before a motion, in which the closed pads press.
PRESSING = 0.02
#: Longest time [s] after the last landing in which objects in cups come to rest: the last one may
#: push others.
LONGEST = 4.0
#: Number of samples that are simulated between two looks at what rests.
BATCH = 100
#: Share of the step while pads open.
FINE = 0.2
#: What an object does, one after another.
PHASES = ("waiting", "carried", "flying")


@dataclass(frozen=True, eq=False)
class ObjectMotion:
    """An object of a simulated motion.

    states (K, 14): MuJoCo's every millisecond, in the base frame: time [s] on the motion's clock,
    CoM [m], quaternion, velocity, and angular velocity in the object's frame. slip [m], turn [rad]:
    of the object in the pads as they begin to open, from where they grasped it. touched: in each
    of PHASES the bodies that it touched, with the time [s] of the first contact.
    """

    states: Array
    slip: float
    turn: float
    touched: dict[str, dict[str, float]]


def simulate_motion(
    motion: SentMotion, step: float, restitution: float
) -> tuple[ObjectMotion, ...]:
    """The motions of the objects, until each lies in its cup or has landed.

    The hand follows the motion as driven joints do. An object stands fixed at its pick until it is
    held, then friction alone carries it. step [s]: the largest, while pads open `FINE` of it;
    restitution: of all collisions. InputError if MuJoCo's steps diverge.
    """
    simulation = _Simulation(motion, MotionWorld.of(motion, restitution))
    # What the hand holds from the start is pressed before.
    first = 0 if motion.picks else -round(PRESSING / TICK)
    for begin in itertools.count(first, BATCH):
        until = TICK * (begin + BATCH)
        opens = any(
            one.opening_time < until and one.detach_time > TICK * begin for one in motion.carries
        )
        simulation.advance(begin, step, opens=opens)
        if simulation.is_over:
            return simulation.motions()
    raise AssertionError


class _Simulation:
    """A simulation under way."""

    def __init__(self, motion: SentMotion, world: MotionWorld) -> None:
        self.motion, self.world = motion, world
        self.mujoco = load_mujoco()
        self.data = self.mujoco.MjData(world.model)
        #: Where positions and velocities of the objects begin; one has 7, and 6.
        self.first = world.addresses(object_name(0))
        held = [TICK * one.held for one in motion.carries]
        grasps = np.array([grasp_pose(one.throw.scene) for one in motion.carries])
        self.picks = _as_mujoco(_body_axes(motion.poses_at(np.array(held))[1]) @ grasps)
        self.data.qpos[self.first[0] :] = self.picks.ravel()
        self.data.qpos[7:9] = self._pads(np.array([-PRESSING]), TICK)[0]
        self.held, self.detach = np.array(held), [one.detach_time for one in motion.carries]
        self.touched = [{phase: dict[str, float]() for phase in PHASES} for _ in motion.carries]
        #: Addresses of moving cups, their speed [m/s], and when they are where they were put.
        self.belts = [(world.addresses(name), moves) for name, moves in world.belts.items()]
        self.rows = list[Array]()

    def advance(self, first: int, largest: float, *, opens: bool) -> None:
        """Simulate BATCH samples from one on, in steps of at most `largest` [s].

        The hand's velocities are means over steps: so it is where the motion has it, and what it
        throws falls as it should, since MuJoCo moves bodies by the velocity after a step.
        """
        substeps = math.ceil(TICK / (FINE * largest if opens else largest) - 1e-9)
        step, count = TICK / substeps, BATCH * substeps
        times: Array = TICK * first + step * np.arange(-1.0, count + 1.0)
        # MuJoCo moves what falls by the velocity after a step, g h / 2 beyond the mean.
        change = self.motion.throw.scene.gravity * (step - self.world.model.opt.timestep) / 2
        flying = np.flatnonzero(np.array(self.detach) <= times[0])
        self.data.qvel[self.first[1] + 2 + 6 * flying] += change
        self.world.set_step(step, largest)
        frames, hand = self.motion.poses_at(times)
        links = [_as_mujoco(frames[1::substeps, link - 1]) for link in self.world.links]
        poses = _as_mujoco(_body_axes(hand))
        turns = _rotations(poses[:-1]).inv() * _rotations(poses[1:])
        rates = np.hstack([np.diff(poses[:, :3], axis=0), turns.as_rotvec()]) / step
        drive = self.world.mass * np.diff(rates, axis=0) / step
        gaps, forces = self._pads(times[1:-1], step)
        data, qpos, qvel = self.data, self.data.qpos, self.data.qvel
        for k in range(count):
            time = times[k + 1]
            if k % substeps == 0:
                self._record_states(time)
                for body, rows in enumerate(links):
                    place = rows[k // substeps]
                    data.mocap_pos[body], data.mocap_quat[body] = place[:3], place[3:]
            qpos[:7], qvel[:6], data.qfrc_applied[:6] = poses[k + 1], rates[k], drive[k]
            data.qfrc_applied[6:8] = -forces[k]
            if not forces[k]:
                qpos[7:9], qvel[6:8] = gaps[k], 0.0
            self._hold_fixed(time)
            self.mujoco.mj_step(self.world.model, data)
            if data.ncon:
                self._record_contacts(time)

    def _record_states(self, time: float) -> None:
        """Keep the states (objects, 14)."""
        places = self.data.qpos[self.first[0] :].reshape(-1, 7)
        rates = self.data.qvel[self.first[1] :].reshape(-1, 6)
        self.rows.append(np.hstack([np.full((len(places), 1), time), places, rates]))

    def _hold_fixed(self, time: float) -> None:
        """Keep objects at their picks, and cups on their way."""
        waiting = int(np.searchsorted(self.held, time, "right"))
        self.data.qpos[self.first[0] + 7 * waiting :] = self.picks[waiting:].ravel()
        self.data.qvel[self.first[1] + 6 * waiting :] = 0.0
        for (place, rate), (speed, landing) in self.belts:
            self.data.qpos[place], self.data.qvel[rate] = speed * (time - landing), speed

    def _pads(self, times: Array, step: float) -> tuple[Array, Array]:
        """Distance [m] of the pads from their middle, and the force [N] of each, at times (N,): 0
        where they are moved and do not press."""
        wide = open_width(self.motion) / 2
        gaps, forces = np.full(times.size, wide), np.zeros(times.size)
        for one in self.motion.carries:
            scene, held = one.throw.scene, TICK * one.held
            reach = TICK * one.reach if one.pick else -math.inf
            presses = max(held - PRESSING, reach)
            closing, half = (reach <= times) & (times < one.detach_time), thickness(scene) / 2
            share = np.ones(times.size)
            if one.pick:
                share = np.clip((times - reach) / max(presses - reach, step), 0.0, 1.0)
            gaps = np.where(closing, wide + share * (half - wide), gaps)
            middle = times + step / 2 - one.opening_time
            full = scene.patch.faces / 2 * scene.gripper.profile().force(middle)
            forces = np.where((presses <= times) & (times < one.detach_time), full, forces)
        return gaps, forces

    def _record_contacts(self, time: float) -> None:
        """Keep first contacts of objects."""
        bodies, objects = self.world.bodies, self.world.objects
        for pair in self.data.contact.geom.tolist():
            if not all(bodies[geom] for geom in pair):
                continue
            for geom, other in (pair, pair[::-1]):
                if (number := objects[geom]) is not None:
                    phase = "flying" if time >= self.detach[number] else "carried"
                    phase = phase if time >= self.held[number] else "waiting"
                    self.touched[number][phase].setdefault(bodies[other], time)

    @property
    def is_over(self) -> bool:
        """Whether the motion is over and each object lies in its cup or has landed."""
        states = np.array(self.rows[-BATCH:])
        time = states[-1, 0, 0]
        if not np.isfinite(states).all():
            raise InputError("replay: MuJoCo's steps diverged")
        each = list(zip(self.motion.carries, states.swapaxes(0, 1), strict=True))
        last = max(_landing_time(one) for one, _ in each)
        waited = time > last + LONGEST
        return time >= self.motion.duration and (waited or all(_has_ended(*one) for one in each))

    def motions(self) -> tuple[ObjectMotion, ...]:
        """The motions of all objects."""
        states = np.array(self.rows).swapaxes(0, 1)
        each = zip(self.motion.carries, states, self.touched, strict=True)
        return tuple(
            ObjectMotion(own, *self._slip(one, own), touched) for one, own, touched in each
        )

    def _slip(self, one: Carry, states: Array) -> tuple[float, float]:
        """Way [m] and turn [rad] of the object in the pads as they begin to open."""
        row = states[np.searchsorted(states[:, 0], one.opening_time, "right") - 1]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = _rotations(row[None, 1:8]).as_matrix()[0], row[1:4]
        hand = _body_axes(self.motion.poses_at(row[:1])[1])[0]
        moved = np.linalg.inv(hand) @ pose @ np.linalg.inv(grasp_pose(one.throw.scene))
        turn = _rotations(_as_mujoco(moved[None])).magnitude()[0]
        return float(np.linalg.norm(moved[:3, 3])), float(turn)


def _landing_time(one: Carry) -> float:
    """When an object lands [s], on the motion's clock; its detach time, if it never does."""
    landing = one.begin + one.throw.deciding.landing_time
    return landing if math.isfinite(landing) else one.detach_time


def _has_ended(one: Carry, states: Array) -> bool:
    """Whether an object, of which these are the last states (K, 14), lies in its cup, or has landed
    without one."""
    if one.throw.scene.opening is None:
        return bool(states[-1, 0] > one.detach_time and states[-1, 3] < one.throw.target.z)
    landed = states[-1, 0] > _landing_time(one)
    return bool(landed and is_still(states_in_plane(one, states)))


def states_in_plane(one: Carry, states: Array) -> Array:
    """MuJoCo's states (K, 14) in the frame of a throw's plane, as its target sees them; their times
    [s] on the throw's clock."""
    from scipy.spatial.transform import Rotation

    plane, found = one.throw.target.plane, states.copy()
    origin, turn = plane.points(0.0, 0.0), Rotation.from_euler("z", -plane.azimuth)
    found[:, 0] -= one.begin
    found[:, 1:4], found[:, 8:11] = turn.apply(states[:, 1:4] - origin), turn.apply(states[:, 8:11])
    found[:, 1] -= one.throw.target.speed * (found[:, 0] - one.throw.deciding.landing_time)
    found[:, 8] -= one.throw.target.speed
    found[:, 4:8] = (turn * _rotations(states[:, 1:8])).as_quat(scalar_first=True)
    return found


def _body_axes(poses: Array) -> Array:
    """Poses (N, 4, 4) of the hand as in a motion, with their y axis across the throw's plane."""
    turned = poses.copy()
    turned[:, :3, 1], turned[:, :3, 2] = -poses[:, :3, 2], poses[:, :3, 1]
    return turned


def _rotations(states: Array) -> Any:
    """Rotations of MuJoCo's positions (N, 7)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(states[:, 3:], scalar_first=True)


def _as_mujoco(poses: Array) -> Array:
    """MuJoCo's positions (N, 7) of poses (N, 4, 4): place [m] and quaternion."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
    return np.hstack([poses[:, :3, 3], turns])
