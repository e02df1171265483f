"""The motions of a cycle, one after another; throws into moving bins are planned for their time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ..planner import TICK, Carry, SentMotion, part_thrown
from .connections import Connection, CycleThrow, Option, joined, still
from .cycle import UnsolvedError
from .job_files import Jobs

if TYPE_CHECKING:
    from .network import Network

#: Time [s] that a throw into a moving bin gets beyond what the last one needed; the arm waits
#: for the rest of it.
SLACK = 0.02
#: Most throws that are planned to meet a moving bin.
MEETINGS = 8


def sequence(
    jobs: Jobs,
    network: Network,
    chosen: Sequence[int],
    again: Callable[[CycleThrow, float], CycleThrow | None],
) -> SentMotion:
    """The motion through throws in turn.

    again: a throw for where its bin is at a time [s]. Raises UnsolvedError if a moving bin is not
    met.
    """
    connections = network.connections(chosen)
    parts = [_best(connections.pop(0)).samples] if len(connections) % 2 else []
    tick, carries = sum(len(part.q) - 1 for part in parts), list[Carry]()
    order = [network.throws[number].pick for number in chosen]
    ends = [*order[1:], network.end_after(order)]
    for n, (number, end) in enumerate(zip(order, ends, strict=True)):
        pick, one, state = jobs.picks[number], network.throws[chosen[n]], network.picks[number]
        held = tick + math.ceil(pick.grasp_time / TICK - 1e-9)
        enter, leave, wait = connections[2 * n], connections[2 * n + 1], 0
        target = jobs.scene_of(pick, jobs.bin(one.bin)).aim
        if not target.is_fixed:
            one, enter, wait = _meet(network, one, held, again)
            leave = network.leaving(one, end)
            leave.settle()
        way, back = _best(enter), _best(leave)
        reach, held = tick, held + wait
        join = held + len(way.samples.q) - 1
        swing = joined([way.samples, one.samples[way.join : one.free + 1]])
        parts += [still(state, held - tick), swing, back.samples]
        origin = TICK * (join - way.join)
        scene = one.throw.scene.aimed_at(target.at(origin + one.throw.landing_time))
        opening, free = origin + one.throw.opening_time - TICK * held, held + len(swing.q) - 1
        part = join - held, free - held, opening
        throw = part_thrown(scene, one.throw.manipulator, swing, *part)
        carries.append(Carry(throw, join, free, pick.name, one.bin, reach, held))
        tick = free + len(back.samples.q) - 1
    return SentMotion(jobs.name, joined(parts), tuple(carries))


def _best(connection: Connection) -> Option:
    if connection.best is None:
        raise UnsolvedError(f"a motion to meet a moving bin: {connection.trouble}")
    return connection.best


def _meet(
    network: Network,
    one: CycleThrow,
    held: int,
    again: Callable[[CycleThrow, float], CycleThrow | None],
) -> tuple[CycleThrow, Connection, int]:
    """A throw that meets its moving bin, the motion into it, and how many samples it waits.

    held: sample of the cycle at which the hand holds the object.
    """
    aim = -math.inf
    for _ in range(MEETINGS):
        connection = network.entering(one)
        connection.settle()
        way = _best(connection)
        begins = held + len(way.samples.q) - 1 - way.join
        wait = round((aim - TICK * begins - one.throw.landing_time) / TICK) if aim > 0 else -1
        if wait >= 0:
            return one, connection, wait
        aim = TICK * begins + one.throw.landing_time + SLACK
        found = again(one, aim)
        if found is None:
            raise UnsolvedError(f"no throw meets the moving bin at {aim:.2f} s")
        one = found
    raise UnsolvedError("no throw meets the moving bin: it moves too fast for the search")
