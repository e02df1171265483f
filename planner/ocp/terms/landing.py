"""The landing: its speed ([landing]), its latest time (arrival), its way into [cup] or [bin]."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca

from ....problems import Object
from ...verdict import reach_of_bar
from ..request import Request
from ..scene_constraint import Flight, SceneConstraint
from ..stages import BIN_WALLS, ROOM, TURN, Block, Stage, T
from ..transcription import Ocp, OutlinePoint

#: Margin to the bounds of [landing], a share of them: covers the NLP's error of the landing.
BOUNDS_MARGIN = 0.02
#: Margin [s] to the latest arrival: covers the NLP's error of the landing.
ARRIVAL_MARGIN = 1e-3
#: Number of depths with constraints: without and with the lazy constraint "flight".
DEPTHS = (4, 12)
#: Margins [m] to rim and wall at these numbers of depths: they cover the motion between depths;
#: `request.CUP` adds to them.
CUP_MARGINS = (0.001, 0.0002)
#: Room [radii] at a rim's edge that lies one radius before the bar's lower end: steep enough that
#: such an edge binds at no angle.
BEFORE = 25.0
#: Points of each capsule of an outline that are kept off wall and rim.
CUP_POINTS = 5
#: Height [radii] over the rim from which a disc is free. The bound keeps the series small.
HIGH = 3.0
#: Numbers of heights with constraints on the way into a bin: without and with lazy "flight".
HEIGHTS = (8, 16)
#: Share of the height of the flight's top over the rim from which a bin's constraints begin.
TOP = 0.9
#: Price of the room in a bin, a share of its half opening: it counts more than effort.
ROOM_PRICE = 30.0
#: The same where the load on the pads has a price: it counts more than that.
QUIET_ROOM_PRICE = 300.0
#: Least difference [m] of the bounds of the room in a bin.
BETWEEN = 0.001


@dataclass(frozen=True)
class LandingBounds(SceneConstraint):
    """Bounds of speed and turning rate at the landing."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with [landing]."""
        bounds = request.scene.landing
        if bounds is None:
            return None
        values = {"speed_min": bounds.speed_min * (1 + BOUNDS_MARGIN)} if bounds.speed_min else {}
        for name in ("speed_max", "rate_max"):
            if (most := getattr(bounds, name)) is not None:
                values[name] = most * (1 - BOUNDS_MARGIN)
        return cls(values)

    def in_flight(self, flight: Flight) -> None:
        """The scene's bounds."""
        p, end = flight.p, flight.end
        squared = end.v_x**2 + end.v_z**2
        if "speed_min" in self.values:
            flight.subject_to("landing speed", squared - p("speed_min") ** 2, low=0.0)
        if "speed_max" in self.values:
            flight.subject_to("landing speed", squared - p("speed_max") ** 2, high=0.0)
        if "rate_max" in self.values:
            flight.subject_to("landing rate", end.omega / p("rate_max"), -1.0, 1.0)


@dataclass(frozen=True)
class SoftLanding(SceneConstraint):
    """A price of the speed of the object's ends at the landing: a slow object stays where it lands.

    The plain throw has none.
    """

    turns: ClassVar[bool] = True

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with [rest]."""
        if request.scene.rest is None:
            return None
        half = request.scene.object.half_length
        return cls({"soft": request.refinement.soft, "soft_arm": half})

    def in_flight(self, flight: Flight) -> None:
        """Squared speed of the CoM and of an end about it [m^2/s^2]."""
        p, end = flight.p, flight.end
        about = p("soft_arm") * end.omega
        flight.add_objective(p("soft") * (end.v_x**2 + end.v_z**2 + about**2))


@dataclass(frozen=True)
class LatestArrival(SceneConstraint):
    """The latest time of the landing. The earliest needs no constraint: the arm can wait."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a target with an arrival."""
        target = request.target
        if target is None or not math.isfinite(target.window[1]):
            return None
        before = request.opening_nodes[-1]
        return cls({"arrival": target.window[1] - before - ARRIVAL_MARGIN})

    def add_states(self, ocp: Ocp, k: int, stage: Stage) -> None:
        """The carry's duration from the end of the carry to detach, where the flight's is known."""
        if ocp.structure.carry <= k <= ocp.structure.detach:
            stage.state(T)

    def in_flight(self, flight: Flight) -> None:
        """The landing's time."""
        arrival = flight.stage.states[T] + flight.time
        flight.subject_to("arrival", arrival - flight.p("arrival"), high=0.0)


@dataclass(frozen=True)
class CupClearance(SceneConstraint):
    """The bar's outline inside the cup at several depths of its lower end.

    One unknown time is that of the lowest corner at the rim's height: the corner is clear of the
    wall. Each depth adds an unknown time, at which the middle of the lower end is at that depth:
    the corners of the end are clear of the wall, the long edges clear of the rim. The cup moves
    with the target, and in an elastic problem with the landing; there the end that enters is that
    of the throw at the start of the solve. Of an outline, the lower end is the lowest end of its
    capsules at that angle, and points of all are clear of wall and rim.
    """

    depths: int
    elastic: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a cup; the end of the bar that enters depends on the target."""
        cup, target = request.scene.cup, request.target
        if cup is None or target is None:
            return None
        theta = target.theta if request.start_angle is None else request.start_angle
        lower = lower_end(request.scene.object, theta or 0.0)
        fine = "flight" in request.refinement.lazy
        values: dict[str, Any] = {
            "cup_x": cup.x + _offset(request),
            "cup_rim": cup.rim,
            "cup_insertion": cup.insertion,
            "cup_radius": cup.radius_for(request.scene.object),
            "cup_clearance": cup.clearance + CUP_MARGINS[fine] + request.refinement.margins["cup"],
            "lower_end": lower if request.scene.object.outline else lower[0],
        }
        if target.velocity is not None:
            values["cup_speed"] = target.speed
        return cls(values, DEPTHS[fine], request.elastic > 0.0)

    def in_flight(self, flight: Flight) -> None:
        """The rim, then each depth."""
        p, end = flight.p, flight.end
        radius, clearance, half_width = p("cup_radius"), p("cup_clearance"), p("half_width")
        landed = p("cup_x") + (end.x - p("target_x") if self.elastic else 0)

        def cup_at(time: ca.SX) -> ca.SX:
            moves = "cup_speed" in self.values
            return landed + p("cup_speed") * (time - flight.time) if moves else landed

        if flight.ocp.structure.parts:
            self._outline_in(flight, cup_at)
            return
        lower = p("lower_end")
        time = flight.stage.control(Block("t_rim"))
        at, cup_x = flight.after(time), cup_at(time)
        cos, sin = ca.cos(at.theta), ca.sin(at.theta)
        across = half_width * cos / ca.sqrt(cos**2 + 1e-6)
        flight.subject_to("cup depth", at.z + lower * sin - across * cos - p("cup_rim"), 0.0, 0.0)
        corner = at.x + lower * cos + across * sin - cup_x
        flight.subject_to("cup clearance", corner / (radius - clearance), -1.0, 1.0)
        for i in range(self.depths):
            time = flight.stage.control(Block("t_cup").number(i))
            at, cup_x = flight.after(time), cup_at(time)
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            depth = p("cup_insertion") * i / max(self.depths - 1, 1)
            flight.subject_to("cup depth", at.z + lower * sin - (p("cup_rim") - depth), 0.0, 0.0)
            for side in (-1, 1):
                corner = at.x + lower * cos - side * half_width * sin - cup_x
                flight.subject_to("cup clearance", corner / (radius - clearance), -1.0, 1.0)
            # The rim's two edges lie to either side of the bar's axis: signed distances. One that
            # lies before the lower end, `before` it along the axis, is clear where the corners are.
            offset = (at.x - cup_x) * sin + (p("cup_rim") - at.z) * cos
            free = radius * ca.sqrt(sin**2 + 1e-9) - half_width - clearance
            up = -ca.sign(lower)
            for side, bound in ((-1, "low"), (1, "high")):
                edge = cup_x + side * up * radius - at.x - lower * cos
                before = ca.fmax(-up * (edge * cos + depth * sin), 0.0)
                room = free + BEFORE * before**2 / radius
                flight.subject_to("cup clearance", (offset - side * room) / radius, **{bound: 0.0})

    def _outline_in(self, flight: Flight, cup_at: Callable[[ca.SX], ca.SX]) -> None:
        """The constraints for an outline: as the lower end reaches the rim, then at each depth."""
        p = flight.p
        radius, clearance = p("cup_radius"), p("cup_clearance")
        row = p("lower_end", 3)
        lower = OutlinePoint(row[0], row[1], row[2])
        times = [Block("t_rim"), *(Block("t_cup").number(i) for i in range(self.depths))]
        for i, block in enumerate(times):
            time = flight.stage.control(block)
            at, cup_x = flight.after(time), cup_at(time)
            pose = at.x, at.z, ca.cos(at.theta), ca.sin(at.theta)
            depth = p("cup_insertion") * max(i - 1, 0) / max(self.depths - 1, 1)
            bottom = lower.placed(*pose)[1] - lower.radius
            flight.subject_to("cup depth", bottom - (p("cup_rim") - depth), 0.0, 0.0)
            for point in flight.ocp.outline_points(CUP_POINTS):
                x, z = point.placed(*pose)
                needed = point.radius + clearance
                # A disc above the rim may be farther out; this is a bound from below on the
                # distance at which it meets the rim, of the series of 1 - sqrt(1 - u^2).
                u = ca.fmin(ca.fmax((z - p("cup_rim")) / needed, 0.0), HIGH) ** 2
                free = radius - needed + needed * (u / 2 + u**2 / 8 + u**3 / 16)
                flight.subject_to("cup clearance", (x - cup_x - free) / radius, high=0.0)
                flight.subject_to("cup clearance", (x - cup_x + free) / radius, low=0.0)


@dataclass(frozen=True)
class BinClearance(SceneConstraint):
    """The object between the walls of a bin, as far from them as possible.

    The CoM passes even heights, from where no part of the object is below the rim to where all of
    it is, or touches the bottom. At each height and for either wall a line parts the object from
    the rim's edge and the wall below: its normal, an unknown, points to the wall or down. All of
    the object is at least the room, another unknown, before that line. The bin moves with the
    target, and in an elastic problem with the landing.
    """

    turns: ClassVar[bool] = True
    heights: int
    elastic: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a bin."""
        into, target, thing = request.scene.bin, request.target, request.scene.object
        if into is None or target is None:
            return None
        fine = "flight" in request.refinement.lazy
        half, reach = into.half_opening(thing), reach_of_bar(thing)
        margin = CUP_MARGINS[fine] + request.refinement.margins["cup"]
        least = half - into.half_opening(thing, into.clearance) + margin
        values: dict[str, Any] = {
            "bin_x": into.plane_x + _offset(request),
            "bin_rim": into.rim,
            "bin_half": half,
            "bin_room": least,
            "room_price": QUIET_ROOM_PRICE if request.refinement.quiet else ROOM_PRICE,
            "bin_best": max(into.best_room(thing), least + BETWEEN),
            "bin_heights": (reach + into.clearance, -min(reach, into.depth)),
        }
        return cls(values, HEIGHTS[fine], request.elastic > 0.0)

    def in_flight(self, flight: Flight) -> None:
        """The room, and the lines at each height."""
        p, end = flight.p, flight.end
        half, rim, room = p("bin_half"), p("bin_rim"), flight.stage.control(ROOM)
        middle = p("bin_x") + (end.x - p("target_x") if self.elastic else 0)
        flight.subject_to("bin clearance", room - p("bin_room") / half, low=0.0)
        flight.subject_to(BIN_WALLS, room - p("bin_best") / half, high=0.0)
        flight.add_objective(p("room_price") * (1 - room))
        if flight.ocp.structure.parts:
            points = flight.ocp.outline_points(2)
        else:
            ends, wide = (p("ahead"), -p("behind")), p("half_width")
            points = [OutlinePoint(at, side * wide) for at in ends for side in (-1, 1)]
        first, last = ca.vertsplit(p("bin_heights", 2))
        for i in range(self.heights):
            height = rim - end.z + first + (last - first) * i / (self.heights - 1)
            # The top of the flight may be lower.
            height = ca.fmin(height, TOP * end.v_z**2 / (2 * p("gravity") + 1e-6))
            fall = end.v_z - ca.sqrt(end.v_z**2 - 2 * p("gravity") * height + 1e-9)
            at = flight.after(flight.time + 2 * height / fall)
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            for number, side in enumerate((-1, 1)):
                turn = flight.stage.control(TURN.number(2 * i + number))
                for point in points:
                    x, z = point.placed(at.x, at.z, cos, sin)
                    beyond = side * ca.cos(turn) * (x - middle - side * half)
                    beyond += point.radius - ca.sin(turn) * (z - rim)
                    flight.subject_to(BIN_WALLS, beyond / half + room, high=0.0)


def _offset(request: Request) -> float:
    """How far [m] the aim of an NLP is beside the target: the cup stays where it is about it."""
    target, aim = request.scene.target, request.target
    return 0.0 if aim is None or target is None else aim.plane_x - target.plane_x


def lower_end(bar: Object, theta: float) -> tuple[float, float, float]:
    """The end that lands lower at an angle [rad]: distances [m] along and across the axis from the
    CoM, and radius [m] around it, which is 0 for a bar."""
    if bar.outline:
        return bar.lowest_end(theta)
    return (bar.length - bar.com if math.sin(theta) < 0 else -bar.com), 0.0, 0.0
