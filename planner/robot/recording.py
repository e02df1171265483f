"""A robot's motion recorded at 1 kHz: its file, and its throw by the exact model.

A throw depends on the joints' accelerations. A low-pass of the recording itself would distort them,
so the low-pass is for the residuals of the fitted response only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, ReadOnly, Trajectory, low_pass
from ...problems import InputError, Scene, ThrowPlane
from ...problems.files import read_csv
from ..follow import Response
from ..result import write_table
from ..simulation import planar_joints
from ..throw import TICK, Throw
from ..verdict import Code, Finding, outside_tolerance, verdict
from .motions import JointMotion

#: Cut-off [Hz] of the low-pass on the residuals of the fitted response.
CUTOFF = 60.0
#: An arm is at rest if every joint is slower than this [rad/s].
REST_RATE = 0.02
#: Largest time [s] of the first row, before or after the start of the motion.
EARLIEST = 60.0
#: Largest time [s] between two rows: joints are interpolated.
GAP = 0.1


@dataclass(frozen=True, eq=False)
class Recording(ReadOnly):
    """An arm's joints while it threw, at 1 kHz from rest on.

    times (N,) [s] of the robot's clock, 0 where the first sample went out; q, dq [rad, rad/s]
    measured and sent [rad] commanded, each (N, joints); width (N,) [m] of the gripper as it was
    last known; command_times [s]: when opening commands went out, of a plan one, none if it did
    not; trouble: what went wrong, in words, empty if nothing did.
    """

    times: Array
    q: Array
    dq: Array
    sent: Array
    width: Array
    command_times: tuple[float, ...]
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
        rate, error = np.abs(self.dq[0]), np.abs(self.q[0] - self.sent[0])
        if rate.max() > REST_RATE or error.max() > 0.05:
            raise InputError("the recording does not begin at rest on the start pose")
        times, q, sent = self.throwing(plan)
        response = Response.fitted(sent, q).all(sent)
        measured = response + low_pass(times, q - response, CUTOFF)[1]
        end, speeds = float(times[-1]), np.abs(self.dq[-1])
        if speeds.max() < REST_RATE:
            # At rest it stays there for 2 s, longer than objects fly.
            times = np.linspace(0.0, end + TICK * 2000, len(times) + 2000)
            measured = np.pad(measured, ((0, 2000), (0, 0)), "edge")
        path = Trajectory.through(times, measured)
        throw = Throw(plan.scene, manipulator, path, opening_time, model=plan.model)
        if throw.lands and path.end < throw.landing_time:
            raise InputError(
                f"the recording ends at {end:.3f} s while joint {speeds.argmax() + 1} still moves "
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
        measured = interpolated(even, self.times, q)
        return even, measured, interpolated(even, self.times, self.sent[:, joints])

    def to_dict(self, motion: JointMotion) -> dict[str, Any]:
        """The recording as JSON, of a plan with its throw: SI units, radians.

        lag [rad]: largest difference of a joint to its command; width [m]: of the gripper, before
        and after; command_times [s]: of a cycle's openings.
        """
        lag, ends = np.abs(self.q - self.sent).max(), self.width[[0, -1]].tolist()
        found: dict[str, Any] = {"lag": float(lag), "width": ends}
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
        bare = throw.in_scene(throw.scene.without_clearances())
        others = Code.TORQUE, Code.TORQUE_RATE, Code.TOOL_SPEED, Code.ARRIVAL, Code.LANDING
        judged = verdict(bare, sent=plan).without(*others)
        if error is None or judged.cup:
            return judged.broken
        off = outside_tolerance(plan.scene.tolerance, error["position"], error["angle"])
        return (*off, *judged.broken)

    def summary(self, motion: JointMotion) -> str:
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
        columns = {"t": self.times, "q": self.q, "dq": self.dq, "sent": self.sent}
        commands = np.array(self.command_times or (math.nan,))
        last = np.maximum(np.searchsorted(commands, self.times, "right") - 1, 0)
        columns |= {"width": self.width, "since_command": self.times - commands[last]}
        write_table(path, columns)


def interpolated(times: Array, known: Array, values: Array) -> Array:
    """Values (N, n) at `known` times (N,), linearly at others (K,); at the ends the nearest."""
    return np.column_stack([np.interp(times, known, column) for column in values.T])


def read_recording(path: str | Path, motion: JointMotion) -> Recording:
    """A run.csv of the plan's arm; InputError for a file that does not fit it."""
    joints = range(1, motion.arm.joints + 1)
    names = [f"{name}{j}" for name in ("q", "dq", "sent") for j in joints]
    columns = ("t", *names, "width", "since_command")
    rows = read_csv("recording", str(path), None, columns)
    if len(rows) < 2 or (np.diff(rows[:, 0]) <= 0).any():
        raise InputError(f"{path}: t must rise over at least two rows")
    step = float(np.median(np.diff(rows[:, 0])))
    if not TICK / 2 < step < 2 * TICK:
        raise InputError(f"{path}: t rises by {step:.3g} s a row, must rise by {TICK:g} s mostly")
    if abs(rows[0, 0]) > EARLIEST:
        raise InputError(
            f"{path}: t begins at {rows[0, 0]:g} s: must count from the start of the motion"
        )
    gap = int(np.diff(rows[:, 0]).argmax())
    if rows[gap + 1, 0] - rows[gap, 0] > GAP:
        raise InputError(
            f"{path}: no row from t = {rows[gap, 0]:g} to {rows[gap + 1, 0]:g} s: must be at most "
            f"{GAP:g} s"
        )
    q, dq, sent = np.split(rows[:, 1:-2], 3, axis=1)
    command = float(rows[0, 0] - rows[0, -1])
    if command < rows[0, 0] - TICK:
        words = "must be at most 0 in the first row: the command comes after it"
        raise InputError(f"{path}: since_command = {rows[0, -1]:g}: {words}")
    recording = Recording(rows[:, 0], q, dq, sent, rows[:, -2], (command,))
    try:
        recording.throw(motion.throw)
    except InputError as error:
        raise error.within(str(path)) from None
    return recording
