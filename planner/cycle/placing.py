"""The same jobs by placing: each object carried into its bin, laid down and let go.

What throwing is compared with, so it is as fast as the same limits allow: moves do not stop above
the bin, they are slowed only as far as the verdict demands, and the gripper's dwell passes on the
way down.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models import Array, ReadOnly
from ...problems import Bin, InputError, Jobs, Pick, check_arguments
from ..clearance import SpatialScene
from ..throw import (
    NO_SAMPLES,
    TICK,
    Limits,
    Samples,
    State,
    joint_limits,
    make_manipulator,
    transfer,
)
from ..verdict import Code, Finding, first_finding, grip_use
from .cycle import UnsolvedError
from .edges import at_rest, joined
from .inverse_kinematics import DOWN, inverse_kinematics, joint_rates
from .network import Network

#: Height [m] above the place from where the hand goes straight down, and to where it rises.
LIFT = 0.1
#: Vertical speeds [m/s] at that height, of which the fastest motion is taken.
SPEEDS = (0.1, 0.25, 0.5, 0.8)
#: Most motions that are judged to find one slow enough, and to quicken it again.
SLOWINGS, QUICKENINGS = 30, 3
#: Share of a limit that a slowed motion is to use, and bounds of a slowing's factor.
AIM, FACTORS = 0.99, (0.5, 0.97)


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
        return (
            f"by placing: {self.duration:.2f} s, {self.duration / len(self.steps):.2f} s an object"
        )


@check_arguments
def place_jobs(jobs: Jobs) -> Placing:
    """All objects of a job file placed at their bins' targets, in the fastest order.

    The object's CoM comes to rest at the target's place (of a region its middle), at its angle;
    where the angle is open the hand points down. A bin that moves, or that the arm does not reach,
    is in `refused`.
    """
    places, refused = list[_Place](), dict[str, str]()
    tried = list[tuple[str, object]]()
    for number, pick in enumerate(jobs.picks):
        for one in jobs.bins_of(pick):
            # What is out of reach for an object is so from each pick.
            if (one.name, pick.sections) in tried:
                continue
            try:
                places.append(_place(jobs, number, pick, one))
            except InputError as error:
                refused[one.name] = str(error)
                tried.append((one.name, pick.sections))
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
    the height of `LIFT`, and at the place; rates (joints,) [rad/s]: for 1 m/s upwards, above."""

    pick: int
    bin: str
    space: SpatialScene
    above: Array
    down: Array
    rates: Array

    def passing(self, speed: float) -> State:
        """The state above the place at a vertical speed [m/s]."""
        return State(self.above, speed * self.rates, 0.0 * self.rates)

    @property
    def speeds(self) -> list[float]:
        """Vertical speeds [m/s] above the place that the joints allow; 0: a stop."""
        limits = np.array(self.space.kinematics.arm.limits.velocity)
        most = AIM / float((np.abs(self.rates) / limits).max())
        return [0.0, *(speed for speed in SPEEDS if speed < most)]


def _place(jobs: Jobs, number: int, pick: Pick, one: Bin) -> _Place:
    """Joints of a pick's object in a bin; InputError if there are none."""
    scene = jobs.scene_of(pick, one)
    target = scene.target
    assert target is not None
    if not target.at_rest:
        raise InputError("the bin moves")
    space, plane, grasp = (
        SpatialScene(scene, make_manipulator(scene)),
        target.plane,
        scene.grasp.angle,
    )
    theta = DOWN + grasp if target.theta is None else target.theta
    lever = scene.com_offset * np.array([math.cos(theta), math.sin(theta)])
    x, z = np.array([target.plane_x, target.z]) - lever
    angle = math.remainder(theta - grasp, 2 * math.pi)
    # About the vertical a bar in line with the hand is the same at any turn.
    upright = abs(angle - DOWN) < 1e-9 and grasp == 0.0
    turn, angle = (None, DOWN) if upright else (plane.azimuth, angle)
    joints, seed = list[Array](), list(pick.joints)
    for height in (z, z + LIFT):
        at = plane.points(x, height).tolist()
        joints.append(inverse_kinematics(space, at, turn, seed, angle=angle, held=True))
        seed = joints[-1].tolist()
    down, above = joints
    rates = joint_rates(space.kinematics.arm, above, np.array([0.0, 0.0, 1.0]))
    return _Place(number, one.name, space, above, down, rates)


# Motions, slowed as far as the verdict demands.


@dataclass(frozen=True)
class _Shares:
    """Shares of the limits: on velocity; on acceleration and jerk of the joints that throw, and of
    the others, which tilt the object out of the pads' plane."""

    velocity: float = 1.0
    throwing: float = 1.0
    aside: float = 1.0

    def limits(self, space: SpatialScene) -> Limits:
        """The limits of all joints, reduced."""
        arm = space.kinematics.arm
        limits, scale = joint_limits(arm, range(1, arm.joints + 1)), np.full(arm.joints, self.aside)
        scale[np.array(space.kinematics.throwing_joints) - 1] = self.throwing
        assert limits.jerk is not None
        ends = limits.q_min, limits.q_max
        return Limits(*ends, self.velocity * limits.dq, scale * limits.ddq, scale * limits.jerk)

    def smaller(self, finding: Finding, tilts: bool) -> _Shares | None:
        """Smaller shares against a broken limit; None if slowing does not help.

        tilts: the object is tilted or pulled out of the pads, more than it slips.
        """
        low, high = FACTORS
        factor = min(max(AIM * finding.limit / max(abs(finding.value), 1e-9), low), high)
        match finding.code:
            case Code.TOOL_SPEED | Code.JOINT_VELOCITY:
                return dataclasses.replace(self, velocity=factor * self.velocity)
            case Code.CARRY if tilts:
                return dataclasses.replace(self, aside=factor * self.aside)
            case Code.CARRY | Code.TORQUE | Code.TORQUE_RATE:
                return _Shares(self.velocity, factor * self.throwing, factor * self.aside)
        return None


def slowed_transfer(space: SpatialScene, start: State, goal: State, *, held: bool) -> Samples:
    """The fastest motion of all joints between two states of motion that breaks no limit.

    Ruckig's, with its limits reduced until grip (if `held`), torques and tool speed are kept, then
    raised again as far as that is allowed. Samples (N, joints), both states included. Raises
    UnsolvedError with the broken limit that no slower motion avoids.
    """
    shares, trouble = _Shares(), ""
    for _ in range(SLOWINGS):
        found = transfer(shares.limits(space), start, goal)
        if found is None:
            break
        broken = first_finding(space, found.samples, held=held)
        if broken is None:
            return _quickened(space, start, goal, held, shares, found.samples)
        trouble, tilts = broken.words, False
        if broken.code is Code.CARRY:
            grip = grip_use(space, found.samples)
            worst = int(grip.use.argmax())
            tilts = bool(grip.tilting[worst] + grip.lifting[worst] > grip.friction[worst])
        smaller = shares.smaller(broken, tilts)
        if smaller is None:
            break
        shares = smaller
    raise UnsolvedError(trouble or "a state is beyond the limits of the joints")


def _quickened(
    space: SpatialScene, start: State, goal: State, held: bool, shares: _Shares, found: Samples
) -> Samples:
    """The motion with larger shares, where these are allowed and as quick."""
    for name in ("aside", "throwing", "velocity"):
        low, high = getattr(shares, name), 1.0
        for _ in range(QUICKENINGS if low < 1.0 else 0):
            middle = (low + high) / 2
            larger = dataclasses.replace(shares, **{name: middle})
            other = transfer(larger.limits(space), start, goal)
            if (
                other is not None
                and other.ticks < len(found.q)
                and first_finding(space, other.samples, held=held) is None
            ):
                shares, found, low = larger, other.samples, middle
            else:
                high = middle
    return found


class _Way:
    """The fastest motion in two parts, judged when it is needed.

    ways: of each vertical speed above the bin, the states at the ends of the parts.
    """

    def __init__(
        self, place: _Place, ways: Sequence[tuple[State, State, State]], *, held: bool
    ) -> None:
        self._place, self._ways, self._held = place, ways, held
        self._is_judged, self.trouble = False, ""
        self.samples = NO_SAMPLES
        self.time = min((self._least(way) for way in ways), default=math.inf)

    @property
    def best(self) -> _Way | None:
        """Itself; None if there is no motion."""
        return self if math.isfinite(self.time) else None

    def _least(self, way: tuple[State, State, State]) -> float:
        """Time [s] by the limits of the joints only."""
        limits = _Shares().limits(self._place.space)
        found = [transfer(limits, *ends) for ends in itertools.pairwise(way)]
        ticks = [math.inf if each is None else each.ticks for each in found]
        return TICK * sum(ticks)

    def settle(self) -> bool:
        """Judge, if that is not done; returns whether the time stays."""
        if self._is_judged:
            return True
        before, self.time, self._is_judged = self.time, math.inf, True
        for way in sorted(self._ways, key=self._least):
            if self._least(way) >= self.time:
                break
            try:
                parts = [
                    slowed_transfer(self._place.space, *ends, held=self._held)
                    for ends in itertools.pairwise(way)
                ]
            except UnsolvedError as error:
                self.trouble = self.trouble or str(error)
                continue
            samples = joined(parts)
            if TICK * (len(samples.q) - 1) < self.time:
                self.samples, self.time = samples, TICK * (len(samples.q) - 1)
        return self.time == before


class _PlacingNetwork(Network):
    """Motions between all picks and places."""

    def __init__(self, jobs: Jobs, places: Sequence[_Place]) -> None:
        super().__init__(jobs, places)
        self.places = places

    def enter(self, pick: int, throw: int, *, stop: bool = False) -> _Way:
        """From a pick down to a place."""
        place, start = self.places[throw], self.picks[pick]
        end = at_rest(place.down)
        ways = [(start, place.passing(-speed), end) for speed in place.speeds]
        return self._edge(("enter", pick, throw), lambda: _Way(place, ways, held=True))

    def leave(self, throw: int, goal: int, *, stop: bool = False) -> _Way:
        """From a place up, and to a pick, or to home for -1."""
        place, end = self.places[throw], self.end(goal)
        start = at_rest(place.down)
        ways = [(start, place.passing(speed), end) for speed in place.speeds]
        return self._edge(("leave", throw, goal), lambda: _Way(place, ways, held=False))


def _sequence(
    network: _PlacingNetwork, order: Sequence[int], chosen: Sequence[int], refused: dict[str, str]
) -> Placing:
    """All motions one after another."""
    edges = network.edges(order, chosen)
    parts = [edges.pop(0).samples] if len(edges) % 2 else []
    tick, steps, carried = sum(len(part.q) - 1 for part in parts), [], []
    for n, (number, place) in enumerate(zip(order, chosen, strict=True)):
        pick, one = network.jobs.picks[number], network.places[place]
        opening = one.space.scene.gripper.profile().opening
        down, up = edges[2 * n].samples, edges[2 * n + 1].samples
        grasp = _still(down.q[0], pick.grasp_time)
        waits = grasp, _still(up.q[0], opening)
        parts += [waits[0], down, waits[1], up]
        held = tick + len(grasp.q) - 1
        carried.append((held, held + len(down.q) - 1))
        steps.append((pick.name, one.bin))
        tick = carried[-1][1] + len(waits[1].q) - 1 + len(up.q) - 1
    return Placing(joined(parts), tuple(steps), tuple(carried), refused)


def _still(joints: Array, time: float) -> Samples:
    """Samples at rest for a time [s]."""
    q = np.tile(joints, (math.ceil(time / TICK - 1e-9) + 1, 1))
    return Samples(q, 0.0 * q, 0.0 * q)
