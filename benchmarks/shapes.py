"""Section `shapes`: Figs. 8 and 9 of Liu and Billard by time stepping: the landings change.

The rotated ellipsoid and the quartic are those fitted to the pushes on the whole face (section
`pushes`), with their sizes taken out: their mean limit of force and their torsion arm are those of
the plain ellipsoid, so that only the shape differs. How the slider's axes lie to a hand's is
arbitrary.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from throwplan import Planner, load_scene, simulate
from throwplan.models import Array, SurfaceShape
from throwplan.models.release import STEPPED_SURFACE, Release
from throwplan.planner.result import sent_throw
from throwplan.planner.show import BLUE, GREEN, GREY, RED, Row, Table

from .page import Effort, Picture, ReportSection, panels
from .pushes import Log, fitted_arm, fitted_quartic, read_logs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Keys of [contact] by the shapes' names in the table, and colours.
PLAIN = "plain ellipsoid"
COLOURS = {PLAIN: GREY, "rotated ellipsoid": BLUE, "convex quartic": RED, "two points": GREEN}
#: Scenes whose plans, made with the plain ellipsoid, are thrown by each shape.
SCENES = ("pose", "near-cup", "flip")
Keys = dict[str, str | tuple[float, ...]]


def make(effort: Effort) -> ReportSection:
    """The drop and built-in throws by each shape."""
    shapes, rows = _shapes(), {name: Row({"shape": name}) for name in COLOURS}
    scenes = SCENES[: effort.of(1, len(SCENES))]
    step, drop = effort.counter(len(scenes) + 1), load_scene("drop")
    runs = dict[str, Release]()
    for name, keys in shapes.items():
        scene = drop.replace(contact=drop.contact.changed(**keys))
        release = simulate(scene, STEPPED_SURFACE)[STEPPED_SURFACE].release
        runs[name] = release
        rows[name] |= {"drop: v_z [m/s]": float(release.end[4]), "ω [rad/s]": float(release.end[5])}
    step()
    for title in scenes:
        throw = sent_throw(Planner(title).plan())
        for name, keys in shapes.items():
            contact = throw.scene.contact.changed(**keys)
            shaped = throw.in_scene(throw.scene.changed(contact=contact)).limit_surface
            dx = shaped.landing.x - throw.limit_surface.landing.x
            turn = math.degrees(shaped.landing.theta - throw.limit_surface.landing.theta)
            rows[name] |= {f"{title}: Δx [mm]": 1e3 * dx, f"{title}: Δθ [°]": turn}
        step()
    words = (
        "The same motion thrown by other shapes of the limit surface, by time stepping: none "
        "oscillates in the drop (the paper's Fig. 8, by explicit steps, does); of the two points "
        "of its Fig. 9 the one before slides first. Δ: against the plain ellipsoid. Ellipsoid and "
        "quartic are fitted to real pushes, their sizes taken out."
    )
    table = Table("shapes", "Shapes of the limit surface", list(rows.values()), short=True)
    picture = Picture("shapes", "Surfaces, and the drop by them", _draw(shapes, runs))
    return ReportSection("shapes", "Shapes of the limit surface", [words], [table], [picture])


def _shapes() -> dict[str, Keys]:
    """[contact] keys of each shape."""
    logs = [log for log in read_logs() if log.support == "patch"]
    both = Log(
        "both",
        "patch",
        np.vstack([log.wrench / np.linalg.norm(log.wrench, axis=1).mean() for log in logs]),
        np.vstack([log.twist for log in logs]),
        logs[0].points,
    )
    arm = fitted_arm(both)
    unit = np.array([1.0, 1.0, arm])
    scaled = Log("both", "patch", both.wrench / unit, both.twist * unit, both.points)
    keys: list[Keys] = [{}]
    keys += [_sized(fitted_quartic(scaled, squares)) for squares in (1, 3)]
    return dict(zip(COLOURS, [*keys, {"shape": "two-points"}], strict=True))


def _sized(shape: SurfaceShape) -> Keys:
    """A quartic whose mean gauge of forces is 1."""
    turn = np.linspace(0.0, 2 * np.pi, 361)[:-1]
    mean = float(np.mean(shape.gauge([np.cos(turn), np.sin(turn), 0.0 * turn])))
    return {"shape": "quartic", "coefficients": tuple(c / mean**4 for c in shape.quartic)}


def _draw(shapes: dict[str, Keys], runs: dict[str, Release]) -> Figure:
    figure, ((section, turning), (falling, points)) = panels(8.2, 6.4, 2, 2)
    turn = np.linspace(0.0, 2 * np.pi, 361)
    for name, keys in shapes.items():
        contact = load_scene("drop").contact.changed(**keys).contact
        w = [0.0 * turn, np.cos(turn), np.sin(turn)]
        size: Array = np.ones(361) if contact.shape is None else contact.shape.gauge(w)
        section.plot(w[1] / size, w[2] / size, color=COLOURS[name], label=name)
        release = runs[name]
        ms = 1e3 * release.times
        turning.plot(ms, release.com_twist[2], color=COLOURS[name])
        falling.plot(ms, release.com_twist[1], color=COLOURS[name])
    release, arm = runs["two points"], load_scene("drop").patch.torsion_arm
    assert release.wrench is not None
    _, f_z, torque = release.wrench
    for side, style in ((-1, "--"), (1, "-")):
        label = "point behind" if side < 0 else "point before"
        force = (f_z + side * torque / arm) / 2
        points.plot(1e3 * release.times, force, style, color=GREEN, label=label)
    section.set(xlabel="force across / limit", ylabel="torque / limit", aspect="equal")
    turning.set(xlabel="time [ms]", ylabel="ω [rad/s]", xlim=(20, 50))
    falling.set(xlabel="time [ms]", ylabel="v_z [m/s]", xlim=(20, 50))
    points.set(xlabel="time [ms]", ylabel="vertical friction [N]", xlim=(0, 50))
    section.legend(fontsize=8)
    points.legend(fontsize=8)
    return figure
