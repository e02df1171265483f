"""A motion over time until its objects lie, and its page in the browser."""

from __future__ import annotations

import contextlib
import dataclasses

import numpy as np

from ...planner import TICK, Source, Throw, load_mujoco, sent_motion
from ...problems import InputError, Rest, checked
from .motion import SpaceMotion, SpaceThrow, space_throw
from .server import open_browser, run_panel, serving


def motion_to_rest(plan: Source) -> tuple[SpaceMotion, str]:
    """A motion over time until its last object lies, in its cup or bin if it has one, and the
    reason if objects stop at their targets.

    InputError for what has no motion, and for a throw that does not land.
    """
    motion = sent_motion(plan)
    throws, reasons = zip(*(_throw_to_rest(one.throw) for one in motion.carries), strict=True)
    begins = tuple(one.begin for one in motion.carries)
    ends = (begin + throw.line.times[-1] for begin, throw in zip(begins, throws, strict=True))
    last = max(ends) if not motion.picks else max(motion.duration, *ends)
    times = np.arange(0.0, last + TICK / 2, TICK)
    names, held = zip(*((one.pick, TICK * one.held) for one in motion.carries), strict=True)
    parts = names, throws, begins, held, times
    return SpaceMotion(motion.name, *parts, *motion.poses_at(times)), next(
        filter(None, reasons), ""
    )


def _throw_to_rest(throw: Throw) -> tuple[SpaceThrow, str]:
    """A throw over time until it rests in its cup or bin, and the reason if it stops before."""
    if not throw.lands:
        raise InputError("the throw never falls to the target's height")
    scene, rest, why = throw.scene, throw.scene.rest, ""
    if rest is None and scene.opening is not None:
        rest = Rest(in_=scene.opening.KIND)
    if rest is not None and not throw.target.speed:
        try:
            load_mujoco("view")
        except InputError as error:
            rest, why = None, str(error)
    return space_throw(dataclasses.replace(throw, scene=scene.changed(rest=rest))), why


def view(plan: Source, port: int = 8080, hold: float | None = None, browser: bool = True) -> None:
    """Show a motion in 3-D on a page of this machine; needs the extra `view`.

    plan: a plan, a throw, a cycle, a sent motion, or the path of their file or of its folder. An
    object that lands in a cup or bin falls on into it with the extra `mujoco`. Serves for `hold`
    seconds, or until interrupted (Ctrl-C, a notebook's stop). InputError without a throw that
    lands, and for a port that is not available.
    """
    port = checked("port", port, int, {"least": 1, "most": 65535})
    hold = checked("hold", hold, float | None, {"above": 0})
    space, _ = motion_to_rest(plan)
    with contextlib.suppress(KeyboardInterrupt), serving(space, port) as (page, panel):
        print(page)
        if browser:
            open_browser(page)
        run_panel(panel, hold)
