"""Measured throws as data: recordings, and the properties shared by a data set."""

from __future__ import annotations

import dataclasses
import math

from ...models import Array, Indices
from ...models.release import TableRelease
from ...models.robot import Arm
from ..grip import Grasp, ThrownObject
from ..section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Shared(Section):
    """Properties shared by all throws of a data set.

    Faces and torsion of the pads are not identified. arm is None for motions of the hand;
    synthetic: origin of synthetic throws, empty for real ones.
    """

    landing_height: float = quantity(
        "m, where landing poses are measured and predicted", least=-1e3, most=1e3
    )
    description: str = quantity("", default="")
    synthetic: str = quantity("made by a program, not measured", default="")
    gravity: float = quantity("m/s^2", least=0, most=1e3, default=9.81)
    faces: int = quantity("pads that rub on the object", least=1, most=100, default=2)
    torsion: float = quantity(
        "torsional limit = torsion * patch radius * tangential limit",
        above=0,
        least=1e-3,
        most=10,
        default=0.6,
    )
    arm: str | None = quantity(
        "whose joints the motions hold; left out: the hand's x, z, theta", default=None
    )
    cutoff: float = quantity("Hz, low-pass for the joints' positions", above=0, default=35.0)
    position_noise: float = quantity(
        "m, standard deviation of a measured landing", above=0, most=1, default=0.005
    )
    angle_noise: float = quantity(
        "degrees, the same of its angle", degrees=True, above=0, default=math.radians(2.0)
    )


@dataclasses.dataclass(frozen=True)
class MeasuredThrow:
    """The recording of one throw.

    motion: times (K,) [s] and columns (K, n): the hand's x, z, theta or the arm's joints; command
    [s]: time of the opening command on the motion's clock; grip: force of one pad from the command
    on; landing: x [m], z [m], theta [rad], None without a measured landing; track (K, 4): t on the
    motion's clock, x, z, theta of the CoM, None without a track. factors: the row's other columns.
    """

    name: str
    object: ThrownObject
    grasp: Grasp
    times: Array = dataclasses.field(repr=False)
    motion: Array = dataclasses.field(repr=False)
    command: float
    grip: TableRelease = dataclasses.field(repr=False)
    landing: tuple[float, float, float] | None
    track: Array | None = dataclasses.field(repr=False)
    factors: dict[str, str]

    @property
    def opening(self) -> float:
        """Time [s] on the motion's clock at which the grip force starts to fall."""
        return self.command + self.grip.dwell


@dataclasses.dataclass(frozen=True)
class ThrowData:
    """A data set: throws, shared properties, the arm of its joints, and the true parameters of
    synthetic throws (for comparison only)."""

    name: str
    shared: Shared
    throws: tuple[MeasuredThrow, ...] = dataclasses.field(repr=False)
    arm: Arm | None = dataclasses.field(default=None, repr=False)
    truth: dict[str, float] = dataclasses.field(default_factory=dict)

    def picked(self, numbers: Indices | list[int]) -> ThrowData:
        """The data set of the given throws."""
        return dataclasses.replace(self, throws=tuple(self.throws[i] for i in numbers))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about the defaults of keys that objects leave out."""
        words = [f"[objects] {words}" for t in self.throws for words in t.object.assumed]
        return tuple(dict.fromkeys(words))

    @property
    def factors(self) -> dict[str, list[str]]:
        """Every factor's labels, in order of appearance."""
        found: dict[str, list[str]] = {}
        for throw in self.throws:
            for name, label in throw.factors.items():
                labels = found.setdefault(name, [])
                if label not in labels:
                    labels.append(label)
        return found
