"""A robot's motion as it was recorded: its file, and its throw by the exact model.

A throw depends on the joints' accelerations. A low-pass of the recording itself would distort them,
so the low-pass is for the residuals of the fitted response only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..models import Array, ReadOnly, Trajectory, low_pass
from ..planner import (
    TICK,
    Code,
    Finding,
    SentMotion,
    Throw,
    outside_tolerance,
    planar_joints,
    verdict_on,
    write_table,
)
from ..problems import InputError, Scene, ThrowPlane, csv_lines, read_csv
from .following import Response
from .motions import arm_of

#: Cut-off [Hz] of the low-pass on the residuals of the fitted response.
CUTOFF = 60.0
#: An arm is at rest if every joint is slower than this [rad/s]: sent from the first row to the
#: second, measured at the end.
START_RATE, END_RATE = 0.1, 0.02
#: Largest difference [rad] of a joint to what is sent at the start.
START_ERROR = 0.05
#: Largest time [s] between rows, in the median and between two: joints are interpolated.
STEP, GAP = 0.01, 0.1
#: Without a column `since_command`, what was sent is the plan's motion within this [rad].
AS_PLANNED = 0.01


@dataclass(frozen=True, eq=False)
class Recording(ReadOnly):
    """An arm's joints while it threw, from rest on.

    times (N,) [s] of the robot's clock, 0 where the first sample went out; q measured and sent
    commanded [rad], each (N, joints); command_times [s]: when opening commands went out, of a plan
    one, none if it did not; width (N,) [m]: of the gripper as it was last known, if it is;
    trouble: what went wrong, in words, empty if nothing did.
    """

    times: Array
    q: Array
    sent: Array
    command_times: tuple[float, ...]
    width: Array | None = None
    trouble: str = ""

    @property
    def command_time(self) -> float:
        """Time [s] of the first opening command; NaN without one."""
        return self.command_times[0] if self.command_times else math.nan

    def opening_time(self, scene: Scene) -> float:
        """Time [s] at which the grip force starts to fall."""
        return self.command_time + scene.gripper.profile().dwell + scene.mean_delay

    def throw(self, plan: Throw) -> Throw:
        """The plan's object thrown by the motion that was measured.

        InputError for a recording that ends before the pads are open, ends in motion before the
        object lands, does not begin at rest, or leaves the throw's plane.
        """
        manipulator, opening_time = plan.manipulator, self.opening_time(plan.scene)
        detach = opening_time + plan.scene.gripper.profile().opening
        # A response is fitted to at least 16 samples.
        if self.times.size < 16 or self.times[-1] < detach:
            last = self.times[-1] if self.times.size else 0.0
            raise InputError(
                f"the recording ends at {last:.3f} s, before the pads are open ({detach:.3f} s)"
            )
        rate = np.abs(self.sent[1] - self.sent[0]) / (self.times[1] - self.times[0])
        error = np.abs(self.q[0] - self.sent[0])
        if rate.max() > START_RATE or error.max() > START_ERROR:
            raise InputError("the recording does not begin at rest on the start pose")
        times, q, sent = self.throwing(plan)
        response = Response.fitted(sent, q).all(sent)
        measured = response + low_pass(times, q - response, CUTOFF)[1]
        # The slope at the end of a cubic through the last 20 ms: noise hardly changes it.
        end, last = float(times[-1]), q[-20:]
        speeds = np.abs(np.polyfit(TICK * np.arange(1 - len(last), 1), last, 3)[-2])
        if speeds.max() < END_RATE:
            # At rest it stays there for 2 s, longer than objects fly.
            times = np.linspace(0.0, end + TICK * 2000, len(times) + 2000)
            measured = np.pad(measured, ((0, 2000), (0, 0)), "edge")
        path = Trajectory.through(times, measured)
        throw = Throw(plan.scene, manipulator, path, opening_time, model=plan.model)
        if throw.lands and path.end < throw.landing_time:
            assert plan.scene.arm is not None
            joint = plan.scene.arm.throwing_joints[speeds.argmax()]
            raise InputError(
                f"the recording ends at {end:.3f} s while joint {joint} still moves "
                f"({speeds.max():.2f} rad/s), before the object lands ({throw.landing_time:.3f} "
                "s): record until the arm rests, or until the landing"
            )
        if not plan.target.speed or not throw.lands:
            return throw
        # A target that moves is elsewhere when the measured throw lands; a corrected motion begins
        # earlier than its plan's, so that the clocks agree at the opening.
        there = plan.target.at(throw.landing_time - opening_time + plan.opening_time)
        return replace(throw, scene=plan.scene.aimed_at(there))

    def throwing(self, plan: Throw) -> tuple[Array, Array, Array]:
        """Times (N,) [s] every millisecond, and the throwing joints measured and sent, each (N, n).

        InputError for joints that leave the throw's plane.
        """
        arm = plan.scene.arm
        assert arm is not None
        try:
            q = planar_joints(arm, self.q)
        except ValueError as error:
            raise InputError(f"the recording's {error}") from None
        joints = [j - 1 for j in arm.throwing_joints]
        ticks = int(self.times[-1] / TICK + 1e-6)
        even = np.linspace(0.0, TICK * ticks, ticks + 1)
        measured = smooth(even, self.times, q)
        return even, measured, smooth(even, self.times, self.sent[:, joints])

    def to_dict(self, motion: SentMotion) -> dict[str, Any]:
        """The recording as JSON, of a plan with its throw: SI units, radians.

        lag [rad]: largest difference of a joint to its command; width [m]: of the gripper, before
        and after; command_times [s]: of a cycle's openings.
        """
        found: dict[str, Any] = {"lag": float(np.abs(self.q - self.sent).max())}
        if self.width is not None:
            found["width"] = self.width[[0, -1]].tolist()
        if motion.picks:
            picks = [carry.pick for carry in motion.carries[: len(self.command_times)]]
            return found | {"thrown": picks, "command_times": list(self.command_times)}
        return found | self._throw_entries(motion.throw)

    def _throw_entries(self, plan: Throw) -> dict[str, Any]:
        """The throw of the measured motion as JSON.

        landing in the base frame; error.position is the distance from the target at its height,
        also across the throw's plane. Both are None if the object never lands.
        """
        throw = self.throw(plan)
        target = throw.target
        found: dict[str, Any] = {"landing": None, "error": None}
        if throw.lands:
            arm, (x, z, theta) = plan.scene.arm, throw.landing.pose
            assert arm is not None
            opening = np.searchsorted(self.times, throw.opening_time)
            azimuth = arm.azimuth_at(float(self.q[opening, arm.azimuth_joint - 1]))
            place = ThrowPlane(azimuth, arm.lateral).points(x, z).tolist()
            aim = target.nearest(x, theta)
            off = math.dist(place[:2], (aim.x, aim.y)), abs(throw.miss()[1])
            found["landing"] = dict(zip("xyz", place, strict=True)) | {"theta": theta}
            found["error"] = {"position": off[0], "angle": off[1]}
        findings = self._findings(throw, plan, found["error"])
        found["succeeds"] = not findings
        found["findings"] = [finding.to_dict() for finding in findings]
        return found | {"command_time": self.command_time}

    def _findings(
        self, throw: Throw, plan: Throw, error: dict[str, float] | None
    ) -> tuple[Finding, ...]:
        """The limits that the measured throw breaks.

        A measured throw may use up the clearances of its plan, as in a sweep. Limits of joints are
        judged on the plan's motion: recorded joints are too noisy to differentiate. The time of
        arrival is not judged: a corrected motion begins earlier than its plan's.
        """
        bare = throw.in_scene(throw.scene.without_reserves())
        others = Code.TORQUE, Code.TORQUE_RATE, Code.TOOL_SPEED, Code.ARRIVAL, Code.LANDING
        judged = verdict_on(bare, sent=plan).without(*others)
        if error is None or judged.cup:
            return judged.broken
        off = outside_tolerance(plan.scene.tolerance, error["position"], error["angle"])
        return (*off, *judged.broken)

    def summary(self, motion: SentMotion) -> str:
        """`to_dict` as a line for people."""
        found = self.to_dict(motion)
        lag = f"joints lag by {found['lag']:.3f} rad"
        if motion.picks:
            thrown = "1 object" if len(found["thrown"]) == 1 else f"{len(found['thrown'])} objects"
            return f"{thrown} thrown in {self.times[-1]:.2f} s; {lag}"
        words = "does not come down to the target's height"
        if found["landing"] is not None:
            landing, error = found["landing"], found["error"]
            words = (
                f"lands at x {landing['x']:.3f} m, y {landing['y']:.3f} m, theta "
                f"{math.degrees(landing['theta']):.1f} deg: {1e3 * error['position']:.1f} mm and "
                f"{math.degrees(error['angle']):.2f} deg off the target"
            )
        aim = "within the tolerance" if motion.throw.scene.cup is None else "into the cup"
        if not found["succeeds"]:
            aim = "; ".join(finding["words"] for finding in found["findings"])
        return f"by the measured motion the throw {words}; {aim}; {lag}"

    def save(self, path: Path) -> None:
        """Write run.csv."""
        columns = {"t": self.times, "q": self.q, "sent": self.sent}
        commands = np.array(self.command_times or (math.nan,))
        last = np.maximum(np.searchsorted(commands, self.times, "right") - 1, 0)
        columns["since_command"] = self.times - commands[last]
        if self.width is not None:
            columns["width"] = self.width
        write_table(path, columns)


def interpolated(times: Array, known: Array, values: Array) -> Array:
    """Values (N, n) at `known` times (N,), linearly at others (K,); at the ends the nearest."""
    return np.column_stack([np.interp(times, known, column) for column in values.T])


def smooth(times: Array, known: Array, values: Array) -> Array:
    """Values (N, n) at `known` times (N,), by cubic splines at others (K,); constant before."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(known, values)(np.maximum(times, known[0])))


def read_recording(path: str | Path, motion: SentMotion) -> Recording:
    """A CSV of a plan's motion by its arm; InputError for a file that does not fit the plan.

    Columns: t [s], 0 where the first sample went out; q1, q2, ... measured and sent1, sent2, ...
    commanded [rad], of all joints; since_command [s] may be left out where the plan's own motion
    was sent: then the opening command went out at the plan's time. Others are not read.
    """
    joints = range(1, arm_of(motion).joints + 1)
    columns = ("t", *(f"{name}{j}" for name in ("q", "sent") for j in joints))
    timed = "since_command" in csv_lines(Path(path))[0]
    rows = read_csv("recording", str(path), None, (*columns, *["since_command"] * timed))
    times, (q, sent) = rows[:, 0], np.split(rows[:, 1 : len(columns)], 2, axis=1)
    if len(rows) < 2 or (np.diff(times) <= 0).any():
        raise InputError(f"{path}: t must rise over at least two rows")
    steps = np.diff(times)
    if np.median(steps) > STEP or steps.max() > GAP:
        raise InputError(
            f"{path}: t rises by {np.median(steps):.3g} s a row, by {steps.max():.3g} s after "
            f"t = {times[steps.argmax()]:g} s: must be at most {STEP:g} s mostly, {GAP:g} s always"
        )
    command = float(times[0] - rows[0, -1]) if timed else motion.throw.command_time
    off = np.abs(sent - interpolated(times, motion.times, motion.q)).max(axis=0)
    if not timed and off.max() > AS_PLANNED:
        raise InputError(
            f"{path}: sent{off.argmax() + 1} is up to {off.max():.3f} rad off the plan's motion: "
            "give t from its start, or a column since_command, the time since the gripper's "
            "opening command [s]"
        )
    if command < times[0] - TICK:
        words = "must be at most 0 in the first row: the command comes after it"
        raise InputError(f"{path}: since_command = {times[0] - command:g}: {words}")
    # Any clock will do: from here on it is 0 in the first row.
    recording = Recording(times - times[0], q, sent, (command - times[0],))
    try:
        recording.throw(motion.throw)
    except InputError as error:
        raise error.within(str(path)) from None
    return recording
