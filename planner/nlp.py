"""The throw as a multiple-shooting NLP, in the block order that FATROP asks.

Decision vector, stage by stage (n coordinates; C carry, O opening intervals):

    stage          states                                   controls
    k = 0          q (n, unless the start is given), T       c (n)
    0 < k < C      q (n), dq (n), ddq (n, jerk control), T   c (n)
    k = C          q (n), dq (n), ddq (n, jerk control)      c (n)
    C < k < C + O  the same and the relative states (6 or 4) c (n)
    k = C + O      the same                                  t_f, cup entry times

T [s] is the carry's duration: the release timing. c is the control: jerk
[1000 rad/s^3] or acceleration [rad/s^2 or m/s^2], constant in an interval, so that
the coordinates inside it are closed forms. t_f [s] is the flight time. At rest dq
and ddq are zero and no variables; at the start of the opening the relative states
are. A given start pose is no variable either.

Constraints, stage by stage: gap_k = X_{k+1} - F_k(X_k, U_k) = 0, then the stage's
rows. Every number of the scene is in the parameter vector.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ..models.contact import Body, Contact, HandMotion, pivot_wrench
from ..models.flight import FlightState
from ..models.integrate import rk4_step
from ..models.sliding_pivot import SlidingPivot
from ..models.smoothing import relative_widths
from .mover import Mover

#: Unit of the jerk control [rad/s^3], so that the variables are of order one.
JERK_UNIT = 1000.0


@dataclass(frozen=True)
class Structure:
    """What a scene's NLP consists of; two scenes with the same one share a build.

    pivot: whether the object's rotation against the hand matters (it does not for a
    CoM grasp with the landing angle open). elastic: the landing may miss, at a price.
    """

    carry: int
    opening: int
    substeps: int
    jerk_control: bool
    free_start: bool
    angle: bool
    pivot: bool
    cup: int = 0
    landing: tuple[str, ...] = ()
    floor: bool = False
    column: bool = False
    palm: bool = False
    elastic: bool = False


@dataclass
class Parameters:
    """Named blocks of the NLP's parameter vector."""

    names: list[str] = field(default_factory=list)
    symbols: list[ca.SX] = field(default_factory=list)

    def add(self, name: str, size: int = 1) -> ca.SX:
        """A new block."""
        symbol = ca.SX.sym(name, size)
        self.names.append(name)
        self.symbols.append(symbol)
        return symbol

    def vector(self, values: dict[str, Any]) -> np.ndarray:
        """Numbers for all blocks, in order."""
        return np.concatenate([np.atleast_1d(values[name]) for name in self.names])


@dataclass
class Stage:
    """One stage: named state and control symbols, its rows and its cost."""

    states: dict[str, ca.SX]
    controls: dict[str, ca.SX]
    rows: list[tuple[str, ca.SX, float, float]] = field(default_factory=list)
    gap: ca.SX | None = None
    cost: ca.SX = dataclasses.field(default_factory=lambda: ca.SX(0))

    def row(self, name: str, value: ca.SX, low: float, high: float) -> None:
        """Add the constraint low <= value <= high (each component)."""
        self.rows.append((name, value, low, high))

    @staticmethod
    def width(symbols: dict[str, ca.SX]) -> int:
        """Number of scalars in `symbols`."""
        return sum(s.numel() for s in symbols.values())


@dataclass(frozen=True)
class ThrowNlp:
    """The built problem: `problem` for nlpsol, the stages' layout, constant row bounds."""

    structure: Structure
    problem: dict[str, ca.SX]
    parameters: Parameters
    layout: list[tuple[str, int, slice]]
    row_names: list[str]
    lbg: np.ndarray
    ubg: np.ndarray
    nx: list[int]
    nu: list[int]
    ng: list[int]
    landing: ca.Function

    @property
    def size(self) -> tuple[int, int]:
        """(variables, constraints)."""
        return self.problem["x"].numel(), self.problem["g"].numel()

    def fill(self, value: Any) -> np.ndarray:
        """Decision vector from `value(name, stage)`, an array for each block."""
        x = np.zeros(self.size[0])
        for name, stage, where in self.layout:
            x[where] = value(name, stage)
        return x

    def block(self, x: np.ndarray, name: str, stage: int) -> np.ndarray | None:
        """Values of block `name` at `stage`, None where it is no variable."""
        for block, k, where in self.layout:
            if block == name and k == stage:
                return x[where]
        return None


def build_nlp(structure: Structure, mover: Mover) -> ThrowNlp:
    """The NLP of a structure; its numbers come later, through the parameters."""
    return _Builder(structure, mover).build()


class _Builder:
    """Composes the stages; one method per part of the throw."""

    def __init__(self, structure: Structure, mover: Mover) -> None:
        self.s = structure
        self.n = mover.size
        self.motion = mover.motion
        self.coordinate_names = mover.joints
        p = self.p = Parameters()
        self.body = Body(p.add("mass"), p.add("inertia"), p.add("com_offset"))
        self.contact = Contact(
            p.add("friction"), p.add("patch_radius"), p.add("torsion"), p.add("faces")
        )
        self.gravity = p.add("gravity")
        self.grasp_angle = p.add("grasp_angle")
        self.full_grip = p.add("full_grip")
        self.sticking = p.add("sticking_limit")
        self.opening_time = p.add("opening_time")
        self.grip = p.add("grip_force", 2 * structure.opening * structure.substeps + 1)
        self.widths = relative_widths(p.add("epsilon"), self.body, self.contact, self.gravity)
        self.dq_max, self.ddq_max = p.add("dq_max", self.n), p.add("ddq_max", self.n)
        self.q_mid, self.q_half = p.add("q_mid", self.n), p.add("q_half", self.n)
        self.weights = p.add("weights", 3)
        self.jerk_max = p.add("jerk_max", self.n) if structure.jerk_control else None
        if structure.cup or structure.floor or structure.column:
            self.ahead, self.behind = p.add("ahead"), p.add("behind")
            self.half_width = p.add("half_width")
        if structure.floor:
            self.floor = p.add("floor")
        if structure.column:
            self.column_radius, self.column_height = p.add("column_radius"), p.add("column_height")
        self.release = SlidingPivot(self.body, self.contact, self.gravity, widths=self.widths)
        self.relative = 6 if structure.pivot else 4

    def build(self) -> ThrowNlp:
        stages = [self.stage(k) for k in range(self.s.carry + self.s.opening + 1)]
        for k in range(self.s.carry):
            self.carry(k, stages[k], stages[k + 1])
        for k in range(self.s.opening):
            self.opening(k, stages[self.s.carry + k], stages[self.s.carry + k + 1])
        self.end(stages[-1])
        return self.assemble(stages)

    # Variables of a stage.

    def stage(self, k: int) -> Stage:
        """Symbols of stage k as the table above says."""
        n, s = self.n, self.s
        states: dict[str, ca.SX] = {}
        if k > 0 or s.free_start:
            states["q"] = ca.SX.sym(f"q{k}", n)
        if k > 0:
            states["dq"] = ca.SX.sym(f"dq{k}", n)
            if s.jerk_control:
                states["ddq"] = ca.SX.sym(f"ddq{k}", n)
        if k < s.carry:
            states["T"] = ca.SX.sym(f"T{k}")
        if k > s.carry:
            states["rel"] = ca.SX.sym(f"rel{k}", self.relative)
        controls: dict[str, ca.SX] = {}
        if k < s.carry + s.opening:
            controls["c"] = ca.SX.sym(f"c{k}", n)
        return Stage(states, controls)

    def coordinates(self, stage: Stage) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq and (jerk control) ddq at the stage's node, rest included."""
        zero = ca.SX.zeros(self.n)
        if "q" not in stage.states:
            if "start" not in self.p.names:
                self.p.add("start", self.n)
            q = self.p.symbols[self.p.names.index("start")]
        else:
            q = stage.states["q"]
        return q, stage.states.get("dq", zero), stage.states.get("ddq", zero)

    def inside(self, stage: Stage, t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq, ddq at time t into the stage's interval: closed forms."""
        q, dq, ddq = self.coordinates(stage)
        c = stage.controls["c"]
        if self.s.jerk_control:
            jerk = JERK_UNIT * c
            return (
                q + t * (dq + t * (ddq / 2 + t * jerk / 6)),
                dq + t * (ddq + t * jerk / 2),
                ddq + t * jerk,
            )
        return q + t * (dq + t * c / 2), dq + t * c, c

    def hand(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> tuple[ca.SX, ca.SX, HandMotion]:
        """Hand pose, twist, and what the release model needs of its motion."""
        pose, twist, acceleration = self.motion(q, dq, ddq)
        return (
            pose,
            twist,
            HandMotion(pose[2], twist[2], acceleration[0], acceleration[1], acceleration[2]),
        )

    def effort(self, stage: Stage, dt: ca.SX) -> ca.SX:
        """Integral of the squared relative acceleration (and a little jerk), mid-interval."""
        _, _, ddq = self.inside(stage, dt / 2)
        cost = self.weights[0] * ca.sumsqr(ddq / self.ddq_max)
        if self.jerk_max is not None:
            cost += self.weights[1] * ca.sumsqr(JERK_UNIT * stage.controls["c"] / self.jerk_max)
        return dt * cost

    # Phases.

    def carry(self, k: int, stage: Stage, following: Stage) -> None:
        """Hand states only; the object sticks under the full grip."""
        duration = stage.states["T"]
        dt = duration / self.s.carry
        q, dq, ddq = self.inside(stage, dt)
        new = [q, dq, *([ddq] if self.s.jerk_control else [])]
        old = [following.states[name] for name in ("q", "dq", "ddq") if name in following.states]
        if "T" in following.states:
            new.append(duration)
            old.append(following.states["T"])
        stage.gap = ca.vertcat(*old) - ca.vertcat(*new)
        stage.cost = self.effort(stage, dt)
        if k == 0:
            stage.cost += self.weights[2] * duration
        self.between_nodes(stage, dt, positions=True)
        # With continuous acceleration an interval's start is the last one's end.
        fractions = [0.5, 1.0] if self.s.jerk_control and k > 0 else [0.0, 0.5, 1.0]
        for fraction in fractions:
            self.held(stage, fraction * dt)

    def held(self, stage: Stage, t: ca.SX) -> None:
        """The full grip holds the bar, and the bar is off the floor and the column."""
        q, dq, ddq = self.inside(stage, t)
        pose, _, motion = self.hand(q, dq, ddq)
        theta = pose[2] + self.grasp_angle
        h = self.body.com_offset
        wrench = pivot_wrench(
            self.body, self.gravity, motion, motion.omega, h * ca.cos(theta), h * ca.sin(theta)
        )
        use = self.contact.utilisation_squared(*wrench, self.full_grip)
        stage.row("grip while carrying", use / self.sticking**2, -np.inf, 1.0)
        self.obstacles(stage, pose, theta)

    def obstacles(self, stage: Stage, pose: ca.SX, theta: ca.SX) -> None:
        """The held bar's far end against floor and base column."""
        if not (self.s.floor or self.s.column):
            return
        reach = self.body.com_offset + self.ahead
        tip_x, tip_z = pose[0] + reach * ca.cos(theta), pose[1] + reach * ca.sin(theta)
        if self.s.floor:
            stage.row("floor", tip_z - self.half_width - self.floor, 0.0, np.inf)
        if self.s.column:
            # Outside a corner: one of the two distances is positive; softly the larger.
            over = tip_z - self.half_width - self.column_height
            beside = tip_x - self.half_width - self.column_radius
            stage.row("base column", _soft_max(over, beside, 0.005), 0.0, np.inf)

    def between_nodes(self, stage: Stage, dt: ca.SX, positions: bool) -> None:
        """Velocity, and position where asked, inside their limits all along an interval.

        The control points of the Bezier form bound the curve: one for a parabola,
        two for a cubic; end points are nodes.
        """
        q, dq, ddq = self.coordinates(stage)
        if self.s.jerk_control:
            stage.row("velocity", (dq + ddq * dt / 2) / self.dq_max, -1.0, 1.0)
        if positions:
            first = (q + dq * dt / (3 if self.s.jerk_control else 2) - self.q_mid) / self.q_half
            stage.row("position", first, -1.0, 1.0)
            if self.s.jerk_control:
                end, end_rate, _ = self.inside(stage, dt)
                last = (end - end_rate * dt / 3 - self.q_mid) / self.q_half
                stage.row("position", last, -1.0, 1.0)

    def opening(self, k: int, stage: Stage, following: Stage) -> None:
        """Adds the relative states: smoothed sliding pivot while the grip force falls."""
        s = self.s
        dt = self.opening_time / s.opening
        instants = 2 * s.substeps
        hands = []
        for i in range(instants + 1):
            pose, _, motion = self.hand(*self.inside(stage, dt * i / instants))
            hands.append(motion)
            if i == 0 and k == 0 and not s.jerk_control:
                # The acceleration may step here: the bar must bear the new one too.
                self.held(stage, ca.SX(0))
            elif i == 0:
                self.obstacles(stage, pose, pose[2] + self.grasp_angle)
        first = instants * k
        grips = [self.grip[first + i] for i in range(instants + 1)]
        state = self.relative_state(stage)
        for i in range(0, instants, 2):
            state = rk4_step(
                self.rates, state, hands[i : i + 3], grips[i : i + 3], dt / s.substeps
            )
        q, dq, ddq = self.inside(stage, dt)
        new = [q, dq, *([ddq] if s.jerk_control else []), *state]
        old = [following.states[name] for name in ("q", "dq", "ddq") if name in following.states]
        stage.gap = ca.vertcat(*old, following.states["rel"]) - ca.vertcat(*new)
        stage.cost = self.effort(stage, dt)
        self.between_nodes(stage, dt, positions=False)

    def relative_state(self, stage: Stage) -> list[ca.SX]:
        """The relative states at the stage's node; sticking at the opening's start."""
        if "rel" in stage.states:
            return list(ca.vertsplit(stage.states["rel"]))
        if self.s.pivot:
            return [ca.SX(0), ca.SX(0), self.grasp_angle, ca.SX(0), ca.SX(0), ca.SX(0)]
        return [ca.SX(0)] * 4

    def rates(self, state: Any, hand: HandMotion, grip: ca.SX) -> list[ca.SX]:
        """Sliding-pivot rates; without the pivot only those of the slip."""
        if self.s.pivot:
            return self.release.rates(state, hand, grip)
        s_x, s_z, v_x, v_z = state
        full = self.release.rates([s_x, s_z, self.grasp_angle, v_x, v_z, ca.SX(0)], hand, grip)
        return [full[0], full[1], full[3], full[4]]

    # The end: detach, flight, landing, and room to brake.

    def end(self, stage: Stage) -> None:
        """Landing condition and what the scene asks of flight and brake."""
        q, dq, ddq = self.coordinates(stage)
        # With acceleration control the last node has no acceleration: none is needed.
        pose, twist, motion = self.hand(q, dq, ddq)
        state = self.relative_state(stage)
        if not self.s.pivot:
            state = [state[0], state[1], self.grasp_angle, state[2], state[3], ca.SX(0)]
        flight = detach_state(self.release, pose, twist, motion, state)
        stage.controls["t_f"] = t_f = ca.SX.sym("t_f")
        land = flight.after(t_f, self.gravity)
        self.landing = ca.vertcat(land.x, land.z, land.theta)
        self.land(stage, land)
        self.brake(stage, q, dq, ddq)
        if self.s.cup:
            self.cup(stage, flight)
        self.landing_bounds(stage, land)

    def land(self, stage: Stage, land: FlightState) -> None:
        """The CoM comes down through the target's height at x, with theta if asked."""
        names = ["x", "theta"] if self.s.angle else ["x"]
        target = {name: self.p.add(f"target_{name}") for name in ["z", *names]}
        stage.row("landing z", land.z - target["z"], 0.0, 0.0)
        # Coming down, not up.
        stage.row("coming down", land.v_z, -np.inf, 0.0)
        for name in names:
            miss = getattr(land, name) - target[name]
            if self.s.elastic:
                short, far = ca.SX.sym(f"{name}_short"), ca.SX.sym(f"{name}_far")
                stage.controls[f"{name}_short"], stage.controls[f"{name}_far"] = short, far
                price = self.p.add(f"price_{name}")
                stage.cost += price * (short + far)
                miss = miss + short - far
            stage.row(f"landing {name}", miss, 0.0, 0.0)

    def brake(self, stage: Stage, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> None:
        """Room to brake to rest, and no velocity overshoot while the acceleration turns."""
        braking = self.p.add("braking", self.n)
        stop = q + dq * ca.sqrt(dq**2 + 1e-4) / (2 * braking)
        stage.row("room to brake", (stop - self.q_mid) / self.q_half, -1.0, 1.0)
        if self.jerk_max is not None:
            peak = dq + ddq * ca.sqrt(ddq**2 + 1e-2) / (2 * self.jerk_max)
            stage.row("velocity", peak / self.dq_max, -1.0, 1.0)

    def cup(self, stage: Stage, flight: FlightState) -> None:
        """The bar's outline inside the opening at several depths of its lower end.

        Per depth one unknown time, at which the middle of the lower end is that far
        below the rim; there the end's corners and the crossing of the rim plane stay
        the clearance away from the wall. The end is given by its distance from the
        CoM along the axis, negative for the grasped end.
        """
        x_cup, rim, radius = self.p.add("cup_x"), self.p.add("cup_rim"), self.p.add("cup_radius")
        insertion, end = self.p.add("cup_insertion"), self.p.add("lower_end")
        clearance = self.p.add("cup_clearance")
        for i in range(self.s.cup):
            stage.controls[f"t_cup{i}"] = t = ca.SX.sym(f"t_cup{i}")
            at = flight.after(t, self.gravity)
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            depth = insertion * i / max(self.s.cup - 1, 1)
            stage.row("cup depth", at.z + end * sin - (rim - depth), 0.0, 0.0)
            x_end = at.x + end * cos - x_cup
            for side in (-1, 1):
                corner = (x_end - side * self.half_width * sin) / (radius - clearance)
                stage.row("cup clearance", corner, -1.0, 1.0)
            # Distance of the rim's edges from the bar's axis, their wall's side known.
            slope = (at.x - x_cup) * sin + (rim - at.z) * cos
            room = (radius * ca.sqrt(sin**2 + 1e-9) - self.half_width - clearance) / radius
            stage.row("cup clearance", slope / radius - room, -np.inf, 0.0)
            stage.row("cup clearance", slope / radius + room, 0.0, np.inf)

    def landing_bounds(self, stage: Stage, land: FlightState) -> None:
        """Speed and turning rate at landing, as far as the scene bounds them."""
        speed2 = land.v_x**2 + land.v_z**2
        if "speed_min" in self.s.landing:
            stage.row("landing speed", speed2 - self.p.add("speed_min") ** 2, 0.0, np.inf)
        if "speed_max" in self.s.landing:
            stage.row("landing speed", speed2 - self.p.add("speed_max") ** 2, -np.inf, 0.0)
        if "rate_max" in self.s.landing:
            stage.row("landing rate", land.omega / self.p.add("rate_max"), -1.0, 1.0)

    # Assembly.

    def assemble(self, stages: list[Stage]) -> ThrowNlp:
        """Variables and constraints in block order."""
        variables: list[ca.SX] = []
        constraints: list[ca.SX] = []
        layout: list[tuple[str, int, slice]] = []
        names: list[str] = []
        lbg: list[float] = []
        ubg: list[float] = []
        ng: list[int] = []
        at = 0
        for k, stage in enumerate(stages):
            for name, symbol in [*stage.states.items(), *stage.controls.items()]:
                layout.append((name, k, slice(at, at + symbol.numel())))
                variables.append(symbol)
                at += symbol.numel()
            if stage.gap is not None:
                constraints.append(stage.gap)
                names += [f"gap {k}"] * stage.gap.numel()
                lbg += [0.0] * stage.gap.numel()
                ubg += [0.0] * stage.gap.numel()
            for name, value, low, high in stage.rows:
                constraints.append(value)
                each = self.coordinate_names if value.numel() == self.n > 1 else ()
                names += [f"{joint} {name}" for joint in each] or [name] * value.numel()
                lbg += [low] * value.numel()
                ubg += [high] * value.numel()
            ng.append(sum(value.numel() for _, value, _, _ in stage.rows))
        problem = {
            "x": ca.vertcat(*variables),
            "p": ca.vertcat(*self.p.symbols),
            "f": sum((stage.cost for stage in stages), ca.SX(0)),
            "g": ca.vertcat(*constraints),
        }
        nx = [Stage.width(stage.states) for stage in stages]
        nu = [Stage.width(stage.controls) for stage in stages]
        low_g, high_g = np.array(lbg), np.array(ubg)
        landing = ca.Function("landing", [problem["x"], problem["p"]], [self.landing])
        return ThrowNlp(
            self.s, problem, self.p, layout, names, low_g, high_g, nx, nu, ng, landing
        )


def detach_state(
    release: SlidingPivot, pose: ca.SX, twist: ca.SX, motion: HandMotion, state: Any
) -> FlightState:
    """CoM pose and twist in the world from the hand's and the relative state."""
    x_r, z_r = release.lever(state, motion)
    omega = motion.omega + state[5]
    return FlightState(
        pose[0] + x_r,
        pose[1] + z_r,
        motion.theta + state[2],
        twist[0] + state[3] - omega * (z_r - state[1]),
        twist[1] + state[4] + omega * (x_r - state[0]),
        omega,
    )


def _soft_max(a: ca.SX, b: ca.SX, width: float) -> ca.SX:
    """max(a, b) rounded from below, so that it never claims room that is not there."""
    return 0.5 * (a + b + ca.sqrt((a - b) ** 2 + width**2) - width)
