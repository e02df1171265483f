"""Commands on scenes: `scenes`, `plan`, `simulate`, `map`, `prepare`, `sweep`."""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from pathlib import Path
from typing import Any

from .. import pictures
from .. import sweep as sweep_plan
from ..cycles import jobs_names, jobs_text
from ..interrupts import INTERRUPTED
from ..models import BATCH_MODELS, MODELS
from ..planner import (
    MAP_FILES,
    MOST,
    MOST_ALTERNATIVES,
    MOST_PREPARED,
    PREPARED,
    SWEEP_FILES,
    Plan,
    Planner,
    check_map,
    check_sweep,
    make_manipulator,
    plan_of,
    reach_map,
    simulate,
)
from ..problems import (
    InputError,
    Scene,
    copy_out,
    filling,
    load_scene,
    scene_names,
    scene_text,
    write_json,
)
from ..terminal import (
    DONE,
    Add,
    Progress,
    add_out,
    add_patience,
    add_scene,
    add_target,
    add_workers,
    fail,
    integer,
    notes,
    number,
    prepare_out,
    print_result,
    save_out,
    target_of,
    written,
)
from ..workers import executor_of
from .keys import scene_keys

#: Sampled throws of a drawn scene's reach.
DRAWN = 20_000
ROBUST = (
    "look for throws that succeed more often under the scene's [uncertainty], or an assumed one "
    "(default: if the scene has [robust])"
)


def scenes_arguments(add: Add) -> None:
    """The options of `scenes`."""
    words = "copy the file of a scene, or of jobs, to NAME.toml in this folder"
    add("--write", metavar="NAME", help=words)
    add("--draw", metavar="SCENE", help="draw a scene and what its numbers mean: NAME.png")
    add("--force", action="store_true", help="overwrite an existing file")
    words = "print all keys of scene, arm and gripper files as Markdown"
    add("--keys", action="store_true", help=words)


def scenes(options: argparse.Namespace) -> int:
    """List the built-in scenes, and jobs for `cycle`.

    example: throwplan scenes --write cup
    """
    if options.keys + (options.write is not None) + (options.draw is not None) > 1:
        raise InputError("--write, --draw and --keys: give one of them")
    if options.draw is not None:
        path = _draw(_scene(options.draw), force=options.force)
        print_result(options, {"file": str(path)}, f"wrote {path}")
    elif options.keys:
        text = scene_keys()
        print(json.dumps({"keys": text}) if options.json else text, end="")
    elif options.write is not None:
        path = Path(f"{options.write}.toml")
        names = [*scene_names(), *jobs_names()]
        if options.write not in names:
            hint = InputError.hint(options.write, names)
            raise InputError(f"no scene or jobs '{options.write}'{hint} (see 'throwplan scenes')")
        read = jobs_text if options.write in jobs_names() else scene_text
        copy_out(read(options.write), path, force=options.force)
        print_result(options, {"file": str(path)}, f"wrote {path}")
    else:
        found = {name: load_scene(name).description for name in scene_names()}
        # A job file says in its first line what it is.
        jobs = {name: jobs_text(name).splitlines()[0].lstrip("# ") for name in jobs_names()}
        lines = [f"{name:12} {description}" for name, description in found.items()]
        lines += ["", "jobs, for throwplan cycle:"]
        lines += [f"{name:12} {description}" for name, description in jobs.items()]
        print_result(options, {"scenes": found, "jobs": jobs}, "\n".join(lines))
    return DONE


def _scene(source: str) -> Scene:
    """A scene; InputError that says so where the name is that of jobs."""
    if source in jobs_names():
        raise InputError(f"no scene '{source}': these are jobs, for throwplan cycle")
    return load_scene(source)


def _draw(scene: Scene, *, force: bool) -> Path:
    """Draw a scene as a PNG file in this folder; returns its path."""
    path = Path(Path(f"{scene.name}.png").name)
    if scene.motion is not None:
        raise InputError(f"{scene.place}: --draw: only a scene with [hand] or [robot]")
    if path.exists() and not force:
        raise InputError(f"{path}: exists already, not overwritten; --force does it")
    with Progress(f"{scene.name}: sampling throws"):
        found = reach_map(scene, samples=DRAWN).x
    reach = (float(found.min()), float(found.max())) if found.size else None
    with filling(Path.cwd(), (path.name,), "--draw") as scratch:
        figure = pictures.draw_scene(scene, make_manipulator(scene), reach)
        pictures.save_figure(figure, scratch / path.name)
    return path


def plan_arguments(add: Add) -> None:
    """The options of `plan`."""
    add_scene(add)
    add_target(add)
    words = "exact: THETA_DEG counts full turns; any: it does not (default: exact)"
    add("--turns", choices=("exact", "any"), default="exact", help=words)
    words = "of the nonlinear programs (default: fatrop)"
    add("--solver", choices=("fatrop", "ipopt"), default="fatrop", help=words)
    add("--robust", action="store_true", help=ROBUST)
    words = "also list up to N different throws to the target"
    kind = integer(0, MOST_ALTERNATIVES)
    add("--alternatives", type=kind, metavar="N", default=0, help=words)
    add_patience(add, "30 s, 6 s for a robust plan")
    words = "also print the solver, all margins, notes, and warnings in full"
    add("--verbose", action="store_true", help=words)
    add_out(add, "plan.json, motion.csv, throw.png and throw.gif")


def plan(options: argparse.Namespace) -> int:
    """Plan a throw and check it.

    example: throwplan plan cup --target 0.92 0.22 -90 --out out/cup
    """
    scene = _scene(options.scene)
    target, alternatives = target_of(scene, options), options.alternatives
    with Progress(f"{scene.name}: building the problem"):
        planner = Planner(scene)
        planner.check(target)
    prepare_out(options)
    with Progress(f"{scene.name}: planning"):
        found = planner.plan(
            target,
            solver=options.solver,
            turns=options.turns,
            robust=options.robust,
            alternatives=alternatives,
            patience=options.patience,
        )
    save_out(options, scene.name, found.save, partial(pictures.save, found))
    text = found.summary(options.verbose, options.out)
    if found.solved and len(found.alternatives) < alternatives:
        text += f"\n  found no more of {alternatives} alternatives"
    delay = {} if found.delay is None else {"delay": found.delay.to_dict()}
    print_result(options, found.to_dict() | delay, text)
    if found.solved:
        return DONE
    return fail(found.message if options.json else "no throw found")


def simulate_arguments(add: Add) -> None:
    """The options of `simulate`."""
    add_scene(add)
    names = f"all (default), or one of {', '.join(MODELS)}"
    add("--model", default="all", metavar="NAME", help=names)
    add_out(add, "simulation.json and releases.png")


def simulate_models(options: argparse.Namespace) -> int:
    """Simulate the release of a given hand motion by release models.

    example: throwplan simulate drop --model sp
    """
    scene = _scene(options.scene)
    with Progress(f"{scene.name}: throwing"):
        runs = simulate(scene, options.model)
    models = {name: run.to_dict() for name, run in runs.items()}
    result = {"scene": scene.name, "models": models}
    if options.out is not None:
        names = filling(Path(options.out), ("simulation.json", "releases.png"))
        with Progress(f"{scene.name}: drawing"), names as scratch:
            write_json(scratch / "simulation.json", result)
            pictures.save_figure(pictures.draw_releases(scene, runs), scratch / "releases.png")
    print_result(options, result, _simulation_text(scene.name, models) + notes(scene))
    return DONE


def _simulation_text(name: str, models: dict[str, Any]) -> str:
    """Detach states and events, landings where there is a height, and statuses."""
    keys = ("x", "z", "theta", "vx", "vz", "omega")
    wide = max(10, *(len(model) for model in models))
    heads = "".join(f"{key:>12}" for key in (*keys, "pivot", "slide"))
    lines = [f"{name}: object at detach, SI units", f"  {'model':{wide}}{heads}"]
    for model, found in models.items():
        cells = "".join(_cell(found["detach"][key], 12, 5) for key in keys)
        for moment in (found["events"]["pivot"], found["events"]["slide"]):
            cells += _cell(None if moment is None else 1e3 * moment, 9, 2, " ms")
        lines.append(f"  {model:{wide}}{cells}")
    for model, found in models.items():
        if found["landing"] is not None:
            x, theta = (_cell(found["landing"][key], 10, 4) for key in ("x", "theta"))
            lines.append(f"  {model:{wide}} lands at x{x} m, theta{theta} rad")
    lines += [f"  {model:{wide}} {MODELS[model].summary()}" for model in models]
    for model, found in models.items():
        if found["status"] != "ok":
            lines.append(f"  {model}: not to be trusted: {found['status']}")
    return "\n".join(lines)


def _cell(value: float | None, width: int, digits: int, unit: str = "") -> str:
    """A number for a table, a dash for None."""
    if value is None:
        return f"{'-':>{width + len(unit)}}"
    return f"{value:{width}.{digits}f}{unit}"


def map_arguments(add: Add) -> None:
    """The options of `map`."""
    add_scene(add)
    add("--z", type=number(), metavar="Z", help="height of the landing (default: the target's)")
    words = "sampled states (default: 200000)"
    add("--samples", type=integer(1, MOST), metavar="N", default=200_000, help=words)
    words = "also show the 95 %% pose error of the prepared throws: where to put the target"
    add("--robust", action="store_true", help=words)
    add_out(add, "map.png and map.npz")


def map_landings(options: argparse.Namespace) -> int:
    """Show to which landing poses sampled throws are found.

    example: throwplan map pose --out out/map
    """
    z, samples = options.z, options.samples
    check_map(z, samples, "--")
    scene = _scene(options.scene)
    # Refuse a scene that cannot be planned before making a folder.
    make_manipulator(scene)
    prepare_out(options, MAP_FILES)
    with Progress(scene.name) as progress:
        result = reach_map(scene, z, samples, robust=options.robust, progress=progress)
    if not result.found:
        if options.out is not None and Path(options.out).is_dir():
            with filling(Path(options.out), MAP_FILES):
                pass  # An earlier map goes.
        if options.json:
            print_result(options, result.to_dict(), "")
        return fail(result.message)
    save_out(options, scene.name, result.save, partial(pictures.save, result))
    file = None if options.out is None else Path(options.out) / "map.npz"
    print_result(options, result.to_dict(file), result.summary() + notes(scene) + written(options))
    return DONE


def prepare_arguments(add: Add) -> None:
    """The options of `prepare`."""
    add_scene(add)
    words = f"number of throws; fewer if the reach has no room (default: {PREPARED})"
    kind = integer(1, MOST_PREPARED)
    add("--throws", type=kind, metavar="N", default=PREPARED, help=words)
    add_workers(add, "processes on this machine (default: 2 for 400 throws or more)")


def prepare(options: argparse.Namespace) -> int:
    """Build a library of solved throws, from which plans start.

    example: throwplan prepare pose --throws 5000
    """
    scene = _scene(options.scene)
    name, requested, started = scene.name, options.throws, time.perf_counter()
    planner = Planner(scene)
    library, before = planner.library, planner.prepared
    if library.folder is None:
        raise InputError(
            "prepare: there is no cache folder to keep throws in: THROWPLAN_CACHE must name one"
        )
    try:
        workers, scheduler = options.workers, options.scheduler
        with (
            executor_of(workers if scheduler else None, scheduler) as executor,
            Progress(name) as progress,
        ):
            count = planner.prepare(requested, progress, workers=workers, executor=executor)
    except KeyboardInterrupt:
        kept = f"{planner.prepared:,} throws are kept; run the command again to continue"
        return fail(f"interrupted: {kept}", INTERRUPTED)
    seconds = time.perf_counter() - started
    result = {
        "scene": name,
        "throws": count,
        "added": count - before,
        "edge": len(library.records) - count,
        "bytes": library.records.nbytes,
        "folder": str(library.folder),
        "time": seconds,
    }
    new = f"{count - before:,}" if count > before else "none"
    text = (
        f"{name}: {count:,} solved throws, {new} of them new, {result['edge']:,} places out of "
        f"reach, {library.records.nbytes / 1e6:.1f} MB, in {seconds:.0f} s\n"
        f"  {library.folder}"
    )
    if 0 < count < requested:
        text += (
            f"\n  fewer than the {requested:,} requested: no places are left between them, or no "
            "throw reaches them; a plan starts from the nearest throw"
        )
    if scene.obstacle:
        obstacles = f"{len(scene.obstacle)} obstacle{'s' if len(scene.obstacle) > 1 else ''}"
        text += (
            f"\n  made without the scene's {obstacles}: where a throw meets one, a plan searches "
            "as without a library"
        )
    print_result(options, result, text)
    return DONE if count else fail("no throw found: no solve from the sampled starts succeeded")


def sweep_arguments(add: Add) -> None:
    """The options of `sweep`."""
    add("scene", metavar="SCENE", help="a built-in scene, a TOML file, or the folder of a plan")
    add_target(add)
    add("--robust", action="store_true", help=ROBUST)
    add_patience(add, "30 s, 6 s for a robust plan")
    names = f"release model: {', '.join(BATCH_MODELS)} (default: the scene's [tolerance] model)"
    add("--model", default="", metavar="NAME", help=names)
    add("--samples", type=integer(), metavar="N", default=1000, help="throws (default: 1000)")
    add("--seed", type=integer(), metavar="N", default=0, help="seed of the samples (default: 0)")
    add_workers(add, "processes on this machine (default: 1); they do not change the result")
    add_out(add, "sweep.json, sweep.csv and three pictures")


def _saved_plan(options: argparse.Namespace) -> Plan | None:
    """The plan of a folder or plan.json in place of a scene, without options of planning."""
    path = Path(options.scene)
    if options.scene in scene_names() or not (path.is_dir() or path.name == "plan.json"):
        return None
    for name in ("target", "azimuth", "velocity", "arrival", "robust", "patience"):
        if getattr(options, name) not in (None, False):
            raise InputError(f"--{name}: not with a saved plan, {path}: give its scene instead")
    return plan_of(path)


def sweep(options: argparse.Namespace) -> int:
    """Simulate a plan many times under uncertainty.

    example: throwplan sweep delay --samples 10000 --out out/sweep
    """
    samples, seed = options.samples, options.seed
    saved = _saved_plan(options)
    scene = _scene(options.scene) if saved is None else saved.scene
    model = options.model or scene.deciding_model
    check_sweep(samples, seed, model, "--")
    target = target_of(scene, options) if saved is None else None
    with executor_of(options.workers, options.scheduler) as executor:
        if saved is None:
            with Progress(f"{scene.name}: planning"):
                planner = Planner(scene)
                planner.check(target)
                prepare_out(options, SWEEP_FILES)
                found = planner.plan(target, robust=options.robust, patience=options.patience)
        else:
            prepare_out(options, SWEEP_FILES)
            found = saved
        if not found.solved:
            print_result(options, found.to_dict(), f"{scene.name}: {found.status}")
            return fail(found.message)
        with Progress(scene.name) as progress:
            outcome = sweep_plan(found, samples, seed, model, executor, progress)
    save_out(options, scene.name, outcome.save, partial(pictures.save, outcome))
    result = outcome.to_dict()
    advice = ""
    if found.target.is_fixed and not found.robust and result["success"]["rate"] < 0.9:
        advice = "\n  plan with --robust to raise the success rate"
    print_result(options, result, outcome.summary() + advice + notes(scene) + written(options))
    return DONE


#: The functions of each command.
COMMANDS = {
    "scenes": (scenes_arguments, scenes),
    "plan": (plan_arguments, plan),
    "simulate": (simulate_arguments, simulate_models),
    "map": (map_arguments, map_landings),
    "prepare": (prepare_arguments, prepare),
    "sweep": (sweep_arguments, sweep),
}
