"""Many bars at once from their flights to rest, by MuJoCo's rollouts on all cores."""

from __future__ import annotations

import importlib
import math
import os
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from ...models import Array, Flags, FlightState
from ...problems import Bin, Cup, Object, Scene
from ..verdict import reach_of_bar
from .contact_model import ContactModel, floor_of, load_mujoco, plane_poses, pose_of


@dataclass(frozen=True)
class RolloutSettings:
    """Settings of the rollouts.

    step [s]: of the simulation. stretch [s]: bars that rest leave the batch after each. longest
    [s]: limit of the time to rest. still_speed [m/s], still_rate [rad/s]: a bar rests that stays
    slower for still_time [s], or that stays at its place for `settled` [s] until the end. sunk [m]:
    largest depth at which a bar at rest sinks into a surface.
    """

    step: float = 5e-4
    stretch: float = 0.2
    longest: float = 3.0
    still_speed: float = 0.01
    still_rate: float = 0.1
    still_time: float = 0.1
    settled: float = 1.0
    sunk: float = 0.002


SETTINGS = RolloutSettings()


@dataclass(frozen=True)
class Ends:
    """The ends of N flights, in the throw's plane.

    com [m], axis, up (N, 3): CoM, and directions as of `pose_of`; at_rest, entered
    (N,): whether the bar rests, and whether its lower end was in the cup on the way; lost (N,):
    whether it is beside and below the wanted place, and was not followed to rest; stays (N,):
    whether it was at the wanted place all the last second, as a bar that rocks there.
    """

    com: Array
    axis: Array
    up: Array
    at_rest: Flags
    entered: Flags
    lost: Flags
    stays: Flags

    def where_wanted(self, scene: Scene) -> Flags:
        """Flags (N,): at rest where [rest] wants the object, or there all the last second."""
        return self.stays | self.at_rest & _is_there(scene, self.com, self.axis, self.up)


def entry_states(scene: Scene, detach: Array) -> tuple[Array, Array]:
    """Times (N,) [s] of free flight, and states (N, 6) at their ends; detach (N, 6).

    The flight is free until the bar comes down to the height of the highest body around it; from
    detach on it is not if the bar never is above that height.
    """
    flight, bar = scene.flight, scene.object
    heights = [floor_of(scene) or 0.0]
    heights += [] if scene.opening is None else [scene.opening.rim]
    for obstacle in scene.obstacle:
        heights.append(float(obstacle.solid.support(np.array([[0.0, 0.0, 1.0]]))[0]))
    reach = max(bar.com, bar.length - bar.com) + bar.width
    state = FlightState(*detach.T)
    time = np.nan_to_num(flight.fall_time(state, max(heights) + reach), nan=0.0)
    end = flight.after(state, time)
    return time, np.column_stack([end.x, end.z, end.theta, end.v_x, end.v_z, end.omega])


def roll_to_rest(scene: Scene, states: Array, restitution: Array, friction: Array) -> Ends:
    """The ends of N flights from states (N, 6) in the throw's plane, among the scene's bodies.

    restitution, friction (N,): of all contacts of each. The arm is out of the way. InputError
    without MuJoCo.
    """
    return _roll(scene, states, restitution, friction)[0]


def _roll(
    scene: Scene, states: Array, restitution: Array, friction: Array, keep: bool = False
) -> tuple[Ends, list[Array]]:
    """See `roll_to_rest`; keep: with MuJoCo's states (N, K, 14) of the bars in each stretch."""
    mujoco, rollout = load_mujoco(), importlib.import_module("mujoco.rollout")
    base = ContactModel.of(scene, SETTINGS.step, 0.0, 0.0)
    pairs = zip(restitution, friction, strict=True)
    models = [base.with_contact(float(e), float(mu)).model for e, mu in pairs]
    threads = [mujoco.MjData(base.model) for _ in range(os.cpu_count() or 1)]
    now, kept = base.state(states), list[Array]()
    running, count = np.arange(len(now)), round(SETTINGS.stretch / SETTINGS.step)
    (at_rest, entered, lost), since = np.zeros((3, len(now)), bool), np.zeros(len(now))
    with rollout.Rollout(nthread=len(threads)) as pool:
        for _ in range(math.ceil(SETTINGS.longest / SETTINGS.stretch)):
            if not running.size:
                break
            chosen = [models[i] for i in running]
            path, _ = pool.rollout(chosen, threads, now[running], nstep=count)
            kept += [path] if keep else []
            now[running] = path[:, -1]
            at_rest[running] = is_still(path[:, -round(SETTINGS.still_time / SETTINGS.step) :])
            com, *directions = pose_of(path)
            if scene.opening is not None:
                inside = enters(scene, scene.opening, com, *directions)
                entered[running] |= inside.any(axis=1)
            falls = path[:, -1, 10] < 0.0
            lost[running] = falls & _is_lost(scene, com[:, -1])
            there = _is_there(scene, com, *directions).all(axis=1)
            since[running] = np.where(there, since[running] + SETTINGS.stretch, 0.0)
            running = running[~(at_rest | lost)[running]]
    return Ends(*pose_of(now), at_rest, entered, lost, since >= SETTINGS.settled), kept


@dataclass(frozen=True)
class RestMotion:
    """A bar from its detach to rest: times (K,) [s] after detach, CoM x, z [m] and theta (3, K).

    theta [rad] is the angle of the axis in the throw's plane, with its turns; words: the end.
    """

    times: Array
    com: Array
    words: str


def rest_motion(scene: Scene, detach: FlightState) -> RestMotion:
    """The motion from the state at detach, with contacts in the middle of [rest]'s ranges."""
    rest = scene.rest
    assert rest is not None
    free, states = entry_states(scene, np.array([astuple(detach)]))
    middles = (np.array([sum(pair) / 2]) for pair in (rest.restitution, rest.friction))
    restitution, friction = middles
    ends, parts = _roll(scene, states, restitution, friction, keep=True)
    rows = np.concatenate([part[0] for part in parts])
    flown = np.arange(0.0, float(free[0]), SETTINGS.step)
    flight = scene.flight.after(detach, flown).pose
    times = np.concatenate([flown, float(free[0]) + SETTINGS.step * np.arange(1, len(rows) + 1)])
    poses = np.hstack([flight, plane_poses(rows, states[0, 2])])
    if ends.where_wanted(scene)[0]:
        words = f"{'rests' if ends.at_rest[0] else 'still rocks'} {rest.place}"
    elif rest.in_ is not None and ends.entered[0]:
        words = f"bounces out of the {rest.in_}"
    else:
        words = f"does not rest {rest.place}"
    return RestMotion(times, poses, words)


def is_still(states: Array) -> Flags:
    """Flags (...) of the bars that are still in all of MuJoCo's states (..., K, 14)."""
    speed, rate = (np.linalg.norm(states[..., i : i + 3], axis=-1) for i in (8, 11))
    return np.asarray(((speed < SETTINGS.still_speed) & (rate < SETTINGS.still_rate)).all(axis=-1))


def _heights(bar: Object, axis: Array, up: Array) -> Array:
    """Heights [m] (..., 2 K) above the CoM of the lowest points at the ends of an outline's
    capsules; axis, up (..., 3)."""
    along, across = (bar.capsules[:, :4].reshape(-1, 2) - [bar.com, 0.0]).T
    ends = axis[..., 2:] * along + up[..., 2:] * across
    return np.asarray(ends - np.repeat(bar.capsules[:, 4], 2))


def _sunk(bar: Object) -> float:
    """Largest depth [m] of the lowest point of an object at rest below a surface.

    An outline reaches beyond its mesh, at flat ends by a radius.
    """
    return SETTINGS.sunk + max((part.radius for part in bar.outline), default=0.0)


def _lowest(scene: Scene, com: Array, axis: Array, up: Array) -> Array:
    """Height [m] (...) of the bar's lowest point, for CoM and directions (..., 3)."""
    bar = scene.object
    if bar.outline:
        return np.asarray(com[..., 2] + _heights(bar, axis, up).min(axis=-1))
    ends = np.minimum(-bar.com * axis[..., 2], (bar.length - bar.com) * axis[..., 2])
    corner = bar.width / 2 * np.hypot(axis[..., 0], axis[..., 1])
    return np.asarray(com[..., 2] + ends - corner)


def is_inside(scene: Scene, into: Cup | Bin, com: Array, axis: Array, up: Array) -> Flags:
    """Flags (...): CoM between the walls, lower end in cup or bin; com, axis, up (..., 3)."""
    low = _lowest(scene, com, axis, up)
    inside = into.holds(com[..., 0], com[..., 1])
    sunk = _sunk(scene.object)
    # A bar that lies on the rim is not in the cup.
    return np.asarray(inside & (into.rim - into.depth - sunk <= low) & (low < into.rim - sunk))


def enters(scene: Scene, into: Cup | Bin, com: Array, axis: Array, up: Array) -> Flags:
    """Flags (...) of the bars whose lower end is in the cup, `insertion` below the rim, or whose
    CoM is in the bin."""
    if isinstance(into, Bin):
        return np.asarray(into.holds(com[..., 0], com[..., 1]) & (com[..., 2] < into.rim))
    depth, bar = into.rim - _lowest(scene, com, axis, up), scene.object
    if bar.outline:
        ends = bar.capsules[:, :4].reshape(-1, 2) - [bar.com, 0.0]
        along, across = np.moveaxis(ends[_heights(bar, axis, up).argmin(axis=-1)], -1, 0)
        low = com + along[..., None] * axis + across[..., None] * up
    else:
        lower = np.where(axis[..., 2] < 0, bar.length - bar.com, -bar.com)
        low = com + lower[..., None] * axis
    return np.asarray((depth >= into.insertion) & into.holds(low[..., 0], low[..., 1]))


def _is_lost(scene: Scene, com: Array) -> Flags:
    """Flags (N,) of bars below the wanted place and beside it; falling, they stay out."""
    rest, into = scene.rest, scene.opening
    assert rest is not None
    if rest.on is not None:
        return np.asarray(com[:, 2] < _top(scene, rest.on)[0] - reach_of_bar(scene.object))
    if rest.in_ is None or into is None:
        return np.zeros(len(com), bool)
    beyond = into.reach + 2 * scene.object.half_length
    beside = np.hypot(com[:, 0] - into.plane_x, com[:, 1]) > beyond
    return np.asarray(beside & (com[:, 2] < into.rim))


def _is_there(scene: Scene, com: Array, axis: Array, up: Array) -> Flags:
    """Flags (...) of the bars where [rest] wants the object; com, axis, up (..., 3)."""
    rest = scene.rest
    assert rest is not None
    if rest.in_ is not None:
        assert scene.opening is not None
        return is_inside(scene, scene.opening, com, axis, up)
    if rest.on is not None:
        height, over = _top(scene, rest.on)
        lowest = _lowest(scene, com, axis, up)
        return np.asarray(over(com) & (lowest > height - _sunk(scene.object)))
    assert rest.within is not None
    away = np.hypot(scene.aim.miss(com[..., 0], 0.0)[0], com[..., 1])
    return np.asarray(away <= rest.within)


def _top(scene: Scene, name: str) -> tuple[float, Any]:
    """Height [m] of an obstacle's top, and whether CoMs (..., 3) are above the obstacle."""
    solid = next(one.solid for one in scene.obstacle if one.name == name)
    solid = scene.aim.plane.seen(solid)
    height = float(solid.support(np.array([[0.0, 0.0, 1.0]]))[0])

    def over(com: Array) -> Flags:
        local = (com - solid.centre) @ solid.axes.T
        return np.asarray((np.abs(local[..., :2]) <= solid.half[:2] + solid.radius).all(axis=-1))

    return height, over
