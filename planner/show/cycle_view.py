"""The 3-D view of a cycle: one motion of the arm, and each object on its way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...models import Array, Indices, ReadOnly
from .style import PHASES
from .view import ObjectView, View, put, rgb
from .view_throw import SpaceThrow

#: Direction from which a cycle is seen: from the right, in front and above.
SEEN_FROM = (0.45, -1.0, 0.6)
#: Distance of the camera, as a factor of the one at which all CoMs just fit.
MARGIN = 1.2


@dataclass(frozen=True, eq=False)
class SpaceCycle(ReadOnly):
    """Throws of an arm as one motion, over times (N,) [s], every millisecond.

    names: of the objects. throws: each on a clock of its own, which begins at `begins` [s]; held
    [s]: from when on the hand carries the object. joints (N, n, 4, 4): the arm's frames after each
    joint; hand (N, 4, 4): as in `SpaceThrow`; all in the base frame.
    """

    name: str
    names: tuple[str, ...]
    throws: tuple[SpaceThrow, ...]
    begins: tuple[float, ...]
    held: tuple[float, ...]
    times: Array
    joints: Array
    hand: Array

    @cached_property
    def _rows(self) -> tuple[Indices, ...]:
        """Indices (N,) into the times of each throw."""
        return tuple(
            np.clip(np.rint((self.times - begin) / 1e-3).astype(int), 0, len(throw.line.times) - 1)
            for throw, begin in zip(self.throws, self.begins, strict=True)
        )

    @cached_property
    def bars(self) -> tuple[Array, ...]:
        """Poses (N, 4, 4) of each object's CoM: at its pick, carried, thrown, at its end."""
        found = list[Array]()
        for throw, begin, held, rows in zip(
            self.throws, self.begins, self.held, self._rows, strict=True
        ):
            in_hand = np.linalg.inv(throw.hand[0]) @ throw.bar[0]
            carrying = np.maximum(np.arange(len(self.times)), self.index(held))
            carried = self.hand[carrying] @ in_hand
            thrown = (self.times >= begin)[:, None, None]
            found.append(np.where(thrown, throw.bar[rows], carried))
        return tuple(found)

    def index(self, time: float) -> int:
        """Index of the instant nearest to `time` [s]."""
        return int(np.abs(self.times - time).argmin())

    def object_phase(self, number: int, index: int) -> str:
        """Phase of an object at an instant."""
        return self.throws[number].line.phase_name(int(self._rows[number][index]))

    def words(self, index: int) -> str:
        """The object that was taken last, and its phase."""
        time = float(self.times[index])
        number = max(0, sum(held <= time for held in self.held) - 1)
        return f"{self.names[number]}: {self.object_phase(number, index)}"

    def since_detach(self, index: int) -> float:
        """Time [s] since the hand let go of the last object; negative while it holds one."""
        time, since = float(self.times[index]), math.inf
        for throw, begin, held in zip(self.throws, self.begins, self.held, strict=True):
            if held <= time:
                since = time - begin - throw.throw.detach_time
        return since

    def phases(self) -> dict[str, dict[str, float]]:
        """`SpaceThrow.phases` of each object, on the cycle's clock."""
        return {
            name: {
                phase: held if phase == "carry" else begin + time
                for phase, time in throw.phases().items()
            }
            for name, throw, begin, held in zip(
                self.names, self.throws, self.begins, self.held, strict=True
            )
        }


class CycleView(View):
    """A cycle in a viser server; `show` moves all bodies to a time."""

    def __init__(self, server: Any, cycle: SpaceCycle) -> None:
        self.cycle, self.objects = cycle, list[ObjectView]()
        super().__init__(server, cycle.throws[0])
        targets = [(cycle.throws[0].throw.target, cycle.throws[0].scene.cup)]
        self.objects.append(self)
        for number, throw in enumerate(cycle.throws[1:], start=2):
            # A bin is drawn once.
            target = throw.throw.target, throw.scene.cup
            one = ObjectView(server, throw, f"/object{number}", target not in targets)
            if target not in targets:
                one.aim(throw.throw.target)
            targets.append(target)
            one.draw_path()
            self.objects.append(one)
        self.show(0.0)

    def show(self, time: float) -> int:
        """Moves everything to `time` [s]; returns the instant's index."""
        cycle = self.cycle
        i = cycle.index(time)
        with self.server.atomic():
            for frame, pose in zip(self.joints, cycle.joints[i], strict=True):
                put(frame, pose)
            put(self.hand, cycle.hand[i])
            for number, one in enumerate(self.objects):
                put(one.bar, cycle.bars[number][i])
                one.box.color = rgb(PHASES[cycle.object_phase(number, i)])
            self._open_pads(cycle.since_detach(i))
        return i

    def _draw_marks(self) -> None:
        """None: those of several throws would cover each other."""

    def _aim_camera(self) -> None:
        """Looks at all that moves."""
        cycle, camera = self.cycle, self.server.initial_camera
        moving = [bar[:, :3, 3] for bar in cycle.bars]
        points = np.vstack([*moving, cycle.joints[..., :3, 3].reshape(-1, 3), np.zeros((1, 3))])
        low, high = points.min(axis=0), points.max(axis=0)
        camera.fov = math.radians(40.0)
        away = MARGIN * np.linalg.norm(high - low) / 2 / math.tan(camera.fov / 2)
        camera.look_at = (low + high) / 2
        camera.position = camera.look_at + away * np.array(SEEN_FROM) / np.linalg.norm(SEEN_FROM)
        camera.up = (0.0, 0.0, 1.0)
