"""Throws to look at in 3-D: what lands in a cup goes on into it, as MuJoCo has it."""

from __future__ import annotations

import contextlib
from pathlib import Path

from ...problems import InputError, checked
from ..check import Throw
from ..result import Plan, throw_of
from ..show import SpaceThrow, open_browser, run_panel, serving, space_throw
from .mujoco_replay import replay


def seen_throw(plan: Plan | Throw | str | Path) -> tuple[SpaceThrow, str]:
    """A throw over time until it rests in its cup, and why it stops at the target if it does.

    InputError for what holds no throw that lands.
    """
    throw = throw_of(plan)
    if not throw.lands:
        place = f"{plan}: thrown again, it" if isinstance(plan, str | Path) else "view: the throw"
        raise InputError(f"{place} does not land")
    if throw.scene.cup is None or throw.target.speed:
        return space_throw(throw), ""
    try:
        found = replay(throw)
    except InputError as error:
        return space_throw(throw), str(error)
    return space_throw(throw, (found.times, found.com)), ""


def view(
    plan: Plan | Throw | str | Path,
    port: int = 8080,
    hold: float | None = None,
    browser: bool = True,
) -> None:
    """Show a throw in 3-D on a page of this machine; needs the extra `view`.

    plan: a plan, a throw, or the path of a plan.json or of its folder. What lands in a cup goes on
    into it where the extra `mujoco` is there. Serves for `hold` seconds, or until it is interrupted
    (Ctrl-C, a notebook's stop). InputError for what holds no throw that lands, and for a port that
    cannot be had.
    """
    port = checked("port", port, int, {"least": 1, "most": 65535})
    hold = checked("hold", hold, float | None, {"above": 0})
    space, _ = seen_throw(plan)
    with contextlib.suppress(KeyboardInterrupt), serving(space, port) as (page, panel):
        print(page)
        if browser:
            open_browser(page)
        run_panel(panel, hold)
