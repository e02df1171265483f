"""All limits on a throw: value, limit and room of each, for N throws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .clearance import Around, Bar, Flight, Found, Part, at_least, at_most
from .motion import TICK, ArmMotion, Array, HandMotion, Samples
from .release import Held, Released, released

#: Share of the grip's limit by which its use may be above the plan's margin between two instants.
BETWEEN = 0.002
#: Number of instants of a tick at which grip and tool speed are checked.
INSTANTS = 8
#: Error (position [m], angle [rad]) of a landing.
LANDING = 1e-4, math.radians(0.05)
#: Number of steps of an opening between checks of the bar.
EVERY = 20
#: Least speed [m/s] at which a bar must fall through the target's height.
FALLS = 0.02
#: Time [s] before the earliest or after the latest arrival that is allowed.
LATE = TICK


@dataclass(frozen=True)
class Judged:
    """N throws: landing (N, 3): x [m], theta [rad], flight time [s]; lands (N,) [s]: time of the
    landing after the motion's start; detach (N, 6): CoM pose and twist; found: limits by name."""

    landing: Array
    lands: Array
    detach: Array
    found: dict[str, Found]

    def broken(self) -> list[tuple[str, ...]]:
        """The names of the limits that each throw breaks."""
        flags = {
            name: np.broadcast_to(f.broken, len(self.landing)) for name, f in self.found.items()
        }
        return [tuple(n for n, f in flags.items() if f[i]) for i in range(len(self.landing))]

    @property
    def success(self) -> Array:
        return np.array([not names for names in self.broken()])

    @property
    def sure(self) -> Array:
        """Flags (N,) of the throws whose verdict the oracle's own error cannot change."""
        clear, doubt = np.zeros((2, len(self.landing)), bool)
        for each in self.found.values():
            clear |= each.broken & ~each.doubtful
            doubt |= each.doubtful
        return clear | ~doubt


class Oracle:
    """Judges throws of one motion. opening_time [s]: planned; mean_delay [s]: known of the gripper.

    The scene's target and cup are where they are when the motion starts.
    """

    def __init__(self, scene: Any, samples: Samples, opening_time: float) -> None:
        self.scene, self.samples, self.opening_time = scene, samples, opening_time
        delay = None if scene.uncertainty is None else scene.uncertainty.delay
        self.mean_delay = 0.0 if delay is None else delay.about(0.0).expected
        robot, arm = scene.robot, scene.arm
        self.arm: ArmMotion | None = None
        if robot is not None:
            joints = robot.throwing_joints or arm.throwing_joints
            self.arm = ArmMotion(arm, [j - 1 for j in joints], samples)
        self.motion = self.arm or HandMotion(samples)
        self.hand, self.plane = self.motion.hand, self.motion.plane
        along, _ = self.plane.ways
        target = scene.target
        self.target_x = float(along[:2] @ [target.x, target.y])
        self.speed = 0.0 if target.velocity is None else target.velocity[0]
        self.ticks = np.append(np.arange(0.0, self.hand.end - 1e-9, TICK), self.hand.end)
        self.around = Around(scene, self.motion, self.ticks, self.speed)

    # Real parameters.

    def columns(self, rows: Mapping[str, Array], count: int) -> dict[str, Array]:
        """All parameters (N,): those of `rows`, the others as planned."""
        scene, bar = self.scene, self.scene.object
        planned = {
            "delay": self.mean_delay,
            "opening": self.full_opening,
            "friction": scene.contact.friction,
            "patch_radius": scene.contact.patch_radius,
            "mass": bar.mass,
            "inertia": bar.inertia,
            "com_offset": bar.com - scene.grasp.offset,
            "grasp_offset": scene.grasp.offset,
            "grasp_angle": scene.grasp.angle,
        } | dict.fromkeys((f"hand_{k}" for k in ("x", "z", "theta", "vx", "vz", "omega")), 0.0)
        given = {k: rows.get(k, v) for k, v in planned.items()}
        return {k: np.broadcast_to(np.asarray(v, float), (count,)) for k, v in given.items()}

    @cached_property
    def full_opening(self) -> float:
        """Planned duration [s] of the force's fall."""
        gripper = self.scene.gripper
        if gripper.opening is not None:
            return float(gripper.opening)
        t, f = np.array(gripper.times), np.array(gripper.forces)
        start = max(int(np.flatnonzero(f < 0.99 * f[0])[0]) - 1, 0)
        stop = int(np.flatnonzero(f[:-1] > 1e-9 * f.max())[-1]) + 1
        return float(t[stop] - t[start])

    def held(self, c: Mapping[str, Array]) -> Held:
        scene, gripper = self.scene, self.scene.gripper
        return Held(
            c["mass"],
            c["inertia"],
            c["com_offset"] + scene.grasp.offset - c["grasp_offset"],
            c["grasp_angle"] + c["hand_theta"],
            c["friction"],
            scene.contact.torsion * c["patch_radius"],
            c["opening"],
            self.opening_time + c["delay"] - self.mean_delay,
            c["hand_omega"],
            gripper.force if gripper.force is not None else gripper.forces[0],
            scene.contact.faces,
            scene.gravity,
            gripper,
        )

    def landing(self, steps: int) -> Array:
        """Landing (1, 3) as planned, with another number of steps of the release."""
        held = self.held(self.columns({}, 1))
        thrown = released(held, self.hand, self.scene.tolerance.model, steps)
        return self._landing(np.hstack([thrown.com[-1], thrown.twist]))

    # The verdict.

    def judge(self, rows: Mapping[str, Any] | None = None, planned: bool = False) -> Judged:
        """N throws with the parameters `rows` (N,) by name, SI units; others are as planned.

        delay: of the opening after its command, which goes out `mean_delay` early; opening,
        friction, patch_radius, mass, inertia: the values; com_offset: from pads to CoM with the
        planned grasp; grasp_offset: of the pads from the bar's end; grasp_angle: to the hand;
        hand_x, _z, _theta: how far the hand, and with it bar and palm, is off its motion all along;
        hand_vx, _vz, _omega: the rates by which it leaves it when the force starts to fall. The
        arm's links are where the joints that are sent put them.
        planned: clearances, tolerance, margins of torque and grip are kept, as of a plan; else, as
        of what really happens, contact counts, and with a cup only whether the bar goes in.
        """
        rows = {} if rows is None else {k: np.atleast_1d(v) for k, v in rows.items()}
        count = max((len(v) for v in rows.values()), default=1)
        c = self.columns(rows, count)
        held = self.held(c)
        thrown = released(held, self.hand, self.scene.tolerance.model)
        # Friction depends on relative motion only: an error of the hand moves the release.
        off, drift = (
            np.column_stack([c[f"hand_{k}x"], c[f"hand_{k}z"], 0 * held.mass]) for k in ("", "v")
        )
        since = (thrown.times - held.begins)[..., None]
        thrown = Released(thrown.times, thrown.com + off + drift * since, thrown.twist + drift)
        detach = np.hstack([thrown.com[-1], thrown.twist])
        landing = self._landing(detach)
        lands = held.begins + held.opening + landing[:, 2]
        found = self._limits() | self._landed(detach, landing, lands, planned)
        found["grip"] = self._grip(held, self.scene.gripper.sticking_margin if planned else 0.0)
        if self.arm is not None and self.scene.arm.links:
            found["torque"] = self._torque(held, self._torque_margin if planned else 0.0)
        found |= self.around.arm(planned)
        singles = [
            self._around(held, {k: v[i] for k, v in c.items()}, thrown, landing, i, planned)
            for i in range(count)
        ]
        for name in singles[0]:
            parts = [[getattr(s[name], k) for s in singles] for k in ("value", "limit", "room")]
            arrays = (np.concatenate(part) for part in parts)
            found[name] = Found(*arrays, singles[0][name].known)
        return Judged(landing, lands, detach, found)

    def _around(
        self,
        held: Held,
        c: Mapping[str, float],
        thrown: Released,
        landing: Array,
        i: int,
        planned: bool,
    ) -> dict[str, Found]:
        """Clearances of throw i's bar; c: its parameters."""
        bar = self.bar(held, c, i)
        carry = self.ticks[self.ticks < held.begins[i]]
        rows = np.append(np.arange(0, len(thrown.times) - 1, EVERY), len(thrown.times) - 1)
        carried = bar.held(self.hand.at(carry)[0]) + np.array([c["hand_x"], c["hand_z"], 0.0])
        poses, times = np.vstack([carried, thrown.com[rows, i]]), thrown.times[rows, i]
        detach = np.append(thrown.com[-1, i], thrown.twist[i])
        duration = float(np.nan_to_num(landing[i, 2]))
        flight = Flight(detach, times[-1], duration, self.scene.gravity)
        # The hand keeps its error after detach.
        error = np.array([c[f"hand_{k}"] for k in ("x", "z", "theta", "vx", "vz", "omega")])
        palm = error[:3] + error[3:] * held.opening[i], error[3:]
        return self.around.bar(bar, np.append(carry, times), poses, flight, palm, planned)

    def bar(self, held: Held, c: Mapping[str, float], i: int = 0) -> Bar:
        """Throw i's object; c: its parameters."""
        whole, com = self.scene.object, float(c["com_offset"]) + self.scene.grasp.offset
        sizes = -com, whole.length - com, whole.width / 2
        parts = tuple(
            Part(np.array([part.begin, part.end]) - [com, 0.0], part.radius)
            for part in whole.outline
        )
        return Bar(*sizes, float(held.angle[i]), float(held.offset[i]), parts)

    def _landing(self, detach: Array) -> Array:
        """x, theta, flight time (N, 3) as the CoM falls through the target's height, or NaN."""
        g, above = self.scene.gravity, detach[:, 1] - self.scene.target.z
        with np.errstate(invalid="ignore", divide="ignore"):
            t = (detach[:, 4] + np.sqrt(detach[:, 4] ** 2 + 2 * g * above)) / g
            t = np.where(t >= 0, t, np.nan) if g > 0 else -above / detach[:, 4]
        return np.column_stack(
            [detach[:, 0] + t * detach[:, 3], detach[:, 2] + t * detach[:, 5], t]
        )

    def _landed(
        self, detach: Array, landing: Array, lands: Array, planned: bool
    ) -> dict[str, Found]:
        scene, target, found = self.scene, self.scene.target, {}
        goal = self.target_x + self.speed * lands
        found["comes down"] = at_least(np.where(np.isfinite(landing[:, 2]), 1.0, -1.0), 0.0)
        if (scene.cup is None and scene.bin is None) or planned:
            error = np.abs(landing[:, 0] - goal) - target.half_widths[0]
            allowed = scene.tolerance.position
            found["position"] = at_most(error, allowed, LANDING[0] / allowed)
            if target.theta is not None:
                error = np.abs(landing[:, 1] - target.theta) - target.half_widths[1]
                allowed = scene.tolerance.angle
                found["angle"] = at_most(error, allowed, LANDING[1] / allowed)
        v_z = detach[:, 4] - scene.gravity * landing[:, 2]
        speed, bounds = np.hypot(detach[:, 3], v_z), scene.landing
        found["falls"] = at_least(-v_z, FALLS)
        if bounds is not None:
            found["landing speed, least"] = at_least(speed, bounds.speed_min)
            if bounds.speed_max is not None:
                found["landing speed"] = at_most(speed, bounds.speed_max)
            if bounds.rate_max is not None:
                found["landing rate"] = at_most(np.abs(detach[:, 5]), bounds.rate_max)
        if target.arrival is not None:
            first, last = np.broadcast_to(target.arrival, 2)
            found["arrival"] = at_most(lands, last + LATE)
            found["arrival, earliest"] = at_least(lands, first - LATE)
        return found

    def _grip(self, held: Held, margin: float) -> Found:
        """Largest use of the full grip from rest to the opening's start, at every instant; a plan
        keeps the scene's margin but for `BETWEEN` of the limit."""
        times = self.hand.instants(float(held.begins.max()), INSTANTS)
        motion, worst = self.hand.at(times), np.empty(held.mass.size)
        for i, begins in enumerate(held.begins):
            last = np.searchsorted(times, begins, "right")
            here = self.hand.at(np.array([max(begins, 0.0)]))
            use = [
                (f_x**2 + f_z**2 + (torque / held.arm[i]) ** 2).max(initial=0.0)
                for f_x, f_z, torque in (
                    held.wrench(tuple(v[:last] for v in motion), i),  # type: ignore[arg-type]
                    held.wrench(here, i),
                )
            ]
            worst[i] = math.sqrt(max(use)) / (held.faces * held.friction[i] * held.full)
        return at_most(worst, 1.0 - margin + min(margin, BETWEEN))

    # The sent motion.

    @cached_property
    def _joint_limits(self) -> dict[str, Found]:
        if self.arm is not None:
            return joint_limits(self.samples, self.arm.arm.limits, self.arm.throwing)
        hand, n = self.scene.hand, 3 if self.scene.hand.angular_speed is not None else 2
        low, high = np.array([hand.x, hand.z, hand.theta]).T
        dq = np.array([hand.speed, hand.speed, hand.angular_speed or 0.0])
        ddq = np.array([hand.acceleration] * 2 + [hand.angular_acceleration or 0.0])
        given = np.array([hand.jerk, hand.jerk, hand.angular_jerk], float)
        jerk = np.where(np.isnan(given), 100.0 * ddq, given)
        return _ranges(self.samples, (low, high), (dq, ddq, jerk), list(range(n)))

    def _limits(self) -> dict[str, Found]:
        found, arm, scene = dict(self._joint_limits), self.arm, self.scene
        if arm is None:
            return found
        most = (
            arm.arm.limits.tool_speed if scene.robot.tool_speed is None else scene.robot.tool_speed
        )
        if most is not None:
            found["tool speed"] = at_most(self._tool_speed, most)
        return found | {"in the plane": at_most(self._off_plane, 1e-6)}

    @cached_property
    def _tool_speed(self) -> float:
        return float(self.arm.tool_speed(self.arm.joints.instants(self.hand.end, INSTANTS)).max())

    @cached_property
    def _off_plane(self) -> float:
        """Distances [m] of the pads' centre and of the target from the plane."""
        target = self.scene.target
        beside = float(self.plane.ways[1][:2] @ [target.x, target.y]) - self.plane.lateral
        return max(float(np.abs(self.arm.off_plane(self.ticks)).max()), abs(beside))

    @cached_property
    def _torques(self) -> tuple[Array, Array, Array]:
        section = self.scene.torque
        limits = None if section is None else section.limits
        if limits is None:
            limits = np.array(self.arm.arm.limits.torque)[self.arm.throwing]
        return (*self.arm.torques(self.ticks, self.scene.gravity), np.array(limits))

    @property
    def _torque_margin(self) -> float:
        section, own = self.scene.torque, self.arm.arm.limits.torque_margin
        if section is not None and section.margin is not None:
            return section.margin
        return 0.1 if own is None else own

    def _torque(self, held: Held, margin: float) -> Found:
        """Largest share of a limit: with the bar until the pads open, then the worse of both."""
        empty, lever, limits = self._torques
        motion, worst = self.hand.at(self.ticks), []
        for i in range(held.mass.size):
            load = np.einsum("kjc,ck->kj", lever, held.wrench(motion, i))
            begins, ends = held.begins[i], held.begins[i] + held.opening[i]
            before, after = (self.ticks <= ends)[:, None], (self.ticks >= begins)[:, None]
            with_bar, without = np.abs(empty + load) * before, np.abs(empty) * after
            worst.append((np.maximum(with_bar, without) / limits).max())
        return at_most(worst, 1.0 - margin)


def joint_limits(samples: Samples, of: Any, which: list[int]) -> dict[str, Found]:
    """Use of an arm's limits by its joints `which`, counted from 0."""
    ends = np.array(of.position_min), np.array(of.position_max)
    velocity, acceleration, jerk = (np.array(v) for v in (of.velocity, of.acceleration, of.jerk))
    found = _ranges(samples, ends, (velocity, acceleration, jerk), which)
    slowing = of.slowing
    if slowing is not None:
        # A difference has the time of its later sample, as in a controller.
        q = np.vstack([samples.q, samples.q[1:]])[:, which]
        v = np.vstack([samples.dq, np.diff(samples.q, axis=0) / TICK])[:, which]
        given = (slowing.deceleration, slowing.offset, slowing.upper, slowing.lower)
        fall, offset, upper, lower = (np.array(row)[which] for row in given)
        up = np.sqrt(2 * fall * np.maximum(upper - q, 0.0)) - offset
        down = np.sqrt(2 * fall * np.maximum(q - lower, 0.0)) - offset
        cap = np.where(v > 0, up, down).clip(0.0, velocity[which])
        found["joint velocity at its position"] = at_least((cap - np.abs(v)).min(), 0.0)
    return found


def _ranges(
    s: Samples, ends: tuple[Array, Array], most: tuple[Array, ...], which: list[int]
) -> dict[str, Found]:
    """Use of ranges, and of limits on velocity, acceleration and jerk."""
    low, high = ends
    rate, turn, jerk = (np.diff(v, axis=0) / TICK for v in (s.q, s.dq, s.ddq))
    found = {"joint position": at_least(np.minimum(s.q - low, high - s.q)[:, which].min(), 0.0)}
    kinds = (np.vstack([s.dq, rate]), np.vstack([s.ddq, turn]), jerk)
    for name, values, limit in zip(("velocity", "acceleration", "jerk"), kinds, most, strict=True):
        share = np.abs(values[:, which]) / limit[which]
        found[f"joint {name}"] = at_most(share.max(), 1.0)
    return found
