"""Throws in 3-D; a bar that lands in a cup falls on into it by MuJoCo."""

from __future__ import annotations

import contextlib
from pathlib import Path

from ...problems import InputError, checked
from ..result import Plan, throw_of
from ..show import SpaceThrow, open_browser, run_panel, serving, space_throw
from ..throw import Throw
from .mujoco_replay import replay


def throw_to_rest(plan: Plan | Throw | str | Path) -> tuple[SpaceThrow, str]:
    """A throw over time until it rests in its cup, and the reason if it stops at the target.

    InputError without a throw that lands.
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
