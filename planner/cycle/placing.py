"""The same jobs by placing: each object carried into its bin, laid down and let go.

What throwing is compared with, so it is as fast as the same limits allow: moves do not stop above
the bin, they are slowed only as far as the verdict demands, and the gripper's dwell passes on the
way down.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from ...models import Array, ReadOnly
from ...problems import InputError, check_arguments
from ...problems.files import plain
from ...problems.job_files import Bin, Jobs, Pick
from ..clearance import SpatialScene
from ..throw import NO_SAMPLES, TICK, Samples, State, joint_limits, make_manipulator, transfer
from .connections import Connection, CycleThrow, Option, at_rest, joined, option_along, still
from .cycle import UnsolvedError
from .inverse_kinematics import ALIKE, DOWN, HandPose, hand_poses, inverse_kinematics, joint_rates
from .network import Network
from .planning import with_joints
from .slowing import slowed_transfer

#: Height [m] above the place from where the hand goes straight down, and to where it rises.
LIFT = 0.1
#: Distances [m] from the point at that height at which the hand may pass it, to cut the corner; the
#: fastest motion is taken.
CORNERS = (0.02, 0.04)
#: Shares of the speed there from which a joint could just come to rest at the place.
PASSINGS = (0.7, 0.9)
#: Number of solutions of the hand pose in a bin among which each way from a pick chooses.
SOLUTIONS = 3


@dataclass(frozen=True, eq=False)
class Placing(ReadOnly):
    """The jobs done by placing, as one motion of all joints (N, joints) at 1 kHz.

    steps: names of pick and bin in turn. carried: for each, the samples between which the hand
    holds the object. refused: by the name of a bin, why nothing is placed in it. trouble: why not
    all jobs can be done; then there is no motion.
    """

    samples: Samples
    steps: tuple[tuple[str, str], ...]
    carried: tuple[tuple[int, int], ...]
    refused: dict[str, str]
    trouble: str = ""

    @property
    def duration(self) -> float:
        """Time [s] of all of it; NaN if it cannot be done."""
        return math.nan if self.trouble else TICK * (len(self.samples.q) - 1)

    @property
    def words(self) -> str:
        """The result as one line for people."""
        if self.trouble:
            return f"by placing: not all, {self.trouble}"
        left_out = "".join(f"; not into {name}: {why}" for name, why in self.refused.items())
        each = self.duration / len(self.steps)
        return f"by placing: {self.duration:.2f} s, {each:.2f} s an object{left_out}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units; the duration is null where not all can be done."""
        entries = {"duration": self.duration, "message": self.words, "refused": self.refused}
        table: dict[str, Any] = plain(entries)
        return table


@check_arguments
def place_jobs(jobs: Jobs) -> Placing:
    """All objects of a job file placed at their bins' targets, in the fastest order.

    The object's CoM comes to rest at the target's place (of a region its middle), at its angle;
    where the angle is open the hand points down. A bin that moves, or that the arm does not reach,
    is in `refused`. InputError for a hand pose of a pick that the arm cannot take.
    """
    jobs = with_joints(jobs)
    places, refused = list[_Place](), dict[str, str]()
    # Objects of one kind have the same poses in a bin, whatever the pick.
    known = list[tuple[str, object, list[_Place]]]()
    for number, pick in enumerate(jobs.picks):
        for one in jobs.bins_of(pick):
            found = next(
                (p for name, kind, p in known if (name, kind) == (one.name, pick.sections)), None
            )
            if found is None:
                try:
                    found = _places(jobs, pick, one)
                except InputError as error:
                    refused[one.name], found = str(error), []
                known.append((one.name, pick.sections, found))
            places += (dataclasses.replace(place, pick=number) for place in _nearest(found, pick))
    done = {place.pick for place in places}
    trouble = ""
    for number, pick in enumerate(jobs.picks):
        if number not in done:
            reasons = (f"{one.name}: {refused[one.name]}" for one in jobs.bins_of(pick))
            trouble = trouble or f"{pick.name} into {'; '.join(reasons)}"
    if not trouble:
        network = _PlacingNetwork(jobs, places)
        try:
            order, chosen = network.fastest()
            return _sequence(network, order, chosen, refused)
        except UnsolvedError as error:
            trouble = str(error)
    return Placing(NO_SAMPLES, (), (), refused, trouble)


@dataclass(frozen=True, eq=False)
class _Place:
    """An object laid down in a bin. pick: its number; bin: name; above, down: joints (joints,) at
    the height of `LIFT`, and at the place."""

    pick: int
    bin: str
    space: SpatialScene
    above: Array
    down: Array

    def corners(self, far: Array) -> Iterator[State]:
        """States in which the hand passes above the bin on its way down from joints `far`
        (joints,): joints that go on move, those that turn round rest."""
        yield at_rest(self.above)
        limits, rows = self.space.kinematics.arm.limits, np.array([far, self.above])
        start, end = self.space.spatial.frames(rows)[-1, :, :3, 3]
        way = (start - end) * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(way))
        for corner in CORNERS:
            if corner > length / 2:
                return
            q = self.above + corner * joint_rates(self.space, self.above, way / length)
            left = self.down - q
            goes_on = left * (q - far) > 0.0
            speeds = np.minimum(
                np.sqrt(2 * np.array(limits.acceleration) * np.abs(left)), limits.velocity
            )
            for share in PASSINGS:
                dq = np.where(goes_on, share * np.copysign(speeds, left), 0.0)
                yield State(q, dq, 0.0 * q)


def _places(jobs: Jobs, pick: Pick, one: Bin) -> list[_Place]:
    """Joints of objects like a pick's in a bin, near those of each pick, and others; InputError if
    there are none."""
    scene = jobs.scene_of(pick, one)
    target = scene.aim
    if not target.at_rest:
        raise InputError("the bin moves")
    space = SpatialScene(scene, make_manipulator(scene))
    plane, grasp = target.plane, scene.grasp.angle
    theta = DOWN + grasp if target.theta is None else target.theta
    lever = scene.com_offset * np.array([math.cos(theta), math.sin(theta)])
    x, z = np.array([target.plane_x, target.z]) - lever
    angle = math.remainder(theta - grasp, 2 * math.pi)
    # About the vertical a bar in line with the hand is the same at any turn.
    upright = abs(angle - DOWN) < 1e-9 and grasp == 0.0
    turn, angle = (None, DOWN) if upright else (plane.azimuth, angle)
    down, lifted = (
        HandPose(plane.points(x, height).tolist(), turn, angle) for height in (z, z + LIFT)
    )
    assert pick.joints is not None  # by `with_joints`
    joints = hand_poses(space, down, pick.joints)
    for other in jobs.picks:
        assert other.joints is not None
        with contextlib.suppress(InputError):
            joints.append(inverse_kinematics(space, down, other.joints, held=True))
    found, trouble = list[_Place](), InputError("")
    for q in joints:
        try:
            above = inverse_kinematics(space, lifted, q.tolist(), held=True)
        except InputError as error:
            trouble = error
        else:
            found.append(_Place(0, one.name, space, above, q))
    if not found:
        raise trouble
    return found


def _nearest(places: Sequence[_Place], pick: Pick) -> list[_Place]:
    """The places next to a pick, by the time that the slowest joint takes from there."""

    def time(place: _Place) -> float:
        velocity = np.array(place.space.kinematics.arm.limits.velocity)
        return float((np.abs(place.down - np.array(pick.joints)) / velocity).max())

    different = list[_Place]()
    for place in sorted(places, key=time):
        if all(np.abs(place.down - other.down).max() > ALIKE for other in different):
            different.append(place)
    return different[:SOLUTIONS]


class _Way(Connection):
    """The fastest motion in two parts, judged when it is needed.

    ways: of each state above the bin, the states at the ends of the parts.
    """

    def __init__(
        self, place: _Place, ways: Sequence[tuple[State, State, State]], *, held: bool
    ) -> None:
        self._place, self._held, self._is_judged, self.trouble = place, held, False, ""
        self._ways = sorted(ways, key=self._least)
        self._best: Option | None = Option(self._least(self._ways[0]), lambda: NO_SAMPLES)

    @property
    def hits(self) -> int:
        """Waiting objects are left out here."""
        return 0

    def best(self, waiting: int = 0) -> Option | None:
        """The motion; before it is judged, its time by the limits of the joints only."""
        return self._best

    def _least(self, way: tuple[State, State, State]) -> float:
        """Time [s] by the limits of the joints only."""
        arm = self._place.space.kinematics.arm
        limits = joint_limits(arm, range(1, arm.joints + 1))
        found = [transfer(limits, *ends) for ends in itertools.pairwise(way)]
        ticks = [math.inf if each is None else each.ticks for each in found]
        return TICK * sum(ticks)

    def time(self, waiting: int = 0) -> float:
        """Its duration [s]; infinite if all are refused."""
        return math.inf if self._best is None else self._best.duration

    def settle(self, waiting: int = 0) -> bool:
        """Judge, if that is not done; returns whether the time stays."""
        if self._is_judged:
            return True
        before, self._best, self._is_judged = self.time(), None, True
        for way in self._ways:
            if self._least(way) >= self.time():
                break
            try:
                parts = [
                    slowed_transfer(self._place.space, *ends, held=self._held)
                    for ends in itertools.pairwise(way)
                ]
            except UnsolvedError as error:
                self.trouble = self.trouble or str(error)
                continue
            found = option_along(parts)
            if found.duration < self.time():
                self._best = found
        return self.time() == before


class _PlacingNetwork(Network):
    """Motions between all picks and places."""

    def __init__(self, jobs: Jobs, places: Sequence[_Place]) -> None:
        # Of throws it reads the pick and the scene only, besides what is defined here.
        super().__init__(jobs, cast(Sequence[CycleThrow], places))
        self.places = places

    def enter(self, pick: int, throw: int, *, stop: bool = False) -> Connection:
        """From a pick down to a place."""
        place, start = self.places[throw], self.picks[pick]

        def make() -> _Way:
            down = at_rest(place.down)
            ways = [(start, corner, down) for corner in place.corners(start.q)]
            return _Way(place, ways, held=True)

        return self._connection(("enter", pick, throw), make)

    def leave(self, throw: int, goal: int, *, stop: bool = False) -> Connection:
        """From a place up, and to a pick, or to home for -1."""
        place, end = self.places[throw], self.end(goal)

        def make() -> _Way:
            # Downwards, backwards.
            corners = (State(each.q, -each.dq, each.ddq) for each in place.corners(end.q))
            ways = [(at_rest(place.down), corner, end) for corner in corners]
            return _Way(place, ways, held=False)

        return self._connection(("leave", throw, goal), make)


def _sequence(
    network: _PlacingNetwork, order: Sequence[int], chosen: Sequence[int], refused: dict[str, str]
) -> Placing:
    """All motions one after another."""
    ways = [
        best.samples
        for connection, _ in network.connections(order, chosen)
        if (best := connection.best()) is not None
    ]
    parts = [ways.pop(0)] if len(ways) % 2 else []
    tick = sum(len(part.q) - 1 for part in parts)
    steps, carried = list[tuple[str, str]](), list[tuple[int, int]]()
    for n, (number, place) in enumerate(zip(order, chosen, strict=True)):
        pick, one = network.jobs.picks[number], network.places[place]
        opening = one.space.scene.gripper.profile().opening
        down, up = ways[2 * n], ways[2 * n + 1]
        grasp = still(at_rest(down.q[0]), math.ceil(pick.grasp_time / TICK - 1e-9))
        placed = still(at_rest(up.q[0]), math.ceil(opening / TICK - 1e-9))
        parts += [grasp, down, placed, up]
        held = tick + len(grasp.q) - 1
        carried.append((held, held + len(down.q) - 1))
        steps.append((pick.name, one.bin))
        tick = carried[-1][1] + len(placed.q) - 1 + len(up.q) - 1
    return Placing(joined(parts), tuple(steps), tuple(carried), refused)
