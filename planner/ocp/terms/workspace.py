"""[workspace]: floor, base column and hand's body that the bar, and the arm, stay clear of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from ....models.robot import PlanarArm
from ....problems import Scene
from ...throw import column_of
from ...verdict import grasp_distance
from ..request import PALM_TIMES, Request
from ..scene_constraint import Flight, Instant, SceneConstraint, braked
from ..transcription import OutlinePoint, Scope


@dataclass(frozen=True)
class WorkspaceSettings:
    """Margins, roundings and instants of the constraints of the workspace.

    held_margin [m]: between carried bar and obstacles; covers the motion between nodes, smoothing
    and correction; `request.HELD` adds to it. corner [m]: rounding of the maximum of two
    distances. passing_instants: of the flight, for the column. passing_margin [m]: to the column in
    flight; `request.PASSING` adds to it. last_instants: over these last instants of the
    flight that margin falls to zero, as the landing pose is given. return_time [s]: after detach; a
    bar may fall back on the hand from then on. return_instants: of the flight after that time.
    palm_margin [m]: to the hand's body; covers the motion between instants; `request.PALM` adds to
    it.
    """

    held_margin: float = 0.001
    corner: float = 0.002
    passing_instants: int = 40
    passing_margin: float = 0.004
    last_instants: int = 5
    return_time: float = 0.1
    return_instants: int = 40
    palm_margin: float = 0.008


SETTINGS = WorkspaceSettings()
#: Margin [m] between flying bar and base column.
PASSING_MARGIN = SETTINGS.passing_margin


@dataclass(frozen=True)
class Floor(SceneConstraint):
    """Bar, arm and hand above the floor.

    arm: includes joints and hand (lazy constraint "carry"). body: the hand has a body. back: the
    bar reaches behind the pads.
    """

    arm: bool
    body: bool
    back: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a floor."""
        floor, arm, refinement = request.scene.bounds.floor, request.scene.arm, request.refinement
        if floor is None:
            return None
        values = {"floor": floor + SETTINGS.held_margin, "held_margin": refinement.margins["held"]}
        if arm is not None:
            values |= {
                "body_back": arm.tool.palm_back,
                "body_front": arm.tool.palm_front,
                "body_half_width": arm.tool.palm_half_width,
            }
        back = _reaches_back(request.scene)
        return cls(values, "carry" in refinement.lazy, arm is not None, back)

    def at_instant(self, at: Instant) -> None:
        """The bar's ends, joint frames, the hand and its body not below the floor."""
        if at.grip == "none":
            return
        p, margin, arm = at.p, at.held_margin, at.ocp.kinematics
        if at.ocp.structure.parts:
            heights = [z - point.radius for _, z, point in at.held_points()]
        else:
            heights = [z - p("half_width") for _, z, *_ in _ends(at, self.back)]
        for height in heights:
            at.subject_to("floor", height - p("floor") - margin, low=0.0)
        if not self.arm:
            return
        pose, *_ = at.hand
        # A hand that moves by itself has no joint frames.
        heights = arm.heights(arm.link_angles(at.q)) if isinstance(arm, PlanarArm) else []
        if self.body:
            across = p("body_half_width") * ca.sqrt(ca.cos(pose[2]) ** 2 + 1e-6)
            ends = [p(name) * ca.sin(pose[2]) for name in ("body_back", "body_front")]
            heights += [pose[1] - end - across for end in ends]
        for height in [*heights, pose[1]]:
            at.subject_to("floor", height - (p("floor") + margin), low=0.0)


def _reaches_back(scene: Scene) -> bool:
    """Whether a bar, which has no outline, is held farther than at its end."""
    return not scene.object.outline and scene.grasp.offset > 0.0


def _ends(at: Instant, back: bool) -> list[tuple[ca.SX, ca.SX, ca.SX, ca.SX]]:
    """The held bar's far end, and the one behind the pads, as `Instant.bar_end`."""
    x, z, cos, sin = at.bar_end
    length = at.p("ahead") + at.p("behind")
    near = [(x - length * cos, z - length * sin, cos, sin)] if back else []
    return [(x, z, cos, sin), *near]


@dataclass(frozen=True)
class Column(SceneConstraint):
    """The bar clear of the base column. passing: in flight too (lazy constraint "passing"); back:
    the bar reaches behind the pads."""

    passing: bool
    back: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a base column, enlarged by the margin of the held bar."""
        column, refinement = column_of(request.scene), request.refinement
        if column is None:
            return None
        values = {
            "column_radius": column[0] + SETTINGS.held_margin,
            "column_height": column[1] + SETTINGS.held_margin,
            "column_margin": SETTINGS.held_margin,
            "held_margin": refinement.margins["held"],
            "passing_margin": PASSING_MARGIN + refinement.margins["passing"],
        }
        return cls(values, "passing" in refinement.lazy, _reaches_back(request.scene))

    def at_instant(self, at: Instant) -> None:
        """The held bar's ends clear of the column."""
        if at.grip == "none":
            return
        if at.ocp.structure.parts:
            clear = [_disc_distance(at, x, z, point) for x, z, point in at.held_points()]
        else:
            clear = [_distance(at, *end) for end in _ends(at, self.back)]
        for distance in clear:
            at.subject_to("base column", distance - at.held_margin, low=0.0)

    def in_flight(self, flight: Flight) -> None:
        """Points of the flying bar clear of the column, from detach to landing."""
        if not self.passing:
            return
        p, count = flight.p, SETTINGS.passing_instants
        shares = np.linspace(0.0, 1.0, count)
        weights = np.minimum(1.0, (1.0 - shares) * (count - 1) / SETTINGS.last_instants)
        scope, (share, weight) = flight.at_instants(shares, weights)
        at = flight.after(share * flight.time)
        margin = weight * p("passing_margin") - (1 - weight) * p("column_margin")
        theta = ca.SX(at.theta)
        cos, sin = ca.cos(theta), ca.sin(theta)
        for point in flight.ocp.along_bar():
            x, z = point.placed(at.x, at.z, cos, sin)
            if flight.ocp.structure.parts:
                clear = _disc_distance(scope, x, z, point)
            else:
                clear = _distance(scope, x, z, cos, sin)
            scope.subject_to("base column", clear - margin, low=0.0)


def _distance(scope: Scope, x: ca.SX, z: ca.SX, cos: ca.SX, sin: ca.SX) -> ca.SX:
    """Distance [m] from the base column to the bar at the point x, z [m] of its axis: above the
    column or to a side of it.

    cos, sin: of the bar's angle. The bar extends half its width from its axis.
    """
    p = scope.p
    above = z - p("half_width") * ca.sqrt(cos**2 + 1e-6) - p("column_height")
    aside = ca.sqrt(x**2 + 1e-8) - p("half_width") * ca.sqrt(sin**2 + 1e-6) - p("column_radius")
    return soft_max(above, aside)


def _disc_distance(scope: Scope, x: ca.SX, z: ca.SX, point: OutlinePoint) -> ca.SX:
    """Distance [m] from the base column to an outline around its point at x, z [m]."""
    p, radius = scope.p, point.radius
    aside = ca.sqrt(x**2 + 1e-8) - radius - p("column_radius")
    return soft_max(z - radius - p("column_height"), aside)


@dataclass(frozen=True)
class Palm(SceneConstraint):
    """The flying bar clear of the hand's body: its ends, at the first instants of the flight.

    later: five points too, in all the flight (lazy constraint "return" instead of "flight").
    """

    later: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """As a lazy constraint of a scene with a clearance to the hand's body, which grows by the
        clearance and half the bar's width."""
        clearance, arm = request.scene.palm_clearance, request.scene.arm
        lazy = request.refinement.lazy & {"flight", "return"}
        if not lazy or clearance is None or arm is None:
            return None
        # An outline has radii of its own.
        bar, margin = request.scene.object, SETTINGS.palm_margin + clearance
        margin += (0.0 if bar.outline else bar.width / 2) + request.refinement.margins["palm"]
        # An object that is gripped nearer the body than that cannot be farther off just after.
        margin = min(margin, grasp_distance(request.scene))
        values = {
            "palm_back": arm.tool.palm_back + margin,
            "palm_front": arm.tool.palm_front - margin,
            "palm_half_width": arm.tool.palm_half_width + margin,
        }
        return cls(values, "return" in lazy)

    def in_flight(self, flight: Flight) -> None:
        """The bar clear of the hand's body at some times."""
        # Just after detach only an end of the bar can meet the hand.
        scope, (time,) = flight.at_instants(PALM_TIMES)
        points = flight.ocp.along_bar()
        ends = points if flight.ocp.structure.parts else [points[0], points[-1]]
        _clear_of_palm(flight, scope, time, ends)
        if self.later:
            first, count = SETTINGS.return_time, SETTINGS.return_instants
            scope, (share,) = flight.at_instants(np.arange(1, count + 1) / count)
            _clear_of_palm(flight, scope, first + share * (flight.time - first), points)


def _clear_of_palm(
    flight: Flight, scope: Scope, time: ca.SX, points: Sequence[OutlinePoint]
) -> None:
    """Points of the flying bar clear of the hand's body at `time` after detach.

    Meanwhile every coordinate brakes at `braking`. A point is in front of the body, behind it or at
    its side.
    """
    ocp, p, (q, dq, _) = flight.ocp, flight.p, flight.coordinates
    still = ca.SX.zeros(ocp.n)
    pose, _, _ = scope.hand_of(braked(q, dq, time, ocp.each("braking"), ca.fmin), still, still)
    cos_hand, sin_hand = ca.cos(pose[2]), ca.sin(pose[2])
    at = flight.after(time)
    for point in points:
        x, z = point.placed(at.x, at.z, ca.cos(at.theta), ca.sin(at.theta))
        dx, dz = x - pose[0], z - pose[1]
        ahead = cos_hand * dx + sin_hand * dz
        before = ca.fmax(ahead + p("palm_front"), -ahead - p("palm_back"))
        aside = ca.sqrt((cos_hand * dz - sin_hand * dx) ** 2 + 1e-8) - p("palm_half_width")
        scope.subject_to("palm", soft_max(before, aside) - point.radius, low=0.0)


def soft_max(a: ca.SX, b: ca.SX) -> ca.SX:
    """max(a, b), rounded from below: never above the true distance."""
    return 0.5 * (a + b + ca.sqrt((a - b) ** 2 + SETTINGS.corner**2) - SETTINGS.corner)
