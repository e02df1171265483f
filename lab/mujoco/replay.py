"""A motion replayed in MuJoCo, by contacts and flight independent of the planner's: how objects are
held, where they land and end, and what they hit."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from ...models import Array, FlightLaw, FlightState, ReadOnly
from ...pictures import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    RED,
    draw_bars,
    draw_cup,
    new_figure,
    save_figure,
)
from ...planner import (
    TICK,
    Carry,
    SentMotion,
    Source,
    Throw,
    enters,
    is_inside,
    is_still,
    load_mujoco,
    outside_tolerance,
    plane_poses,
    pose_of,
    sent_motion,
    wall_name,
)
from ...problems import Bin, Cup, InputError, Scene, checked, filling, plain, write_json
from .motion import ObjectMotion, simulate_motion, states_in_plane
from .world import FRICTION, of_bin

#: Files of a replay's folder; the picture is of a motion with one object.
FILES = ("replay.json", "replay.csv", "replay.png")
#: What a replay's landing is compared with.
Other = Literal["target", "sp", "limit_surface"]
OTHERS: tuple[Other, ...] = get_args(Other)


@dataclass(frozen=True)
class ReplayEnd:
    """The bar at the end of a replay into a cup or bin.

    into: which of them; inside: its CoM is between the walls and its lower end in it; for a bar
    that still moves 4 s after landing, during the last second; at_rest: it does not move; entered:
    its lower end was `insertion` below the cup's rim, or its CoM in the bin, at some time;
    touched_rim: it hit the wall before; pose: x, y, z [m] and theta [rad], y across the throw's
    plane.
    """

    into: str
    inside: bool
    entered: bool
    touched_rim: bool
    at_rest: bool
    pose: tuple[float, float, float, float]

    def words(self) -> list[str]:
        """The end of the replay as lines for people."""
        x, _, z, theta = self.pose
        where = f"x {x:.3f} m, z {z:.3f} m, theta {math.degrees(theta):.1f} deg"
        if self.inside:
            state = "comes to rest" if self.at_rest else "still rocks, 4 s after landing,"
            ending = f"{state} in the {self.into}: {where}"
        elif self.at_rest:
            ending = f"does NOT end in the {self.into}: it rests at {where}"
        else:
            ending = f"does NOT end in the {self.into}: 4 s after landing it moves at {where}"
        if not (self.entered or self.touched_rim):
            return [ending, "does not go in at all"]
        touch = (
            f"touches the {self.into}'s wall or rim" if self.touched_rim else "clears wall and rim"
        )
        return [ending, f"{touch} on the way in"]


@dataclass(frozen=True, repr=False)
class ObjectReplay(ReadOnly):
    """An object of a motion by MuJoCo. Positions in the throw's plane, m; angles in rad.

    landing: x, z, theta as the CoM falls through the target's height if nothing is in its way, NaN
    if it does not; aside [m]: left of the throw's plane. times (K,) [s] on the throw's clock, 1 ms
    apart from the opening on; com (3, K): x, z, theta, until the object rests (without a cup: until
    landing); places (K, 3) [m]: its CoM in the base frame. touched: bodies that it hit in flight
    and after it, in order; collisions: those that it touches while it is "waiting", "carried", and
    "flying" until it has landed, without its cup. slip [m], turn [rad]: of the object in the pads
    as these begin to open, from where they grasped it. rest: None without a cup; restitution: of
    collisions.
    """

    carry: Carry
    landing: tuple[float, float, float]
    aside: float
    times: Array
    com: Array
    places: Array
    touched: tuple[str, ...]
    collisions: dict[str, tuple[str, ...]]
    slip: float
    turn: float
    rest: ReplayEnd | None
    restitution: float

    @property
    def throw(self) -> Throw:
        """The throw."""
        return self.carry.throw

    @cached_property
    def _unbiased(self) -> Throw:
        """The throw without the bias of [calibration], which MuJoCo does not know."""
        return self.throw.in_scene(self.throw.scene.changed(calibration=None))

    @property
    def sp(self) -> tuple[float, float, float]:
        """The landing by the sliding pivot, without a bias."""
        return self._unbiased.sliding_pivot.landing.pose

    @property
    def limit_surface(self) -> tuple[float, float, float]:
        """The landing by the limit surface, without a bias."""
        return self._unbiased.limit_surface.landing.pose

    @property
    def inside(self) -> bool:
        """Whether it lands within the scene's tolerance of the target."""
        dx, dtheta = self.off("target")
        way, turn = math.hypot(dx, self.aside), float(np.nan_to_num(dtheta))
        return math.isfinite(dx) and not outside_tolerance(self.throw.scene.tolerance, way, turn)

    @property
    def hits(self) -> list[str]:
        """Bodies that it touches before it has landed, with what it does then."""
        return [f"{name} ({phase})" for phase, names in self.collisions.items() for name in names]

    @property
    def assumed(self) -> str:
        """Assumptions about cup or bin, in words."""
        into = self.throw.scene.opening
        assert into is not None
        kind = "steadily moving" if self.throw.target.speed else "fixed"
        return (
            f"a {kind}, rigid {into.KIND}, friction {FRICTION:g}; what hits it leaves with "
            f"{self.restitution:g} of its speed"
        )

    def off(self, other: Other) -> tuple[float, float]:
        """MuJoCo's landing less another: (dx [m], dtheta [rad]).

        other: "target", "sp" or "limit_surface"; dtheta is NaN for a target that leaves it open.
        """
        checked("other", other, str, {"choices": OTHERS})
        target = self.throw.target.nearest(self.landing[0], self.landing[2])
        theta = math.nan if target.theta is None else target.theta
        x, _, angle = {
            "target": (target.plane_x, target.z, theta),
            "sp": self.sp,
            "limit_surface": self.limit_surface,
        }[other]
        return float(self.landing[0] - x), float(self.landing[2] - angle)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians; poses in the base frame for an arm."""
        rest, cup = self.rest, None
        if rest is not None:
            x, y, z, theta = rest.pose
            cup = {
                "in": rest.inside,
                "entered": rest.entered,
                "touched_rim": rest.touched_rim,
                "at_rest": rest.at_rest,
                "rest": self._pose(x, z, theta, y),
            }
        sizes = {other: map(abs, self.off(other)) for other in OTHERS}
        found = {
            "pick": self.carry.pick,
            "bin": self.carry.bin,
            "inside": self.inside,
            "slip": {"position": self.slip, "angle": self.turn},
            "landing": {
                "mujoco": self._pose(*self.landing),
                "sp": self._pose(*self.sp),
                "limit_surface": self._pose(*self.limit_surface),
            },
            "difference": {
                name: dict(zip(("position", "angle"), size, strict=True))
                for name, size in sizes.items()
            },
            "aside": self.aside,
            "touched": self.touched,
            "hits": self.collisions,
            "restitution": self.restitution,
            "cup": cup,
        }
        table: dict[str, Any] = plain(found)
        return table

    def summary(self) -> list[str]:
        """How the object is held, where it lands and what it hits, as lines for people."""
        into = f" into {self.carry.bin}" if self.carry.bin else ""
        lines = [f"  {self.carry.name}{into}: never falls to the target's height"]
        if math.isfinite(self.landing[0]):
            where = f"{'inside' if self.inside else 'OUTSIDE'} the tolerance"
            lines = [f"  {self.carry.name}{into}: {where}, MuJoCo less"]
            for key in OTHERS:
                dx, dtheta = self.off(key)
                words = "sliding pivot" if key == "sp" else key.replace("_", " ")
                angle = "open" if math.isnan(dtheta) else f"{math.degrees(dtheta):+.3f} deg"
                lines.append(f"    {words:15}{1e3 * dx:+10.3f} mm{angle:>13}")
        slip = f"{1e3 * self.slip:.3f} mm and {math.degrees(self.turn):.3f} deg"
        lines.append(f"    slips by {slip} while it is carried")
        if self.throw.scene.calibration is not None:
            lines.append("    without the bias of [calibration], by which the throw is aimed off")
        if self.hits:
            lines.append(f"    on its way it hits: {', '.join(self.hits)}")
        if self.rest is not None:
            lines += [f"    {words}" for words in (*self.rest.words(), f"assumed: {self.assumed}")]
        return lines

    def _pose(self, x: float, z: float, theta: float, y: float = 0.0) -> dict[str, float]:
        """A pose in the throw's plane, `y` [m] across it, as in plan.json."""
        if self.throw.scene.robot is None:
            return {"x": x, "z": z, "theta": theta}
        # Forward and up are x and z of MuJoCo: its y is to the left of the throw.
        place = self.throw.target.plane.points(x, z, y).tolist()
        return dict(zip("xyz", place, strict=True)) | {"theta": theta}


@dataclass(frozen=True, repr=False)
class Replay(ReadOnly):
    """A motion by MuJoCo: its objects in the order of their throws. simulated [s]: from the first
    sample of the motion until the last object lies; run [s]: run time."""

    motion: SentMotion
    objects: tuple[ObjectReplay, ...]
    simulated: float
    run: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON: `ObjectReplay.to_dict` of each object."""
        times = {"simulated": self.simulated, "run": self.run}
        objects = [one.to_dict() for one in self.objects]
        return {"scene": self.motion.name, "objects": objects, "time": times}

    def summary(self) -> str:
        """How each object is held and where it lands, as lines for people."""
        good, count = sum(one.inside for one in self.objects), len(self.objects)
        lines = [f"{self.motion.name}: in MuJoCo {good} of {count} land inside the tolerance"]
        for one in self.objects:
            lines += one.summary()
        return "\n".join([*lines, f"  {self.simulated:.2f} s simulated in {self.run:.1f} s"])

    def save(self, folder: str | Path) -> None:
        """Write replay.json, replay.csv and, of a motion with one object, replay.png; InputError if
        that fails.

        replay.csv: the CoM of each object, numbered from 1, in the base frame at 1 kHz from its
        opening on, on the motion's clock.
        """
        rows = list[Array]()
        for number, one in enumerate(self.objects, start=1):
            columns = np.full(len(one.times), number), one.carry.begin + one.times
            rows.append(np.column_stack([*columns, one.places, one.com[2]]))
        with filling(Path(folder), FILES) as scratch:
            write_json(scratch / "replay.json", self.to_dict())
            names = "object,t,x,y,z,theta"
            path = scratch / "replay.csv"
            np.savetxt(path, np.vstack(rows), delimiter=",", header=names, comments="", fmt="%.9g")
            if len(self.objects) == 1:
                _draw(self.objects[0], self.motion.name, scratch / "replay.png")


def replay(plan: Source, step: float = 1e-4, restitution: float = 0.1) -> Replay:
    """Simulate a motion in MuJoCo, from its first sample until each object lies in its cup or has
    landed; needs the extra `mujoco`.

    plan: a plan, a throw, a cycle, a sent motion, or the path of their file or of its folder. The
    hand follows the motion; all objects, cups, obstacles and the arm's links are in one world. Two
    pads with fingers close on each object at its pick with the gripper's force and carry it by
    friction alone: as far from each other as it is thick, each with one contact, whose limits are
    the limit surface's ellipsoid. Until it is held, an object stands fixed. What hits a cup or
    floor leaves with `restitution` (0 to 0.99) of its speed. step [s]: the largest, at most 0.2 ms;
    a fifth of it while pads open. InputError for what has no motion or a throw that never lands,
    and without MuJoCo.
    """
    # With 0.5 ms contacts lose what the verdict's grip holds.
    checked("step", step, float, {"least": 1e-7, "most": 2e-4})
    checked("restitution", restitution, float, {"least": 0, "most": 0.99})
    load_mujoco("replay")
    begin, motion = time.perf_counter(), sent_motion(plan)
    if not all(one.throw.lands for one in motion.carries):
        raise InputError("the throw never falls to the target's height")
    motions = simulate_motion(motion, step, restitution)
    each = zip(motion.carries, motions, strict=True)
    objects = tuple(_object_replay(*one, restitution) for one in each)
    run = time.perf_counter() - begin
    return Replay(motion, objects, float(motions[0].states[-1, 0]), run)


def _object_replay(carry: Carry, motion: ObjectMotion, restitution: float) -> ObjectReplay:
    """What a simulated object did."""
    throw, scene, begin = carry.throw, carry.throw.scene, carry.begin
    theta = float(throw.hand(np.array([throw.opening_time])).pose[2, 0]) + scene.grasp.angle
    opened = motion.states[motion.states[:, 0] >= carry.opening_time]
    states = states_in_plane(carry, opened)
    times, com = states[:, 0], plane_poses(states, theta)
    flying = times >= throw.detach_time
    landing, landed, aside = _landing_of(states[flying][0], com[:, flying][:, 0], throw)
    touched, rest, own = motion.touched["flying"], None, of_bin(carry.bin)
    if (into := scene.opening) is not None:
        at_rest = bool(is_still(states[-round(0.1 / TICK) :]))
        walls = [at - begin for name, at in touched.items() if name == wall_name(into) + own]
        flown, wall = states[flying], min(walls, default=math.inf)
        rest = _end_inside(scene, into, flown, wall, at_rest, com[2, flying][0])
    elif math.isfinite(landed):
        # Nothing is known of what catches it.
        keep = times <= landed + TICK
        times, com, opened = times[keep], com[:, keep], opened[keep]
        touched = {name: at for name, at in touched.items() if at - begin <= landed}
    collisions = {phase: tuple(names) for phase, names in motion.touched.items()}
    collisions["flying"] = tuple(
        name
        for name, at in touched.items()
        if not name.startswith("floor")
        and not (name.startswith(("cup ", "bin ")) and name.endswith(own))
        and not at - begin > landed
    )
    return ObjectReplay(
        carry,
        landing,
        aside,
        times,
        com,
        opened[:, 1:4],
        tuple(touched),
        collisions,
        motion.slip,
        motion.turn,
        rest,
        restitution,
    )


def _landing_of(
    detach: Array, pose: Array, throw: Throw
) -> tuple[tuple[float, float, float], float, float]:
    """x, z, theta, time [s] and place aside [m] as the CoM falls freely through the target's height
    from MuJoCo's state (14,) and pose (3,) in the throw's plane; NaN if it does not."""
    # Turning about the throw's normal, which points along -y.
    x, z, theta = pose
    start = FlightState(x, z, theta, detach[8], detach[10], -detach[12])
    law, height = FlightLaw(throw.scene.gravity), throw.target.z
    duration = float(law.fall_time(start, height))
    if not math.isfinite(duration):
        return (math.nan, math.nan, math.nan), math.nan, math.nan
    end = law.after(start, duration)
    aside = float(detach[2] + duration * detach[9])
    return (float(end.x), height, float(end.theta)), float(detach[0] + duration), aside


def _end_inside(
    scene: Scene, into: Cup | Bin, states: Array, wall: float, at_rest: bool, theta: float
) -> ReplayEnd:
    """The end of a bar with MuJoCo's states (K, 14) in the throw's plane, with their times [s].

    wall [s]: when it first touched the wall, infinite if never. theta [rad]: see
    `plane_poses`.
    """
    times, at_end = states[:, 0], states[:, 0] >= states[-1, 0] - (0.0 if at_rest else 1.0)
    x, y, z = (float(value) for value in states[-1, 1:4])
    inside = bool(is_inside(scene, into, *pose_of(states[at_end])).all())
    entered = times[enters(scene, into, *pose_of(states))]
    rim = wall < entered.min(initial=math.inf)
    pose = x, y, z, float(plane_poses(states, theta)[2, -1])
    return ReplayEnd(into.KIND, inside, entered.size > 0, bool(rim), at_rest, pose)


def _draw(replay: ObjectReplay, name: str, path: Path) -> None:
    """The path of CoM and bar from the opening to the end, at true scale, and where models land."""
    scene, throw = replay.throw.scene, replay.throw
    title = f"{name}: thrown in MuJoCo"
    if replay.rest is not None:
        where = "in" if replay.rest.inside else "outside"
        title += f", ends {where} the {replay.rest.into}\n{replay.assumed}"
    figure = new_figure(8, 6.4, title)
    axes = figure.subplots()
    bar = scene.object
    if scene.opening is not None:
        draw_cup(axes, scene.opening)
    axes.plot(*replay.com[:2], color=BLACK, lw=1, zorder=4, label="CoM")
    opening = replay.times < replay.times[0] + throw.detach_time - throw.opening_time
    drawn = np.arange(len(replay.times)) % round(0.02 / TICK) == 0
    filled = (("opening", ORANGE, drawn & opening), ("after it", GREEN, drawn & ~opening))
    for words, colour, some in filled:
        draw_bars(axes, bar, replay.com[:, some].T, fc=colour, alpha=0.45, zorder=6)
        axes.plot([], [], color=colour, lw=5, label=words)
    draw_bars(axes, bar, replay.com[:, -1], fc=RED, zorder=6, label="end")
    landings = (("sliding pivot", replay.sp, BLUE), ("limit surface", replay.limit_surface, BLACK))
    for words, pose, colour in landings:
        label = f"landing, {words}"
        draw_bars(axes, bar, np.array(pose), fc="none", ec=colour, lw=1.2, zorder=7, label=label)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3)
    save_figure(figure, path)
