"""Whether a throw that is called solved is true, by other means than the planner's own."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from throwplan.models import Array, FlightState, HandSamples, Trajectory
from throwplan.models.release import (
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    SlidingPivotRelease,
    SteppedRelease,
)
from throwplan.planner.result import PlannedThrow
from throwplan.planner.throw import Manipulator, case_of
from throwplan.planner.verdict import verdict
from throwplan.problems import Pose, Scene

#: Independent releases in even steps, by the models' names.
RELEASES = {SLIDING_PIVOT: SlidingPivotRelease, STEPPED_SURFACE: SteppedRelease}
#: Steps of the independent release, doubled at most so many times until it is settled.
STEPS, DOUBLINGS = 8000, 4
#: Settled: three landings in turn differ by less than this share of the tolerance.
SETTLED = 0.25
#: Interval [s] of the differences that say which force holds the bar, and of its instants.
DIFFERENCE, GRIP_STEP = 1e-4, 1e-3


@dataclass(frozen=True)
class Verdict:
    """What an independent look at a solved throw finds.

    wrong: what contradicts `solved`, empty if nothing; miss, other: position error [m] of the
    sent motion thrown again, and by the independent release; doubt [m]: how far that one
    still moves with its steps.
    """

    wrong: tuple[str, ...]
    miss: float
    other: float
    doubt: float


@dataclass(frozen=True)
class PlainTrack:
    """The hand of a motion by CasADi's usual call, without the compiled core."""

    manipulator: Manipulator
    motion: Trajectory
    opening_time: float

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` [s] after the opening's start."""
        outputs = self.manipulator.motion(*self.motion.at(self.opening_time + times))
        return HandSamples(times, *(np.array(part) for part in outputs))


def judged(thrown: PlannedThrow, target: Pose, steps: int = STEPS) -> Verdict:
    """Throws the sent motion again, by the planner's check and by other code."""
    scene, manipulator, at = thrown.scene, thrown.manipulator, thrown.opening_time
    motion = thrown.deciding.path
    again = replace(thrown.deciding)
    dx, _ = again.miss(target)
    wrong = [f"thrown again: {finding.words}" for finding in verdict(again, target).broken]
    track = PlainTrack(manipulator, motion, at)
    other, doubt, steps = _settled(scene, track, target, steps)
    # Only what its own steps cannot explain counts against the plan.
    if not _inside(scene, *np.maximum(np.abs(other) - doubt, 0.0)):
        wrong.append(f"{steps} plain steps {_off(*other)}")
    use = grip_by_differences(scene, manipulator, motion, at)
    if use > 1.001:
        wrong.append(f"grip use {use:.3f} by differences")
    return Verdict(tuple(wrong), abs(dx), abs(float(other[0])), float(doubt[0]))


def _settled(scene: Scene, track: PlainTrack, target: Pose, steps: int) -> tuple[Array, Array, int]:
    """Miss (dx [m], dtheta [rad]) by even steps, how far it still moves, and the steps."""
    misses = [np.array(_landed(scene, track, target, n)) for n in (steps // 4, steps // 2, steps)]
    allowed = SETTLED * np.array([scene.tolerance.position, scene.tolerance.angle])
    for doublings in range(DOUBLINGS + 1):
        doubt = np.ptp(misses[-3:], axis=0)
        if (doubt <= allowed).all() or doublings == DOUBLINGS:
            break
        steps *= 2
        misses.append(np.array(_landed(scene, track, target, steps)))
    return misses[-1], doubt, steps


def _landed(scene: Scene, track: PlainTrack, target: Pose, steps: int) -> tuple[float, float]:
    """(dx [m], dtheta [rad]) to the target by even steps of the model that counts, in Python."""
    plain = RELEASES[scene.tolerance.model](steps=steps)
    state = plain.release(case_of(scene, track)).detach
    flown = time_down(state, target.z, scene.gravity)
    angle = 0.0 if target.theta is None else state.theta + state.omega * flown - target.theta
    return float(state.x + state.v_x * flown - target.plane_x), float(angle)


def time_down(state: FlightState, height: float, gravity: float) -> float:
    """Time [s] until the CoM comes down through a height; NaN if it never does."""
    above, rise = float(state.z) - height, float(state.v_z)
    inside = rise**2 + 2 * gravity * above
    if inside < 0 or (gravity == 0 and rise >= 0):
        return math.nan
    # Whichever form does not subtract two nearly equal numbers.
    root = math.sqrt(inside)
    found = (rise + root) / gravity if rise > 0 else 2 * above / (root - rise)
    return found if found >= 0 else math.nan


def grip_by_differences(
    scene: Scene, manipulator: Manipulator, motion: Trajectory, opening: float
) -> float:
    """Largest share of the full grip's friction that holds the bar before the opening.

    By Newton's law from second differences of the bar's pose: no velocity, acceleration or
    contact equation of the models is used.
    """
    times = np.arange(DIFFERENCE, opening - DIFFERENCE, GRIP_STEP)
    poses = []
    for shift in (-DIFFERENCE, 0.0, DIFFERENCE):
        q = motion.at(times + shift).pose
        zero = np.zeros_like(q)
        x, z, theta = np.array(manipulator.motion(q, zero, zero)[0])
        angle, h = theta + scene.grasp.angle, scene.com_offset
        poses.append(np.array([x + h * np.cos(angle), z + h * np.sin(angle), angle]))
    before, now, after = poses
    a_x, a_z, alpha = (before - 2 * now + after) / DIFFERENCE**2
    thing, h = scene.object, scene.com_offset
    f_x, f_z = thing.mass * a_x, thing.mass * (a_z + scene.gravity)
    # The force acts at the pads, h behind the CoM.
    torque = thing.inertia * alpha + h * (np.cos(now[2]) * f_z - np.sin(now[2]) * f_x)
    limit = float(scene.patch.force_limit(scene.gripper.profile().full))
    arm = float(scene.patch.torsion_arm)
    return float(np.sqrt(f_x**2 + f_z**2 + (torque / arm) ** 2).max(initial=0.0) / limit)


def _inside(scene: Scene, dx: float, dtheta: float) -> bool:
    allowed = scene.tolerance
    return abs(dx) <= allowed.position and abs(dtheta) <= allowed.angle


def _off(dx: float, dtheta: float) -> str:
    return f"lands {1e3 * abs(dx):.2f} mm, {math.degrees(abs(dtheta)):.2f} deg off"
