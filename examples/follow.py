"""Throws at a cup that moves, by an arm that lags: corrected until the hand opens, or not.

    make verify                            # once: brings the simulated FR3
    python examples/follow.py [--throws 200]

The arm is the FR3 of the package franky-sim in MuJoCo. Its joint controller there is 0.1 s late;
here it is four times as stiff and 0.02 s late. In each throw the cup begins to move at some time,
at up to 0.15 m/s either way. It is seen with 1 mm of noise, the joints with 0.2 mrad, both 5 to
20 ms late; the gripper is up to 2 ms early or late. Where the bar lands follows from the joints
that MuJoCo had, by the exact model.

Printed: the error of the landing, |dx| + |dtheta| l / 2 [mm], of the plan as it is, of the plan
corrected for the lag by two throws before, and of that one corrected on the way.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import time
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import throwplan as tp
from throwplan.planner.robot import JointMotion, Recording, corrected, joint_motion
from throwplan.planner.throw import TICK, Samples, Throw

#: After a measurement [s] what is sent for it is on its way: the longest latency and a cycle.
HORIZON = 0.021
#: Of the cup's and the joints' measurements [m, rad]; latency [s]; gripper [s]; the cup [m/s].
CUP_NOISE, JOINT_NOISE, LATENCY, GRIPPER, SPEED = 1e-3, 2e-4, (0.005, 0.020), 2e-3, 0.15
#: When the cup begins to move [s before the opening], and over how long its speed is taken [s].
BEGINS, SEEN = (0.15, 0.35), 0.08
RATES = (100, 400, 1000)
#: How late the joints are [s], and how much stiffer than franky-sim's.
LAG, STIFFER = 0.02, 4.0


class Arm:
    """The FR3 in MuJoCo without its shapes, weightless as a Franka compensates it."""

    def __init__(self) -> None:
        found = importlib.util.find_spec("franky_sim")
        assert found is not None and found.origin is not None, "needs franky-sim: make verify"
        root = ET.parse(Path(found.origin).parent / "assets" / "fr3.xml").getroot()
        for parent in list(root.iter()):
            for child in list(parent):
                if child.tag in ("geom", "mesh", "material"):
                    parent.remove(child)
        self.model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
        # The damping over the spring is the lag.
        spring = STIFFER * self.model.actuator_gainprm[:7, 0]
        self.model.actuator_gainprm[:7, 0] = spring
        self.model.actuator_biasprm[:7, 1:3] = np.outer(spring, [-1.0, -LAG])
        self.model.opt.timestep, self.model.opt.gravity[:] = TICK, 0.0
        self.data = mujoco.MjData(self.model)

    def stand(self, q: np.ndarray) -> None:
        """At rest at joints q."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:7], self.data.ctrl[:7] = q, q

    def step(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A millisecond with joints q sent; joints and rates after it."""
        self.data.ctrl[:7] = q
        mujoco.mj_step(self.model, self.data)
        return self.data.qpos[:7].copy(), self.data.qvel[:7].copy()


@dataclass(frozen=True)
class Cup:
    """A cup that moves on its own, and how it is seen."""

    begins: float
    speed: float
    latency: float
    gripper: float
    noise: np.random.Generator

    def away(self, t: float) -> float:
        """How far [m] it has moved."""
        return self.speed * max(t - self.begins, 0.0)


def recorded(arm: Arm, motion: JointMotion) -> Recording:
    """A motion played without anything else."""
    arm.stand(motion.q[0])
    still = np.repeat(motion.q[-1:], 400, axis=0)
    sent = np.vstack([motion.q, still])
    states = [(motion.q[0], 0 * motion.q[0]), *(arm.step(q) for q in sent[:-1])]
    q = np.array([joints for joints, _ in states])
    times = TICK * np.arange(len(sent))
    return Recording(times, q, sent, (motion.throw.command_time,))


def error(plan: Throw, q: np.ndarray, opening_time: float, cup: Cup) -> float:
    """Of the landing [m]: by joints (N, 7), opened at a time, against the cup where it then is."""
    joints = q[:, [j - 1 for j in plan.scene.arm.throwing_joints]]
    path = Samples(joints, *_rates(joints)).path
    thrown = dataclasses.replace(plan, path=path, opening_time=opening_time + cup.gripper)
    dx, dtheta = thrown.miss()
    return plan.scene.object.pose_error(dx - cup.away(thrown.landing_time), dtheta)


def _rates(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    dq = np.gradient(q, TICK, axis=0)
    return dq, np.gradient(dq, TICK, axis=0)


def followed(
    arm: Arm, session: tp.Session, target: tp.Pose, cup: Cup, rate: int
) -> tuple[np.ndarray, list[float], str]:
    """Joints (N, 7) of a throw that is corrected `rate` times a second; times of updates [s]."""
    sent = session.update(-1.0, session.throw.samples.q[0], 0 * session.throw.samples.q[0]).q
    arm.stand(sent[0])
    states, seen = [(sent[0], 0 * sent[0])], []
    waiting: list[tuple[float, tp.Update]] = []
    every, spent, status = round(1 / rate / TICK), list[float](), ""
    for tick in range(round(session.throw.detach_time / TICK) + 60):
        t = TICK * tick
        while waiting and waiting[0][0] <= t:
            update = waiting.pop(0)[1]
            sent = np.vstack([sent[: update.first], update.q])
        if tick % every == 0 and status not in ("committed", "stopped"):
            seen.append((t, cup.away(t) + cup.noise.normal(scale=CUP_NOISE)))
            times, places = np.array([one for one in seen if one[0] > t - SEEN]).T
            mean, middle = places.mean(), times.mean()
            late = times - middle
            # Nearer to rest, the less was seen.
            speed = late @ places / (late @ late + (CUP_NOISE / SPEED) ** 2)
            there = target.changed(
                x=target.x + mean + speed * (t - middle), velocity=(float(np.clip(speed, -1, 1)),)
            )
            q, dq = states[-1]
            begin = time.perf_counter()
            update = session.update(t, q + cup.noise.normal(scale=JOINT_NOISE, size=7), dq, there)
            spent.append(time.perf_counter() - begin)
            status = update.status
            waiting.append((t + cup.latency, update))
        states.append(arm.step(sent[min(tick, len(sent) - 1)]))
    return np.array([q for q, _ in states]), spent, status


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=200)
    options = parser.parse_args()
    arm, planner = Arm(), tp.Planner("fr3")
    plan = planner.plan()
    motion = sent = joint_motion(plan)
    for _ in range(2):
        recording = recorded(arm, sent)
        sent, _ = corrected(motion, recording)
    response = tp.Response.fitted(*recording.throwing(motion.throw)[:0:-1])
    still, learnt = recorded(arm, motion), recorded(arm, sent)
    random, errors = np.random.default_rng(0), {name: [] for name in ("plan", "lag", *RATES)}
    spent: dict[int, list[float]] = {rate: [] for rate in RATES}
    ends: dict[int, list[str]] = {rate: [] for rate in RATES}
    throw = motion.throw
    for number in range(options.throws):
        cup = Cup(
            sent.throw.opening_time - random.uniform(*BEGINS),
            random.uniform(-SPEED, SPEED),
            random.uniform(*LATENCY),
            random.uniform(-GRIPPER, GRIPPER),
            np.random.default_rng(number),
        )
        # The plan's own motion begins so much later that it opens at the same time.
        later = dataclasses.replace(
            cup, begins=cup.begins + throw.opening_time - sent.throw.opening_time
        )
        errors["plan"].append(error(throw, still.q, throw.opening_time, later))
        errors["lag"].append(error(throw, learnt.q, sent.throw.opening_time, cup))
        for rate in RATES:
            session = planner.follow(plan, HORIZON, sent=sent.throw, response=response)
            fresh = dataclasses.replace(cup, noise=np.random.default_rng(number))
            q, times, status = followed(arm, session, plan.target, fresh, rate)
            ends[rate].append(status)
            spent[rate] += times
            errors[rate].append(error(throw, q, sent.throw.opening_time, cup))
    print(
        "| | median | 95 % | worst | update, median / 99 % | stopped |\n|---|---|---|---|---|---|"
    )
    for name, values in errors.items():
        median, most, worst = 1e3 * np.percentile(values, [50, 95, 100])
        row = f"| {name} | {median:.1f} mm | {most:.1f} mm | {worst:.1f} mm |"
        if name in spent:
            half, late = 1e3 * np.percentile(spent[name], [50, 99])
            row += f" {half:.1f} / {late:.1f} ms | {ends[name].count('stopped')} |"
        else:
            row += " | |"
        print(row)


if __name__ == "__main__":
    main()
