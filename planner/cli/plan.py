"""`throwplan plan`: one throw, checked."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

from ...problems import ROBUST_METHODS, load_scene
from .command import DONE, NO_THROW, add_out, add_scene, add_target, command, say, target_of, whole


def add_plan(commands: Any) -> None:
    """Adds `throwplan plan`."""
    example = "throwplan plan cup --target 0.92 0.22 -90 --out out/cup"
    parser = command(commands, "plan", _plan, "plan a throw and check it", example)
    add_scene(parser)
    add_target(parser)
    parser.add_argument(
        "--turns",
        choices=("exact", "any"),
        default="exact",
        help="whether full turns of the object count (default: exact)",
    )
    parser.add_argument(
        "--solver",
        choices=("auto", "fatrop", "ipopt"),
        default="auto",
        help="auto: FATROP, with IPOPT as fallback (default)",
    )
    parser.add_argument(
        "--robust",
        choices=ROBUST_METHODS,
        help="bear the scene's [uncertainty] (an opening 10 ms early or late without one)",
    )
    parser.add_argument(
        "--alternatives",
        metavar="N",
        default="0",
        help="list up to N more throws that differ from the plan's",
    )
    add_out(parser, "plan.json, motion.csv, throw.png and throw.gif")


def _plan(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    target = target_of(scene, options.target, options.azimuth)
    from ..plan import MOST_ALTERNATIVES, Planner

    alternatives = whole("--alternatives", options.alternatives, 0, MOST_ALTERNATIVES)
    say(options, f"{scene.name}: building the problem")
    planner = Planner(scene)
    planner.check(target)
    if options.out is not None:
        from ...problems import prepare_folder

        prepare_folder(Path(options.out))
    say(options, f"{scene.name}: planning")
    plan = planner.plan(
        target,
        solver=options.solver,
        turns=options.turns,
        robust=options.robust,
        alternatives=alternatives,
    )
    if options.out is not None:
        say(options, f"{scene.name}: writing {options.out}")
        plan.save(options.out)
    if options.json:
        print(plan.json())
    else:
        gripper, workspace = scene.gripper, scene.workspace
        _print_plan(plan.to_dict(), None if workspace is None else workspace.floor, options.out)
        if gripper.raw:
            grip = gripper.profile()
            lasts = f"dwell {1e3 * grip.dwell:.1f} ms, opening {1e3 * grip.opening:.1f} ms"
            print(f"  grip from the recording: full {grip.full:.4g} N, {lasts}")
        if plan.solved and len(plan.alternatives) < alternatives:
            print(f"  no more of {alternatives} alternatives: other starts lead to the same throws")
    if plan.solved:
        return DONE
    print(f"throwplan: {plan.message}", file=sys.stderr)
    return NO_THROW


def _print_plan(result: dict[str, Any], floor: float | None, out: str | None) -> None:
    """A plan in a few lines; floor [m] of the workspace."""
    said = f", {result['message']}" if result["status"] == "solved" else ""
    print(f"{result['scene']}: {result['status']}{said}")
    print(f"  {_target_words(result['target'])}")
    for name, error in result["error"].items():
        if error is not None and error["position"] is not None:
            position, angle = 1e3 * error["position"], math.degrees(error["angle"])
            print(f"  {name:14} error {position:8.3f} mm {angle:8.3f} deg")
    surface, target = result["landing"]["limit_surface"], result["target"]
    if surface is not None and surface["x"] is not None:
        reach = math.hypot(surface["x"], surface.get("y", 0.0))
        position = 1e3 * abs(reach - math.hypot(target["x"], target["y"]))
        free = target["theta"] is None
        angle = 0.0 if free else math.degrees(abs(surface["theta"] - target["theta"]))
        print(f"  {'limit surface':14} error {position:8.3f} mm {angle:8.3f} deg (for comparison)")
    if floor is not None and target["z"] < floor:
        print(
            f"  note: the target is below the floor of [workspace], z {floor:g} m, which only arm,"
        )
        print("        hand and held bar keep; the bar may touch it before")
    release, solver, times = result["release"], result["solver"], result["time"]
    if release["opening_time"] is not None:
        moments = ", ".join(
            f"{name.removesuffix('_time')} {1e3 * value:.0f} ms"
            for name, value in release.items()
            if value is not None
        )
        print(f"  {moments}")
    print(
        f"  {solver['name']}, {solver['iterations']} iterations in {solver['attempts']} solves, "
        f"{result['nlp']['variables']} variables, {result['nlp']['constraints']} constraints, "
        f"{times['total']:.2f} s"
    )
    if "robust" in result:
        robust = result["robust"]
        print(
            f"  robust by {robust['method']}: while they may open, the pads transmit at most "
            f"{100 * robust['peak_load']:.1f} % of the grip's friction limit"
        )
    for number, other in enumerate(result.get("alternatives", ()), start=1):
        moments = other["release"]
        flight = moments["landing_time"] - moments["detach_time"]
        print(
            f"  alternative {number}: effort {other['effort']:.2f}, opening at "
            f"{1e3 * moments['opening_time']:.0f} ms, flight {1e3 * flight:.0f} ms"
        )
    if out is not None:
        print(f"  written to {out}")


def _target_words(target: dict[str, Any]) -> str:
    """What was aimed at."""
    theta = "free" if target["theta"] is None else f"{math.degrees(target['theta']):.1f} deg"
    aside = f", y {target['y']:.3f} m" if target["y"] else ""
    return f"target x {target['x']:.3f} m{aside}, z {target['z']:.3f} m, theta {theta}"
