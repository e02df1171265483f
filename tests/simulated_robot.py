"""A robot and a gripper in this process, as libfranka's binding and the gripper's link show them.

Every command takes a millisecond of a clock of its own. The joints follow at once.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np
from throwplan.planner.robot import Franka, GripperState

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
    """A gripper's link: `width_at(tick)` [m] until it is ordered to open or to grasp.

    opens, grasps: how many orders open it, 30 ms later, and how many close it on an object of
    20 mm, 200 ms later; others leave it, and close it on nothing. drops: the number of the grasp
    whose object it loses, how long after that [s].
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
    ) -> None:
        self.robot, self.width_at, self.opens, self.holds = robot, width_at, opens, holds
        self.grasps, self.drops = grasps, drops
        self.orders: list[tuple[str, float]] = []
        #: When orders came [s], by the robot's clock.
        self.times: list[float] = []
        self.late = 0.0
        self.states = [self.state()]

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
        return GripperState(width, 0.08, holds, TICK * tick)

    #: It is homed.
    homed_state = state

    def order(self, command: str, *values: float, after: float = 0.0) -> None:
        """Take an order."""
        self.orders.append((command, values[0]))
        self.times.append(TICK * self.robot.tick + after)
        self.states = self.states[-1:]

    def update(self, patience: float = 0.0) -> bool:
        """A new state each time; waiting passes the clock."""
        self.robot.tick += round(patience / TICK / 10)
        self.states.append(self.state())
        return True


def simulated(width_at: Callable[[int], float] = lambda tick: 0.02, **hand: Any) -> Franka:
    """A robot with its gripper."""
    robot = SimulatedRobot()
    return Franka("host", robot, SimulatedHand(robot, width_at, **hand), BINDING)  # type: ignore[arg-type]
