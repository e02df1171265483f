"""A robot and a gripper in this process, as libfranka's binding and the gripper's link show them.

Every command takes a millisecond of a clock of its own. The joints follow at once.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np
from throwplan.problems import InputError
from throwplan.robots import Franka, GripperReply, GripperState

#: The usual pose of an FR3.
HOME = np.array([0.0, 0.0, 0.0, -1.57, 0.0, 1.57, 0.785])
TICK = 0.001


class JointPositions:
    """A command, as the binding has it."""

    def __init__(self, q: list[float]) -> None:
        self.q, self.motion_finished = q, False


_NAMES = ("Franka", "Network", "Control", "Command", "InvalidOperation", "Realtime")
BINDING = types.SimpleNamespace(
    JointPositions=JointPositions,
    ControllerMode=types.SimpleNamespace(JointImpedance=0),
    **{f"{name}Exception": type(name, (RuntimeError,), {}) for name in _NAMES},
)


class SimulatedRobot:
    """Stands at `q`; sent: all joints that it was sent, those of each millisecond."""

    def __init__(self, q: np.ndarray = HOME) -> None:
        self.q, self.dq, self.tick = np.array(q), np.zeros(7), 0
        self.sent: list[np.ndarray] = []
        self.finished = False

    def read_once(self) -> Any:
        """The state at rest; flange and hand as franky-sim says of `HOME`."""
        return types.SimpleNamespace(
            robot_mode=types.SimpleNamespace(name="Idle"),
            current_errors="",
            q=HOME.tolist(),
            q_d=self.q.tolist(),
            dq=[0.0] * 7,
            O_T_EE=[1, 4e-4, 0, 0, 4e-4, -1, 0, 0, 0, 0, -1, 0, 0.55443418, 0, 0.52140576, 1],
            F_T_EE=[0.7071, -0.7071, 0, 0, 0.7071, 0.7071, 0, 0, 0, 0, 1, 0, 0, 0, 0.1034, 1],
        )

    def start_joint_position_control(self, mode: int) -> SimulatedRobot:
        """The robot is its own control."""
        return self

    def readOnce(self) -> tuple[Any, None]:  # noqa: N802
        """The state a millisecond later."""
        self.tick += 1
        time, tick = types.SimpleNamespace(to_sec=lambda: TICK * tick), self.tick
        state = types.SimpleNamespace(time=time, q=self.q.tolist(), dq=self.dq.tolist())
        return state, None

    def writeOnce(self, command: JointPositions) -> None:  # noqa: N802
        """Follow a command at once."""
        q = np.array(command.q)
        self.dq, self.q = (q - self.q) / TICK, q
        self.sent.append(q)
        self.finished |= command.motion_finished


class SimulatedHand:
    """A gripper's link: `width_at(tick)` [m] until it is told to open or to grasp.

    opens, grasps: how many commands open it, in 30 ms, and how many close it on an object of 20 mm,
    in 200 ms; other openings do not end, other grasps close it on nothing. drops: the number of the
    grasp whose object it loses, how long after that [s]. ends: the tick at which its connection
    ends.
    """

    host = "host"

    def __init__(
        self,
        robot: SimulatedRobot,
        width_at: Callable[[int], float] = lambda tick: 0.02,
        *,
        opens: float = math.inf,
        holds: bool = True,
        grasps: float = math.inf,
        drops: tuple[int, float] = (0, 0.0),
        ends: float = math.inf,
    ) -> None:
        self.robot, self.width_at, self.opens, self.holds = robot, width_at, opens, holds
        self.grasps, self.drops, self.ends = grasps, drops, ends
        self.orders: list[tuple[str, float]] = []
        #: When commands came [s], by the robot's clock.
        self.times: list[float] = []
        self._calls: list[tuple[str, float]] = []

    @property
    def pending(self) -> int:
        """Calls that have not ended."""
        return len(self._calls)

    def _count(self, name: str) -> int:
        return sum(command == name for command, _ in self.orders)

    def state(self) -> GripperState:
        """The state now."""
        tick, (dropped, after) = self.robot.tick, self.drops
        width, holds, counts = self.width_at(tick), self.holds, {"move": 0, "grasp": 0}
        for (command, _), ordered in zip(self.orders, self.times, strict=True):
            counts[command] += 1
            since = TICK * tick - ordered
            if command == "move" and since > 0.03 and counts["move"] <= self.opens:
                width, holds = 0.08, False
            elif command == "grasp" and since > 0.2:
                holds = counts["grasp"] <= self.grasps
                holds &= counts["grasp"] != dropped or since < after
                width = 0.02 if holds else 0.0
        return GripperState(width, 0.08, holds)

    def call(self, name: str, *values: float, after: float = 0.0) -> None:
        """Take a call; it ends at a time of the robot's clock."""
        begin = TICK * self.robot.tick + after
        if name != "read_once":
            self.orders.append((name, values[0]))
            self.times.append(begin)
        stuck = name == "move" and self._count("move") > self.opens
        lasts = {"read_once": TICK, "move": math.inf if stuck else 0.031, "grasp": 0.201}[name]
        self._calls.append((name, begin + lasts))

    def reply(self, patience: float = 0.0) -> GripperReply | None:
        """The reply to the first call, once it has ended; waiting passes the clock."""
        if self.robot.tick > self.ends:
            raise InputError("host: gripper: the connection ended")
        end = self._calls[0][1] if self._calls else math.inf
        if end > TICK * self.robot.tick + patience + 1e-9:
            self.robot.tick += round(patience / TICK)
            return None
        self.robot.tick = max(self.robot.tick, math.ceil(end / TICK - 1e-6))
        name, _ = self._calls.pop(0)
        if name == "read_once":
            return GripperReply(name, self.state())
        return GripperReply(name, name == "move" or self._count("grasp") <= self.grasps)

    def result(self, name: str, *values: float) -> GripperState | bool:
        """Call and wait for the reply, 20 s at most."""
        self.call(name, *values)
        while (reply := self.reply(20.0)) is not None:
            if not self.pending:
                return reply.value
        raise InputError("host: port 1338 is open and does not answer")


def simulated(width_at: Callable[[int], float] = lambda tick: 0.02, **hand: Any) -> Franka:
    """A robot with its gripper."""
    robot = SimulatedRobot()
    return Franka("host", robot, SimulatedHand(robot, width_at, **hand), BINDING)  # type: ignore[arg-type]
