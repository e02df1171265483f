"""Job files: many picks and bins of one arm, for `throwplan cycle`."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..problems import (
    Arm,
    Bin,
    Cost,
    InputError,
    Mistakes,
    Obstacle,
    Scene,
    Section,
    check_angles,
    from_table,
    load_scene,
    meanings,
    optional,
    quantity,
    scene_from_table,
    shipped,
    shipped_text,
    text_of,
    toml_tables,
    unknown,
    within,
)

#: Largest numbers of picks and bins.
MOST_PICKS, MOST_BINS = 100, 100
#: Sections of a scene that a pick, and a bin, may have for itself.
PICK_SECTIONS = ("object", "contact", "grasp")
BIN_SECTIONS = ("target", "cup", "landing", "tolerance")
#: Keys of a scene's [bin], which a bin has beside its name.
BIN_KEYS = tuple(meanings(Bin))
#: Sections of a scene that only a plan of one throw follows.
SINGLE_SECTIONS = ("rest", "choice", "robust")
#: Weight [1/s] of the time in [cost] of a base without: the others hardly count beside it.
TIME = 100.0

#: The package whose folder `jobs` has the shipped files.
HOME = "throwplan.cycles"


@dataclasses.dataclass(frozen=True)
class JobBin(Section):
    """Where objects are thrown: its target as in a scene's [target], a pose or a region, at rest or
    moving from where it is when the cycle starts; a cup only if it has one of its own. Or with the
    keys of a scene's [bin], then without target all landings in it. The walls of all bins are
    obstacles of each motion.
    """

    name: str = quantity("of the bin, for `bins` and messages")
    sections: dict[str, Any] = dataclasses.field(default_factory=dict, metadata={})

    def check(self) -> None:
        """A name for people."""
        _check_name(self.name)


@dataclasses.dataclass(frozen=True)
class Pick(Section):
    """An object that the arm takes: where, how long that takes, and into which bins it may go.

    Where: `joints_deg`, or `x`, `y`, `z` of the pads' centre for a hand that points down.
    Sections [pick.object], [pick.contact] and [pick.grasp] replace keys of the scene's.
    """

    name: str = quantity("of the object, for messages")
    joints: tuple[float, ...] | None = optional(
        "degrees, all joints at the grasp; or give x, y and z", degrees=True
    )
    x: float | None = optional("m, of the pads' centre at the grasp, base frame", unit="m")
    y: float | None = optional("m", unit="m")
    z: float | None = optional("m", unit="m")
    turn: float | None = optional(
        "degrees, of the hand about the vertical, with x, y and z; 0: the pads' plane is that of a "
        "throw along x; left out: of a throw over that place",
        degrees=True,
    )
    grasp_time: float = quantity(
        "s, at rest there until the object is held", least=0, most=60, default=0.4
    )
    bins: tuple[str, ...] | None = optional("names of the bins that it may go to; left out: any")
    sections: dict[str, Any] = dataclasses.field(default_factory=dict, metadata={})

    @property
    def place(self) -> tuple[float, float, float] | None:
        """x, y, z [m] of the hand pose; None for a pick by its joints."""
        if self.x is None or self.y is None or self.z is None:
            return None
        return self.x, self.y, self.z

    def check(self) -> None:
        """A name for people; joints, or a hand pose."""
        _check_name(self.name)
        given = [name for name in ("x", "y", "z") if getattr(self, name) is not None]
        if (self.joints is None) != (len(given) == 3) or (self.joints is not None and given):
            raise InputError("give 'joints_deg', or all of 'x', 'y' and 'z'")
        if self.turn is not None and self.joints is not None:
            raise InputError("turn_deg: only with x, y and z")


@dataclasses.dataclass(frozen=True, kw_only=True)
class JobKeys(Section):
    """Keys of a job file before its first pick or bin."""

    scene: str = quantity("a built-in scene with [robot], or a scene file seen from this one")
    order: str = quantity(
        "`free`: in the least time; `given`: as in the file",
        choices=("free", "given"),
        default="free",
    )
    home: tuple[float, ...] | None = optional(
        "degrees, all joints at rest before the first pick and after the last throw; left out: the "
        "cycle begins at its first pick and returns to it",
        degrees=True,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Jobs(JobKeys):
    """Picks and bins of one arm. Read from a file by `load_jobs`.

    base: tables of the scene without target, cup, bin and start; arm, gripper, contact, workspace,
    obstacles, tolerance, limits and cost are the scene's. base_scene: the same as it was read.
    """

    name: str
    base: dict[str, Any]
    base_scene: Scene
    arm: Arm
    bins: tuple[JobBin, ...]
    picks: tuple[Pick, ...]

    @property
    def loud(self) -> Jobs:
        """The same jobs with throws whose load on the pads costs nothing."""
        cost = self.base.get("cost", {"time": TIME})
        return dataclasses.replace(self, base=self.base | {"cost": cost | {"quiet": 0.0}})

    def check(self) -> None:
        """Poses fit the arm, names are unique, bins are known, and each throw's scene is one."""
        mistakes = Mistakes()
        if self.home is not None:
            with mistakes.kept():
                check_angles("home_deg", self.home, range(1, self.arm.joints + 1), self.arm)
        for kind, rows, most in (("bin", self.bins, MOST_BINS), ("pick", self.picks, MOST_PICKS)):
            if not 1 <= len(rows) <= most:
                mistakes.lines.append(f"[[{kind}]]: has {len(rows)}, must be 1 to {most}")
            names = [row.name for row in rows]
            for name in sorted({name for name in names if names.count(name) > 1}):
                mistakes.lines.append(f"[[{kind}]] name = {name!r}: must be different for each")
        names = [one.name for one in self.bins]
        for number, pick in enumerate(self.picks, start=1):
            with mistakes.kept(), within(f"pick {number}"):
                self._check_pick(pick, names)
        mistakes.refuse()
        used = {one.name for pick in self.picks for one in self.bins_of(pick)}
        for name in (name for name in names if name not in used):
            mistakes.lines.append(f"[[bin]] name = {name!r}: `bins` of no pick names it")
        for found in dict.fromkeys(self._refused()):
            mistakes.lines.append(found)
        mistakes.refuse()

    def _check_pick(self, pick: Pick, names: list[str]) -> None:
        mistakes = Mistakes()
        with mistakes.kept():
            if pick.joints is not None:
                every = range(1, self.arm.joints + 1)
                check_angles("joints_deg", pick.joints, every, self.arm)
        for name in pick.bins or ():
            if name not in names:
                hint = InputError.hint(name, names)
                mistakes.lines.append(f"bins: no bin {name!r}{hint} (bins: {', '.join(names)})")
        contact = pick.sections.get("contact", {})
        if "pressure" in contact:
            words = "the release models of a cycle do not know it: leave it out"
            mistakes.lines.append(f"[contact] pressure = {contact['pressure']!r}: {words}")
        if pick.bins == ():
            mistakes.lines.append("bins = []: must name at least one bin")
        mistakes.refuse()

    def _refused(self) -> list[str]:
        """Why scenes of throws are none: mistakes of bins, then of picks."""
        found, plain = list[str](), dataclasses.replace(self.picks[0], sections={})
        bins = {one.name: self._mistakes(plain, one) for one in self.bins}
        for number, one in enumerate(self.bins, start=1):
            found += [f"bin {number}: {line}" for line in bins[one.name]]
        for number, pick in enumerate(self.picks, start=1):
            for one in self.bins_of(pick):
                if pick.sections and not bins[one.name]:
                    found += [f"pick {number}: {line}" for line in self._mistakes(pick, one)]
        return found

    def _mistakes(self, pick: Pick, one: JobBin) -> list[str]:
        try:
            self._scene(pick, one)
        except InputError as error:
            return str(error).splitlines()
        return []

    def bin(self, name: str) -> JobBin:
        """The bin of a name."""
        return next(one for one in self.bins if one.name == name)

    def bins_of(self, pick: Pick) -> tuple[JobBin, ...]:
        """The bins that a pick's object may go to."""
        return tuple(one for one in self.bins if pick.bins is None or one.name in pick.bins)

    def _kept(self, key: str, table: Mapping[str, Any]) -> dict[str, Any]:
        """The scene's keys of a section that a pick's table keeps: beside another outline neither
        width nor mesh."""
        of_shape = ("width", "mesh") if "outline" in table else ()
        return {name: v for name, v in self.base.get(key, {}).items() if name not in of_shape}

    @functools.cached_property
    def _walls(self) -> dict[str, tuple[Obstacle, ...]]:
        """The walls of each bin that has some, by its name."""
        plain = dataclasses.replace(self.picks[0], sections={})
        scenes = {one.name: self._scene(plain, one) for one in self.bins if "bin" in one.sections}
        return {
            name: tuple(
                wall.changed(name=f"{wall.name} of {name}")
                for wall in scene.bodies_around[len(scene.obstacle) :]
            )
            for name, scene in scenes.items()
        }

    def scene_of(self, pick: Pick, one: JobBin) -> Scene:
        """The scene of a throw, with the walls of other bins; its weights are those for little
        time, unless the base has some."""
        scene = self._scene(pick, one)
        walls = [wall for name, own in self._walls.items() if name != one.name for wall in own]
        return scene.replace(obstacle=(*scene.obstacle, *walls)) if walls else scene

    def _scene(self, pick: Pick, one: JobBin) -> Scene:
        """The scene of a throw without other bins."""
        own = {key: self._kept(key, table) | table for key, table in pick.sections.items()}
        table = self.base | one.sections | own | {"name": self.name}
        scene = scene_from_table(table)
        scene.check_target_in_cup()
        if scene.target is not None and scene.target.arrival is not None:
            raise InputError("[target] arrival: a cycle throws as soon as it can: leave it out")
        return scene if scene.cost is not None else scene.replace(cost=Cost(time=TIME))


def _check_name(name: str) -> None:
    """InputError for a name that is empty or would break a table's lines."""
    if not name or not name.isprintable():
        raise InputError(f"name = {name!r}: must be one line of text")


def jobs_names() -> list[str]:
    """Names of the shipped job files."""
    return list(shipped("jobs", HOME))


def jobs_text(name: str) -> str:
    """The TOML text of shipped jobs; InputError for an unknown name."""
    return shipped_text("jobs", name, HOME)


def load_jobs(source: str | Path) -> Jobs:
    """Jobs from a shipped name or a TOML file.

    InputError with one line for each mistake: file, pick or bin, key, value and what is allowed.
    """
    source = str(source)
    text, path = text_of("jobs", source, package=HOME)
    folder, name = (path.parent, path.stem) if path else (None, source)
    tables = toml_tables(text, source)
    with within(source):
        return jobs_from(tables, name, folder)


def jobs_from(tables: Mapping[str, Any], name: str, folder: Path | None = None) -> Jobs:
    """Jobs from the tables of their file; folder: of the scene file that they name."""
    mistakes = Mistakes()
    keys, base, bins, picks = None, None, (), ()
    with mistakes.kept():
        own = {key: value for key, value in tables.items() if key not in ("bin", "pick")}
        keys = from_table(JobKeys, own)
    with mistakes.kept():
        if isinstance(tables.get("scene"), str):
            base = _base(tables["scene"], folder)
    with mistakes.kept():
        bins = _rows("bin", JobBin, BIN_SECTIONS, tables.get("bin"))
    with mistakes.kept():
        picks = _rows("pick", Pick, PICK_SECTIONS, tables.get("pick"))
    mistakes.refuse()
    assert keys is not None and base is not None
    table, scene = base
    assert scene.arm is not None
    own = {"name": name, "base": table, "base_scene": scene}
    return Jobs(**vars(keys), **own, arm=scene.arm, bins=bins, picks=picks)


def _base(name: str, folder: Path | None) -> tuple[dict[str, Any], Scene]:
    """The scene's tables without target, cup, bin and start, and the scene without them."""
    path = folder / name if folder is not None and name.endswith(".toml") else name
    with within(f"scene = {name!r}"):
        scene = load_scene(path)
        if scene.robot is None or scene.arm is None:
            raise InputError("has no [robot]: a cycle needs an arm")
        table, mistakes = scene.table(), Mistakes()
        for key in SINGLE_SECTIONS:
            if getattr(scene, key) is not None:
                mistakes.lines.append(f"[{key}]: only a plan of one throw follows it: leave it out")
        mistakes.refuse()
    table["robot"] = {key: v for key, v in table["robot"].items() if key != "start_deg"}
    for key in ("target", "cup", "bin", "description"):
        table.pop(key, None)
    return table, scene.changed(cup=None, bin=None)


def _rows(key: str, kind: type[Any], sections: tuple[str, ...], value: Any) -> tuple[Any, ...]:
    """The picks or bins of their tables, with the tables of their sections."""
    if not isinstance(value, list) or not all(isinstance(row, Mapping) for row in value):
        words = "is missing" if value is None else "must be tables"
        raise InputError(f"[[{key}]] {words}")
    found, mistakes = list[Any](), Mistakes()
    for number, row in enumerate(value, start=1):
        with mistakes.kept(), within(f"{key} {number}"):
            inner = {name: row[name] for name in sections if name in row}
            wrong = Mistakes()
            for name, table in inner.items():
                if not isinstance(table, Mapping):
                    wrong.lines.append(f"{name} = {table!r}: must be a section [{key}.{name}]")
            own = {name: v for name, v in row.items() if name not in sections}
            if kind is JobBin:
                known = ["name", *BIN_KEYS, *sections]
                wrong.lines += [unknown(name, known) for name in own if name not in known]
                own = {name: v for name, v in own.items() if name in known}
                if walls := {name: own.pop(name) for name in BIN_KEYS if name in own}:
                    inner["bin"] = walls
                elif "target" not in row:
                    wrong.lines.append("section [bin.target] is missing")
            with wrong.kept():
                found.append(from_table(kind, own, sections=inner))
            wrong.refuse()
    mistakes.refuse()
    return tuple(found)
