"""A throw replayed in MuJoCo, by contacts and flight independent of the planner's.

Also its view in 3-D: a bar that lands in a cup falls on into it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from ...models import Array, ReadOnly
from ...problems import InputError, Rest, checked
from ...problems.files import filling, plain, write_json
from ..rest import load_mujoco
from ..result import Plan, throw_of
from ..show import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    RED,
    SpaceThrow,
    draw_bars,
    draw_cup,
    new_figure,
    open_browser,
    own_style,
    run_panel,
    save,
    serving,
    space_throw,
)
from ..throw import TICK, Throw
from ..verdict import outside_tolerance
from .mujoco_throw import (
    FRICTION,
    LEAD,
    ReplayEnd,
    SimulatedFlight,
    fly,
    fly_alone,
    release_run,
    target_travel,
)

#: Files of a replay's folder.
FILES = ("replay.json", "replay.csv", "replay.png")


#: What a replay's landing is compared with.
Other = Literal["target", "sp", "limit_surface"]
OTHERS: tuple[Other, ...] = get_args(Other)


@dataclass(frozen=True, repr=False)
class Replay(ReadOnly):
    """A throw by MuJoCo. Positions in the throw's plane, m; angles in rad.

    landing: x, z, theta as the CoM falls through the target's height without collisions, NaN if it
    does not. times (K,) [s] on the motion's clock, 1 ms
    apart from the opening on, and com (3, K): x, z, theta among cup, obstacles, hand and base
    column, until the bar rests (without a cup: until landing). touched: bodies that the bar hit, in
    order; rest: None without a cup; restitution: of collisions; simulated, run [s]: simulated time
    and run time.
    """

    throw: Throw
    landing: tuple[float, float, float]
    times: Array
    com: Array
    touched: tuple[str, ...]
    rest: ReplayEnd | None
    restitution: float
    simulated: float
    run: float

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        x, z, theta = self.landing
        return f"Replay(landing x {x:.4f} m, z {z:.4f} m, theta {math.degrees(theta):.2f} deg)"

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
        outside = outside_tolerance(self.throw.scene.tolerance, dx, np.nan_to_num(dtheta))
        return math.isfinite(dx) and not outside

    @property
    def hits(self) -> list[str]:
        """Hand, base column and obstacles that the bar hits."""
        return [n for n in self.touched if n in ("hand", "base column") or "obstacle" in n]

    @property
    def assumed(self) -> str:
        """Assumptions about the cup, in words."""
        kind = "steadily moving" if self.throw.target.speed else "fixed"
        return (
            f"a {kind}, rigid cup, friction {FRICTION:g}; what hits it leaves with "
            f"{self.restitution:g} of its speed"
        )

    def off(self, other: Other) -> tuple[float, float]:
        """MuJoCo's landing less another: (dx [m], dtheta [rad]).

        other: "target", "sp" or "limit_surface"; dtheta is NaN for a target that leaves it open.
        """
        checked("other", other, str, {"choices": get_args(Other)})
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
            "scene": self.throw.scene.name,
            "landing": {
                "mujoco": self._pose(*self.landing),
                "sp": self._pose(*self.sp),
                "limit_surface": self._pose(*self.limit_surface),
            },
            "difference": {
                name: dict(zip(("position", "angle"), size, strict=True))
                for name, size in sizes.items()
            },
            "touched": self.touched,
            "restitution": self.restitution,
            "cup": cup,
            "time": {"simulated": self.simulated, "run": self.run},
        }
        table: dict[str, Any] = plain(found)
        return table

    def summary(self) -> str:
        """The replay as lines for people: landing, differences, way into the cup."""
        scene = self.throw.scene
        if not math.isfinite(self.landing[0]):
            lines = [f"{scene.name}: in MuJoCo it never falls to the target's height"]
        else:
            dx, dtheta = self.off("target")
            off = f"{1e3 * abs(dx):.3f} mm"
            if not math.isnan(dtheta):
                off += f" and {math.degrees(abs(dtheta)):.3f} deg"
            where = f"{'inside' if self.inside else 'OUTSIDE'} the tolerance"
            lines = [f"{scene.name}: in MuJoCo it lands {off} from the target, {where}"]
            lines.append(f"  {'MuJoCo less':15}{'dx':>13}{'dtheta':>13}")
            for key in OTHERS:
                dx, dtheta = self.off(key)
                words = "sliding pivot" if key == "sp" else key.replace("_", " ")
                angle = "open" if math.isnan(dtheta) else f"{math.degrees(dtheta):+.3f} deg"
                lines.append(f"  {words:15}{1e3 * dx:+10.3f} mm{angle:>13}")
        if scene.calibration is not None:
            lines.append("  all without the bias of [calibration], by which the throw is aimed off")
        if self.hits:
            lines.append(f"  on its way the bar hits: {', '.join(self.hits)}")
        if self.rest is not None:
            lines += [f"  {words}" for words in self.rest.words()]
            lines.append(f"  assumed: {self.assumed}")
        return "\n".join([*lines, f"  {self.simulated:.2f} s simulated in {self.run:.1f} s"])

    def save(self, folder: str | Path, draw: bool = True) -> None:
        """Write replay.json, replay.csv and (draw) replay.png; InputError if that fails."""
        with filling(Path(folder), FILES) as scratch:
            write_json(scratch / "replay.json", self.to_dict())
            self._write_path(scratch / "replay.csv")
            if draw:
                _draw(self, scratch / "replay.png")

    def _write_path(self, path: Path) -> None:
        """The CoM at 1 kHz from the opening on; with y, in the base frame, for an arm."""
        x, z, theta = self.com
        names, columns = "t,x,z,theta", [self.times, x, z, theta]
        if self.throw.scene.robot is not None:
            names = "t,x,y,z,theta"
            columns[1:2] = self.throw.target.plane.points(x, z).T[:2]
        table = np.column_stack(columns)
        np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.9g")

    def _pose(self, x: float, z: float, theta: float, y: float = 0.0) -> dict[str, float]:
        """A pose in the throw's plane, `y` [m] across it, as in plan.json."""
        if self.throw.scene.robot is None:
            return {"x": x, "z": z, "theta": theta}
        # Forward and up are x and z of MuJoCo: its y is to the left of the throw.
        place = self.throw.target.plane.points(x, z, y).tolist()
        return dict(zip("xyz", place, strict=True)) | {"theta": theta}


def replay(
    throw: Plan | Throw | str | Path,
    step: float = 1e-5,
    flight_step: float = 1e-4,
    points: int = 12,
    restitution: float = 0.1,
) -> Replay:
    """Throw a plan in MuJoCo; needs the extra `mujoco`.

    throw: a plan, a throw, or the path of a plan.json or of its folder. The hand goes the sent way
    from 50 ms before the opening, the bar held by `points` contacts a pad, on a ring that
    holds the torque of the patch (1: one contact with torsional friction, which is the limit
    surface's own ellipsoid); their force falls as the gripper's and they are gone when it is
    zero. The bar then flies, free to turn in space, once alone, for its landing, and once
    among the scene's cup, hand and base column. The cup is fixed and rigid, with the floor
    under it; what hits these leaves with `restitution` (0 to 0.99) of its speed. All is as a target
    that moves sees it: in its frame, which is the plan's when the object lands.
    step, flight_step [s]: of the opening, and after it. InputError for what is no plan, a throw
    that never lands, and without MuJoCo.
    """
    checked("points", points, int, {"least": 1, "most": 64})
    check_replay(restitution, step=step, flight_step=flight_step)
    start_time, throw = time.perf_counter(), _landing_throw(throw)
    height = throw.target.z
    opening, states = release_run(throw, step, points)
    states[:, 0] -= target_travel(throw, opening)
    states[:, 3] -= throw.target.speed
    detach, start = states[-1], float(opening[-1])
    expected = throw.deciding.landing.flight_time
    duration = 1.2 * expected + 0.2
    fine = duration / float(np.clip(math.ceil(duration / flight_step), 100, 20_000))
    free = fly_alone(throw, detach, start, start + duration, fine)
    landing, landing_time = landing_of(free, height)
    end = landing_time if math.isfinite(landing_time) else start + expected
    flown = fly(throw, detach, start, end, flight_step, restitution)
    poses = np.hstack([states[:, :3].T, flown.poses[:, 1:]])
    known = np.append(opening, flown.times[1:])
    times = np.arange(throw.opening_time, known[-1], TICK)
    com = np.array([np.interp(times, known, row) for row in poses])
    return Replay(
        throw,
        landing,
        times,
        com,
        flown.touched,
        flown.rest,
        restitution,
        simulated=float(known[-1] - throw.opening_time) + min(LEAD, throw.opening_time),
        run=time.perf_counter() - start_time,
    )


def check_replay(restitution: float, **steps: float) -> None:
    """InputError for an option of a replay out of range, and without MuJoCo."""
    checked("restitution", restitution, float, {"least": 0, "most": 0.99})
    for name, value in steps.items():
        checked(name, value, float, {"least": 1e-7, "most": 1e-3})
    load_mujoco("replay")


def landing_of(free: SimulatedFlight, height: float) -> tuple[tuple[float, float, float], float]:
    """x, z, theta and time as the CoM first falls through `height`; NaN if it does not."""
    x, z, theta = free.poses
    below = np.flatnonzero((z[:-1] >= height) & (z[1:] < height))
    if not below.size:
        return (math.nan, math.nan, math.nan), math.nan
    i = below[0]
    share = (z[i] - height) / (z[i] - z[i + 1])
    columns = np.column_stack([x, theta, free.times])
    at, angle, instant = columns[i] + share * (columns[i + 1] - columns[i])
    return (float(at), height, float(angle)), float(instant)


@own_style()
def _draw(replay: Replay, path: Path) -> None:
    """The path of CoM and bar from the opening to the end, at true scale, and where models land."""
    scene, throw = replay.throw.scene, replay.throw
    title = f"{scene.name}: thrown in MuJoCo"
    if replay.rest is not None:
        title += f", ends {'in' if replay.rest.inside else 'outside'} the cup\n{replay.assumed}"
    figure = new_figure(8, 6.4, title)
    axes = figure.subplots()
    bar = scene.object
    if scene.cup is not None:
        draw_cup(axes, scene.cup)
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
    save(figure, path)


def _landing_throw(plan: Plan | Throw | str | Path) -> Throw:
    """The throw of a plan; InputError without one that lands."""
    throw = throw_of(plan)
    if not throw.lands:
        raise InputError("the throw never falls to the target's height")
    return throw


def throw_to_rest(plan: Plan | Throw | str | Path) -> tuple[SpaceThrow, str]:
    """A throw over time until it rests in its cup, and the reason if it stops at the target.

    InputError without a throw that lands.
    """
    throw = _landing_throw(plan)
    scene, rest, why = throw.scene, throw.scene.rest, ""
    if rest is None and scene.cup is not None:
        rest = Rest(in_="cup")
    if rest is not None and not throw.target.speed:
        try:
            load_mujoco("view")
        except InputError as error:
            rest, why = None, str(error)
    return space_throw(dataclasses.replace(throw, scene=scene.changed(rest=rest))), why


def view(
    plan: Plan | Throw | str | Path,
    port: int = 8080,
    hold: float | None = None,
    browser: bool = True,
) -> None:
    """Show a throw in 3-D on a page of this machine; needs the extra `view`.

    plan: a plan, a throw, or the path of a plan.json or of its folder. A bar that lands
    in a cup falls on into it with the extra `mujoco`. Serves for `hold` seconds, or until
    interrupted (Ctrl-C, a notebook's stop). InputError without a throw that lands, and for a port
    that is not available.
    """
    port = checked("port", port, int, {"least": 1, "most": 65535})
    hold = checked("hold", hold, float | None, {"above": 0})
    space, _ = throw_to_rest(plan)
    with contextlib.suppress(KeyboardInterrupt), serving(space, port) as (page, panel):
        print(page)
        if browser:
            open_browser(page)
        run_panel(panel, hold)
