"""The result of planning many picks and bins: one motion, and what is known of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ..models import ReadOnly
from ..planner import (
    TICK,
    Carry,
    Code,
    Finding,
    SentMotion,
    allowed,
    assumed_words,
    calibrated_landing,
    carry_entries,
    exceeded_entries,
    exceeded_lines,
    load_words,
    margins,
    models_words,
    peak_load,
    saved_entries,
    uncertain_words,
    unchecked_words,
    warnings,
    write_motion,
)
from ..problems import InputError, Scene, filling, plain, write_json

#: What is known of the order of picks, in words.
ORDERS = {"given": "as given", "exact": "the fastest of all"}
#: Files of a cycle's folder.
CYCLE_FILES = ("motion.csv", "cycle.png", "cycle.json")


class UnsolvedError(Exception):
    """Why a job file has no cycle."""


@dataclass(frozen=True, eq=False)
class Cycle(ReadOnly):
    """The result of `plan_cycle`.

    name: of the jobs. scene: theirs. motion: through all picks and throws, from rest to rest; None
    where `refused` says why there is none. order: "given", or "exact" if all orders were compared.
    time [s]: of planning.
    """

    name: str
    scene: Scene
    motion: SentMotion | None = None
    order: str = "given"
    time: dict[str, float] = field(default_factory=dict)
    refused: str = ""

    @property
    def solved(self) -> bool:
        """Whether there is a motion, and the verdict on it has no broken limit."""
        return self.motion is not None and self.motion.verdict.ok

    @property
    def message(self) -> str:
        """Why the cycle is not solved, or what it takes."""
        if self.motion is None or not self.motion.verdict.ok:
            return self.refused if self.motion is None else self.motion.verdict.words
        count = len(self.motion.carries)
        return f"{count} object{'s' if count > 1 else ''} in {self.duration:.2f} s"

    @property
    def duration(self) -> float:
        """Time [s] of the motion; NaN without one."""
        return math.nan if self.motion is None else self.motion.duration

    @cached_property
    def _findings(self) -> list[tuple[Carry, Finding]]:
        """What the throws are warned of."""
        found = list[tuple[Carry, Finding]]()
        for one in () if self.motion is None else self.motion.carries:
            claim = calibrated_landing(one.throw, one.throw.target)
            unlike = () if claim is None else claim.findings
            each = (*warnings(one.throw.deciding, one.throw.target), *unlike)
            found += [(one, finding) for finding in each]
        return found

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the throws, each a sentence after the names of its objects."""
        return tuple(_named((one, finding.words) for one, finding in self._findings))

    def to_dict(self) -> dict[str, Any]:
        """The cycle as JSON: SI units, radians, poses in the base frame, times on its clock."""
        motion = self.motion
        carries = () if motion is None else motion.carries
        findings = () if motion is None else motion.verdict.findings
        found: dict[str, Any] = plain(
            {
                "jobs": self.name,
                "status": "solved" if self.solved else "not_solved",
                "message": self.message,
                "duration": self.duration,
                "per_object": self.duration / len(carries) if carries else math.nan,
                "order": self.order,
                "steps": [carry_entries(one) for one in carries],
                "findings": [finding.to_dict() for finding in findings],
                "exceeds": exceeded_entries(allowed(self.scene)),
                "assumed": self.scene.assumed,
                "notes": self.scene.notes,
                "warnings": self.warnings if self.solved else (),
                "time": self.time,
            }
        )
        return found

    def save(self, folder: str | Path) -> None:
        """Write cycle.json and, if it is solved, motion.csv.

        motion.csv: all joints at 1 kHz, and `gripper`: 1 while it is to be closed, 0 open.
        InputError if the folder cannot be written, which then stays as it was.
        """
        document = self.to_dict()
        with filling(Path(folder), CYCLE_FILES) as scratch:
            if self.motion is not None and self.solved:
                write_motion(self.motion, scratch / "motion.csv")
            saved = self.motion if self.solved else None
            write_json(scratch / "cycle.json", saved_entries(saved, document))

    def sent_motion(self) -> SentMotion:
        """The motion that is sent; InputError for a cycle that is not solved."""
        if self.motion is None:
            raise InputError(f"{self.name}: the cycle is not solved: {self.refused}")
        return self.motion

    def summary(self) -> str:
        """The cycle as lines for people."""
        if self.motion is None or not self.solved:
            return f"{self.name}: not solved: {self.message}"
        count = len(self.motion.carries)
        each = "" if count == 1 else f", {self.duration / count:.2f} s each"
        lines = [
            f"{self.name}: solved, {self.message}{each}, order {ORDERS[self.order]}, planned in "
            f"{self.time['total']:.1f} s",
            f"  {'object':14} {'bin':10} {'at pick':>8} {'let go':>8} {'lands':>8}  "
            f"{'error':16} {'load':>6}  smallest margin",
        ]
        for one in self.motion.carries:
            throw = one.throw.deciding
            dx, dtheta = throw.miss()
            moments = TICK * one.reach, one.detach_time, one.landing_time
            times = " ".join(f"{time:7.3f}s" for time in moments)
            error = f"{1e3 * abs(dx):.2f} mm, {math.degrees(abs(dtheta)):.2f}°"
            load, (_, margin) = load_words(peak_load(throw)), margins(throw)[0]
            lines.append(f"  {one.pick:14} {one.bin:10} {times}  {error:16} {load:>6}  {margin}")
        differ = [one for one, finding in self._findings if finding.code is Code.MODELS_DIFFER]
        if differ:
            words = models_words([one.throw.deciding for one in differ])
            lines.append(f"  {', '.join(one.pick for one in differ)}: {words}")
        others = (
            (one, uncertain_words(finding) if finding.code is Code.UNCERTAIN else finding.words)
            for one, finding in self._findings
            if finding.code is not Code.MODELS_DIFFER
        )
        lines += [f"  {words}" for words in _named(others)]
        lines += [f"  {words}" for words in exceeded_lines(allowed(self.scene), "up to ")]
        if words := unchecked_words(self.scene):
            lines.append(f"  {words}")
        if words := assumed_words(self.scene, self.scene.assumed):
            lines.append(f"  {words}")
        return "\n".join(lines + [f"  note: {words}" for words in self.scene.notes])


def _named(sentences: Iterable[tuple[Carry, str]]) -> Iterator[str]:
    """Each sentence once, after the names of its objects."""
    found = dict[str, list[str]]()
    for one, words in sentences:
        found.setdefault(words, []).append(one.pick)
    yield from (f"{', '.join(names)}: {words}" for words, names in found.items())
