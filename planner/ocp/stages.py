"""Stages of a multiple-shooting NLP as symbols: blocks of variables, constraints and cost.

The decision vector, stage by stage (n coordinates; C carry intervals, O opening intervals):

    stage          states                                     controls
    k = 0          q (n, unless the start is given), T         c (n)
    0 < k < C      q (n), dq (n), ddq (n), T                   c (n)
    k = C          q (n), dq (n), ddq (n)                      c (n)
    C < k < C + O  like k = C, rel (6; 4 without the pivot)    c (n), acc (collocation)
    k = C + O      like k = C, rel                             t_f, those of scene constraints

A robust plan has intervals of fixed length before the opening (stages like k = C) and after detach
(without rel); its stage of detach has c too.
With several openings (`terms.robust.Scenarios`) rel, acc and t_f have indices: 0 is the planned
opening. Known values are no variables: rest, a given start pose, the object under full grip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import Array

#: Unit of the control, the jerk [rad/s^3; m/s^3]: the variables are of order one.
JERK_UNIT = 1000.0


@dataclass(frozen=True)
class NlpStructure:
    """The sizes and options of an NLP; numbers of a scene are parameters.

    carry, early, opening, late: numbers of intervals of the phases. instants: parts of a carry
    interval; grip and held bar are constrained at their ends. initial_motion: whether the throw
    starts from a given motion instead of rest. pivot: whether the object's rotation in the pads
    matters (not for a CoM grasp with the landing angle open). ranges: whether the target is a range
    of x, of theta. robust: whether it is of a robust plan. calibrated:
    whether the flight has the bias of [calibration]. parts: number of capsules of the object's
    outline, 0 for a bar.
    """

    carry: int
    opening: int
    early: int
    late: int
    instants: int
    free_start: bool
    initial_motion: bool
    angle: bool
    pivot: bool
    ranges: tuple[bool, bool]
    elastic: bool
    robust: bool
    calibrated: bool
    parts: int

    @property
    def opens(self) -> int:
        """Number of the stage at which the grip force starts to fall."""
        return self.carry + self.early

    @property
    def detach(self) -> int:
        """Number of the stage at which it is zero."""
        return self.opens + self.opening

    @property
    def last(self) -> int:
        """Number of the last stage: at detach, or at the end of the window."""
        return self.detach + self.late


@dataclass(frozen=True)
class Block:
    """A block of decision variables.

    limit: name of its bounds where they bind, empty for none. each: one variable per coordinate.
    index: number among the blocks of a name, e.g. of the opening.
    """

    name: str
    limit: str = ""
    each: bool = False
    index: int = 0

    def number(self, index: int) -> Block:
        """The block of this name with another index."""
        return replace(self, index=index)


#: Coordinates [rad; m], their rates and accelerations.
Q = Block("q", "position", each=True)
DQ = Block("dq", "velocity", each=True)
DDQ = Block("ddq", "acceleration", each=True)
#: Controls, constant in an interval: jerk of the coordinates [`JERK_UNIT`].
JERK = Block("c", "jerk", each=True)
#: Duration [s] of the carry: the release timing.
T = Block("T", "carry time")
#: State of the object in the pads: slip [m], angle [rad], and their rates.
REL = Block("rel")
#: Accelerations of slip and angle at the collocation points, in `transcription.UNITS`.
ACC = Block("acc")
#: Duration [s] of the flight.
T_F = Block("t_f", "flight time")
#: The landing in a region: from -1 at the lowest to 1 at the highest x (index 0), theta (1).
PLACE = Block("place")
#: Name of the constraints that a price of the room in a bin presses against at every optimum.
BIN_WALLS = "bin"
#: Room between object and walls of a bin, a share of its half opening.
ROOM = Block("room")
#: Angles [rad] below the horizontal of normals that part the object from a bin's rim.
TURN = Block("turn")
#: Slacks of an elastic landing below and above its target, of x [m] (index 0) and theta [rad] (1).
SLACKS = (Block("undershoot"), Block("overshoot"))


@dataclass(frozen=True)
class Layout:
    """Where an NLP has its decision variables; plain data, which plans keep and hand on.

    blocks: (block, stage, slice of x); size: (variables, constraints).
    """

    structure: NlpStructure
    blocks: list[tuple[Block, int, slice]]
    size: tuple[int, int]

    def count(self, name: str) -> int:
        """Number of blocks of a name, by their indices."""
        return len({block.index for block, _, _ in self.blocks if block.name == name})

    def fill(self, value: Callable[[Block, int], Any]) -> Array:
        """Decision vector from `value(block, stage)`, an array or number for each block."""
        x = np.zeros(self.size[0])
        for block, stage, where in self.blocks:
            x[where] = value(block, stage)
        return x

    @cached_property
    def places(self) -> dict[tuple[str, int, int], slice]:
        """Slices of x by name, stage and index of a block."""
        return {(block.name, k, block.index): where for block, k, where in self.blocks}

    def block(self, x: Array, name: str, stage: int, index: int = 0) -> Array | None:
        """Values of a block at `stage`, None if it is no variable."""
        where = self.places.get((name, stage, index))
        return None if where is None else x[where]


@dataclass
class Parameters:
    """Named blocks of the NLP's parameter vector, in the order of their first use."""

    blocks: dict[str, ca.SX] = field(default_factory=dict)

    def __call__(self, name: str, size: int = 1) -> ca.SX:
        """The block's symbol (size, 1); the first call adds it."""
        if name not in self.blocks:
            self.blocks[name] = ca.SX.sym(name, size)
        return self.blocks[name]

    @property
    def symbol(self) -> ca.SX:
        """The parameter vector."""
        return ca.vertcat(*self.blocks.values())

    def vector(self, values: dict[str, Any]) -> Array:
        """Numbers for all blocks, in order."""
        return np.concatenate([np.atleast_1d(values[name]) for name in self.blocks])

    def start(self, name: str) -> int:
        """Index of the block's first number in the vector."""
        names = list(self.blocks)
        return sum(self.blocks[before].numel() for before in names[: names.index(name)])


@dataclass(frozen=True)
class Row:
    """The constraint low <= value <= high, for each component."""

    name: str
    value: ca.SX
    low: float
    high: float


@dataclass(kw_only=True)
class Constraints:
    """Constraints and the intermediate values in them, each with its symbol, see
    `stage_functions`."""

    lifted: list[tuple[ca.SX, ca.SX]] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)

    def lift(self, *values: ca.SX) -> list[ca.SX]:
        """Scalar symbols in place of `values`, which differentiation substitutes."""
        definition = ca.vertcat(*values)
        symbol = ca.SX.sym(f"y{len(self.lifted)}", definition.numel())
        self.lifted.append((symbol, definition))
        return list(ca.vertsplit(symbol))


@dataclass
class Instants(Constraints):
    """Constraints of a stage at N instants, written and differentiated once.

    They depend on the stage's symbols and on `at` (k, 1); column i of `data` (k, N) has the values
    of `at` at instant i.
    """

    at: ca.SX
    data: Array


@dataclass
class Stage(Constraints):
    """One kind of stage.

    data: symbols with other values at each stage of the kind, by the name of their parameter block,
    and the first stage with values in it. following: the states F_k at the next stage; empty at the
    last.
    """

    states: dict[Block, ca.SX] = field(default_factory=dict)
    controls: dict[Block, ca.SX] = field(default_factory=dict)
    data: dict[str, tuple[ca.SX, int]] = field(default_factory=dict)
    instants: list[Instants] = field(default_factory=list)
    following: dict[Block, ca.SX] = field(default_factory=dict)
    cost: ca.SX = field(default_factory=lambda: ca.SX(0))

    def state(self, block: Block, size: int = 1) -> ca.SX:
        """A new state."""
        self.states[block] = ca.SX.sym(block.name, size)
        return self.states[block]

    def control(self, block: Block, size: int = 1) -> ca.SX:
        """A new control."""
        self.controls[block] = ca.SX.sym(f"{block.name}_{block.index}", size)
        return self.controls[block]

    def at_instants(self, *data: npt.ArrayLike) -> tuple[Instants, list[ca.SX]]:
        """A group of constraints at N instants, and symbols for the `data` (N,) of each."""
        at = ca.SX.sym("at", len(data))
        self.instants.append(Instants(at, np.array(data, float)))
        return self.instants[-1], list(ca.vertsplit(at))

    @property
    def variables(self) -> ca.SX:
        """States, then controls."""
        return ca.vertcat(*self.states.values(), *self.controls.values())

    @property
    def all_rows(self) -> list[Row]:
        """The constraints outside of groups, then those of each instant."""
        repeated = (group.rows * group.data.shape[1] for group in self.instants)
        return sum(repeated, self.rows)

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of states, controls and constraints."""
        states, controls = ca.vertcat(*self.states.values()), ca.vertcat(*self.controls.values())
        return states.numel(), controls.numel(), sum(row.value.numel() for row in self.all_rows)
