"""`throwplan replay`: a plan thrown in MuJoCo."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .command import DONE, add_out, command, number, say

if TYPE_CHECKING:
    from ..robot import Replay, Rest

NAMES = {"target": "target", "sp": "sliding pivot", "limit_surface": "limit surface"}


def add_replay(commands: Any) -> None:
    """Adds `throwplan replay`."""
    example = "throwplan replay out/cup/plan.json"
    parser = command(commands, "replay", _replay, "throw a plan's release in MuJoCo", example)
    parser.add_argument("plan", metavar="PLAN", help="a plan.json, or the folder it is in")
    words = "share of its speed with which the bar leaves what it hits, 0 to 0.99 (default: 0.1)"
    parser.add_argument("--restitution", metavar="E", default="0.1", help=words)
    add_out(parser, "replay.json, replay.csv and replay.png")


def _replay(options: argparse.Namespace) -> int:
    from ..result import read_plan
    from ..robot import load_mujoco, replay

    load_mujoco()
    restitution = number("--restitution", options.restitution)
    if options.out is not None:
        from ...problems import prepare_folder

        prepare_folder(Path(options.out))
    throw = read_plan(options.plan)
    say(options, f"{throw.scene.name}: throwing in MuJoCo")
    result = replay(throw, restitution=restitution)
    if options.out is not None:
        say(options, f"{throw.scene.name}: writing {options.out}")
        result.save(options.out)
    if options.json:
        print(json.dumps(result.to_dict(), indent=2, allow_nan=False))
        return DONE
    for line in text(result):
        print(line)
    if options.out is not None:
        print(f"  written to {options.out}")
    return DONE


def text(result: Replay) -> list[str]:
    """What the command prints."""
    throw = result.throw
    lines = [f"{throw.scene.name}: {_landing(result)}"]
    if math.isfinite(result.landing[0]):
        lines.append(f"  {'MuJoCo less':15}{'dx':>13}{'dtheta':>13}")
        for key, words in NAMES.items():
            dx, dtheta = result.off(key)
            angle = "open" if math.isnan(dtheta) else f"{math.degrees(dtheta):+.3f} deg"
            lines.append(f"  {words:15}{1e3 * dx:+10.3f} mm{angle:>13}")
    met = [name for name in result.touched if name in {"hand", "base column"}]
    if met:
        lines.append(f"  on its way the bar hits: {', '.join(met)}")
    if result.rest is not None:
        lines += [f"  {words}" for words in _ending(result.rest)]
        lines.append(f"  assumed: {result.assumed}")
    lines.append(f"  {result.simulated:.2f} s simulated in {result.run:.1f} s")
    return lines


def _landing(result: Replay) -> str:
    """Where MuJoCo lands it, against the tolerance."""
    if not math.isfinite(result.landing[0]):
        return "in MuJoCo it never comes down through the target's height"
    dx, dtheta = result.off("target")
    tolerance = result.throw.scene.tolerance
    near = abs(dx) <= tolerance.position
    off = f"{1e3 * abs(dx):.3f} mm"
    if not math.isnan(dtheta):
        near = near and abs(dtheta) <= tolerance.angle
        off += f" and {math.degrees(abs(dtheta)):.3f} deg"
    where = "inside" if near else "OUTSIDE"
    return f"in MuJoCo it lands {off} from the target, {where} the tolerance"


def _ending(rest: Rest) -> list[str]:
    """How it ended, in words."""
    x, _, z, theta = rest.pose
    where = f"x {x:.3f} m, z {z:.3f} m, theta {math.degrees(theta):.1f} deg"
    if rest.inside:
        state = "comes to rest" if rest.at_rest else "still rocks, 4 s after landing,"
        ending = f"{state} in the cup: {where}"
    elif rest.at_rest:
        ending = f"does NOT end in the cup: it rests at {where}"
    else:
        ending = f"does NOT end in the cup: 4 s after landing it moves at {where}"
    if not (rest.entered or rest.touched_rim):
        return [ending, "does not go in at all"]
    touch = "touches the cup's wall or rim" if rest.touched_rim else "clears wall and rim"
    return [ending, f"{touch} on the way in"]
