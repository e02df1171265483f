"""Where a thrown bar ends, by contacts of another kind: MuJoCo's springs and dampers.

The planner's contacts reverse a speed within one step. Here a stiff spring with a damper does so in
some milliseconds, by a fourth-order integrator with half the step, in a cup of other boxes.
"""

from __future__ import annotations

import math
import os
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from scipy.optimize import brentq
from throwplan.problems import Scene

from .motion import Array

#: Time step [s], half of the planner's, and time [s] until which a bar is followed.
STEP, LONGEST = 2.5e-4, 3.0
#: Time constant [s] of the contact's spring.
CONSTANT = 1e-3
#: Number of boxes in the wall; their thickness, outwards [m].
BOXES, THICK = 72, 0.02
#: Speed [m/s] and rate [rad/s] below which a bar rests.
STILL = 0.02, 0.2


def rests_in_cup(scene: Scene, states: Array, restitution: Array, friction: Array) -> Array:
    """Flags (N,): whether bars from states (N, 6) in the throw's plane come to rest in the cup.

    states: x, z, theta of the CoM and their rates. restitution, friction (N,): of all contacts.
    """
    models = [_model(scene, e, mu) for e, mu in zip(restitution, friction, strict=True)]
    x, z, theta, v_x, v_z, omega = states.T
    zero, cos, sin = np.zeros_like(x), np.cos(theta / 2), np.sin(theta / 2)
    begin = [zero, x, zero, z, cos, zero, -sin, zero, v_x, zero, v_z, zero, -omega, zero]
    now, count = np.column_stack(begin), round(0.25 / STEP)
    inside = np.empty((0, len(states)), bool)
    threads = [mujoco.MjData(models[0]) for _ in range(os.cpu_count() or 1)]
    with rollout.Rollout(nthread=len(threads)) as pool:
        for _ in range(math.ceil(LONGEST / (count * STEP))):
            path, _ = pool.rollout(models, threads, now, nstep=count)
            now = path[:, -1]
            late = path[:, -round(0.1 / STEP) :]
            speed = np.linalg.norm(late[..., 8:11], axis=2).max(axis=1)
            still = (speed < STILL[0]) & (
                np.linalg.norm(late[..., 11:], axis=2).max(axis=1) < STILL[1]
            )
            inside = np.append(inside, [_inside(scene, now)], axis=0)
            if still.all():
                break
    # A bar that rocks in the cup all the last second stays there.
    return (still & inside[-1]) | inside[-5:].all(axis=0)


def _inside(scene: Scene, states: Array) -> Array:
    """Flags (N,): the CoM above the cup's inside, the lowest corner between bottom and rim."""
    cup, bar, inside = scene.cup, scene.object, np.empty(len(states), bool)
    for k, row in enumerate(states):
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, row[4:8])
        along = [-bar.com, bar.length - bar.com]
        across = [-bar.width / 2, bar.width / 2]
        corners = np.array([[a, b, c] for a in along for b in across for c in across])
        low = (row[1:4] + corners @ turn.reshape(3, 3).T)[:, 2].min()
        near = math.hypot(row[1] - cup.x, row[2]) < cup.radius
        inside[k] = near and cup.rim - cup.depth - 0.005 <= low < cup.rim - 0.005
    return inside


def _model(scene: Scene, restitution: float, friction: float) -> Any:
    """The bar and a cup on the ground."""
    kinds, bar, cup = mujoco.mjtGeom, scene.object, scene.cup
    spec, ratio = mujoco.MjSpec(), _damping(restitution)
    spec.option.timestep, spec.option.gravity = STEP, [0, 0, -scene.gravity]
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.default.geom.friction = [friction, 0.001, 0.0001]
    spec.default.geom.solref = [CONSTANT / ratio, ratio]
    bottom, half = cup.rim - cup.depth, cup.depth / 2
    ground = [cup.x, 0, bottom - 0.005]
    spec.worldbody.add_geom(type=kinds.mjGEOM_PLANE, size=[2, 2, 1], pos=ground)
    plate = [cup.radius, 0.0025, 0]
    spec.worldbody.add_geom(type=kinds.mjGEOM_CYLINDER, size=plate, pos=[cup.x, 0, bottom - 0.0025])
    side, away = (cup.radius + THICK) * math.tan(math.pi / BOXES), cup.radius + THICK / 2
    for k in range(BOXES):
        turn = math.tau * (k + 0.5) / BOXES
        spec.worldbody.add_geom(
            type=kinds.mjGEOM_BOX,
            size=[THICK / 2, side, half],
            pos=[cup.x + away * math.cos(turn), away * math.sin(turn), bottom + half],
            quat=[math.cos(turn / 2), 0, 0, math.sin(turn / 2)],
        )
    body = spec.worldbody.add_body()
    body.add_freejoint()
    width = max(bar.width, 1e-3)
    about = float(np.clip(bar.mass * width**2 / 6, 1e-2 * bar.inertia, 2 * bar.inertia))
    body.explicitinertial, body.mass = True, bar.mass
    body.inertia = [about, bar.inertia, bar.inertia]
    size, middle = [bar.length / 2, width / 2, width / 2], bar.length / 2 - bar.com
    body.add_geom(type=kinds.mjGEOM_BOX, size=size, pos=[middle, 0, 0])
    return spec.compile()


def _damping(restitution: float) -> float:
    """Damping ratio of a spring that a mass leaves with `restitution` times its speed.

    It leaves where the force is zero: exp(-2 d acos(d) / sqrt(1 - d^2)); at most 4, so that steps
    stay short enough.
    """

    def left(d: float) -> float:
        angle = math.acos(d) if d < 1 else math.acosh(d)
        return math.exp(-2 * d * angle / math.sqrt(abs(1 - d * d)))

    if restitution <= left(4.0):
        return 4.0
    return float(brentq(lambda d: left(d) - restitution, 1e-4, 4.0))
