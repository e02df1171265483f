"""Drawings around a throw on the page: the reach, and landings under opening delays."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ...models import Array
from ...problems import Distribution, Pose, Scene, Uncertainty
from ..reach import ReachMap
from ..result import Plan
from ..show import BLUE, GREEN, ORANGE, RED, rgb
from ..sweep import Sweep, sweep
from ..verdict import Code


def delay_of(scene: Scene) -> float:
    """Half the width [s] of a uniform delay with the deviation of the scene's; 10 ms without."""
    spread = None if scene.uncertainty is None else scene.uncertainty.delay
    return 0.010 if spread is None else math.sqrt(3.0) * spread.deviation


def with_delay(scene: Scene, half: float) -> Scene:
    """The scene with openings up to `half` [s] early or late."""
    delay = Distribution(uniform=half, mean=scene.mean_delay)
    old = scene.uncertainty
    uncertain = dataclasses.replace(old, delay=delay) if old else Uncertainty(delay=delay)
    return scene.replace(uncertainty=uncertain)


def sweep_delays(plan: Plan, half: float) -> Sweep:
    """200 throws of the plan with openings up to `half` [s] early or late."""
    return sweep(dataclasses.replace(plan, scene=with_delay(plan.scene, half)), 200)


def draw_cloud(space: Any, swept: Sweep) -> Any:
    """The bar's axis at each landing, green where the throw succeeds; returns the node."""
    bar, plane = swept.plan.scene.object, swept.plan.goal.plane
    x, theta, time = swept.landings.pose.T
    ends = np.array([-bar.com, bar.length - bar.com])[:, None]
    z = swept.plan.goal.z + ends * np.sin(theta)
    axes = plane.points(x + ends * np.cos(theta), z).transpose(1, 0, 2)
    colours = np.where(swept.success[:, None], rgb(GREEN), rgb(RED)).astype(np.uint8)
    landed = np.isfinite(time)
    colours = np.repeat(colours[:, None], 2, axis=1)
    return space.add_line_segments("/cloud", axes[landed], colours[landed], thickness=0.003)


def cloud_words(swept: Sweep, half: float) -> str:
    """The result of the sweep as text."""
    x = swept.landings.pose[:, 0]
    x = x[np.isfinite(x)]
    good = f"{int(swept.success.sum())} of {swept.samples} throws succeed"
    failed = {code: int(flags.sum()) for code, flags in swept.landings.broken.items()}
    if swept.plan.scene.cup is not None:
        failed.pop(Code.LANDING, None)
    worst = max(failed, key=failed.__getitem__, default=None)
    if worst is not None and failed[worst]:
        good += f" ({failed[worst]} {worst.fate})"
    also = [name.replace("_", " ") for name in swept.sampler.names if name != "delay"]
    varied = f", with {', '.join(also)} as uncertain as [uncertainty] says" if also else ""
    spread = f"; spread {1e3 * float(np.ptp(x)):.0f} mm" if x.size else ""
    if swept.rests is not None:
        varied += f"; {swept.rests.words}"
    return f"{good}, opened up to ±{1e3 * half:g} ms off{varied}{spread}"


def bands(reach: ReachMap, theta: float | None, farthest: float | None) -> Array:
    """Bands (N, 3) of landings at an angle: from x, to x [m], and the largest margin.

    farthest [m]: the edge of the reach, which few sampled throws approach; None if unknown.
    """
    if not reach.reachable:
        return np.zeros((0, 3))
    column = reach.bin_of(float(reach.x_edges[0]), theta)
    rows = np.column_stack([reach.x_edges[:-1], reach.x_edges[1:], reach.margin])
    rows = rows[:, [0, 1, 2 + column[1]]] if column else rows[:0]
    rows = rows[np.isfinite(rows[:, 2])]
    if farthest is None or not rows.size or farthest <= rows[-1, 1]:
        return np.asarray(rows)
    return np.vstack([rows, [rows[-1, 1], farthest, 0.0]])


def draw_reach(space: Any, rows: Array, scene: Scene, target: Pose, floor: float) -> Any:
    """Draw the bands on the floor, orange for no margin to blue from 0.4; returns the node.

    Rings about the base of an arm, 50 degrees to both sides of the target; else strips along x.
    """
    from trimesh.creation import revolve

    sector = math.radians(50.0)
    half = (target.plane.azimuth - sector) / 2 if scene.arm else 0.0
    turn = math.cos(half), 0.0, 0.0, math.sin(half)
    frame = space.add_frame("/reach", show_axes=False, wxyz=turn)
    lift_reach(frame, floor)
    for i, (low, high, margin) in enumerate(rows):
        share = min(max(margin, 0.0) / 0.4, 1.0)
        colour = (1 - share) * np.array(rgb(ORANGE)) + share * np.array(rgb(BLUE))
        look: dict[str, Any] = {"color": tuple(colour.astype(int)), "opacity": 0.35}
        look |= {"cast_shadow": False, "receive_shadow": False}
        name = f"/reach/{i}"
        if scene.arm is None:
            at = ((low + high) / 2, 0.0, 0.0)
            space.add_box(name, dimensions=(high - low, 0.2, 0.001), position=at, **look)
        elif low >= 0.0:
            ends = np.hypot([low, high], target.lateral)
            mesh = revolve(np.column_stack([ends, [0.0, 0.0]]), 2 * sector, sections=40)
            space.add_mesh_simple(name, mesh.vertices, mesh.faces, side="double", **look)
    return frame


def reach_legend() -> str:
    """What the bands' colours mean, as HTML."""
    square = '<span style="color:{}">&#9632;</span>'
    words = f"{square.format(ORANGE)} at a limit to {square.format(BLUE)} with room to spare"
    text = f"floor: where throws land at the target's height and angle, {words}"
    return f'<div style="padding:0 1em 0.5em;font-size:0.875em;line-height:1.6">{text}</div>'


def lift_reach(node: Any, floor: float) -> None:
    """Moves the bands to just above the floor [m]."""
    node.position = (0.0, 0.0, floor + 0.002)
