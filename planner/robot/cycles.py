"""A cycle on other systems: as a bag for ROS 2, and its throws in MuJoCo.

A cycle that is read back is judged again as a whole, since files can be edited.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ...problems import InputError, check_arguments, checked
from ...problems.files import filling
from ..cycle import Cycle, read_cycle
from ..throw import TICK
from .controller_files import (
    ROS_FILES,
    WIDTHS,
    GripperCommand,
    joint_names,
    rate_mistakes,
    rest_mistakes,
    ros_typestore,
    write_ros,
)
from .gripper import OPEN_WIDTH


def cycle_of(cycle: Cycle | str | Path) -> Cycle:
    """A solved cycle; of a cycle.json or its folder, judged again.

    InputError for what `read_cycle` refuses, and for a motion that breaks a limit, does not begin
    and end at rest, or misses a target.
    """
    place = cycle.name if isinstance(cycle, Cycle) else cycle
    cycle = cycle if isinstance(cycle, Cycle) else read_cycle(cycle)
    if cycle.refused:
        raise InputError(f"{place}: the cycle is not solved: {cycle.refused}")
    mistake = next(_mistakes(cycle), None)
    if mistake is not None:
        raise InputError(f"{place}: not sent, {mistake}")
    return cycle


def _mistakes(cycle: Cycle) -> Iterator[str]:
    """Reasons not to send the motion."""
    arm = cycle.steps[0].scene.arm
    assert arm is not None
    yield from rest_mistakes(arm, cycle.samples)
    yield from (finding.words for finding in cycle.verdict.broken)
    yield from rate_mistakes(arm, cycle.samples)
    for step in cycle.steps:
        early = TICK * step.held - step.command_time
        if early > 0:
            words = f"the opening command would come {1e3 * early:.1f} ms before it is held"
            yield f"{step.pick}: {words}"


@check_arguments
def export_cycle(
    cycle: Cycle | str | Path,
    *,
    ros: str | Path,
    names: Sequence[str] | None = None,
    open_width: float | None = None,
) -> Cycle:
    """Check a cycle again and write it for ROS 2 (extra `ros`); returns the cycle.

    cycle: a cycle, or the path of a cycle.json or of its folder. ros: folder of the bag: all joints
    at 1 kHz, a command that closes the gripper at each pick and one that opens it for each throw;
    names, open_width: see `export`. InputError for a cycle that must not be sent and for a folder
    that cannot be written.
    """
    width = OPEN_WIDTH if open_width is None else checked("--open-width", open_width, float, WIDTHS)
    ros_typestore()
    cycle = cycle_of(cycle)
    arm = cycle.steps[0].scene.arm
    assert arm is not None
    joints, commands = joint_names(arm, names), list[GripperCommand]()
    for step in cycle.steps:
        force = step.scene.gripper.profile().full
        commands.append(GripperCommand(TICK * step.reach, 0.0, force))
        commands.append(GripperCommand(step.command_time, width))
    with filling(Path(ros), ROS_FILES, "--ros") as folder:
        write_ros(folder, joints, cycle.samples, commands)
    return cycle
