"""From one sampled release to a checked throw: what the check finds missing is asked for anew."""

from __future__ import annotations

from dataclasses import replace

from ...problems import Pose
from ..ocp import HEAVY
from .alternatives import Found
from .correction import Search, attempt
from .guess import guess_from
from .refit import again
from .releases import Releases
from .workbench import Workbench

#: NLPs tried from one release, each asked what the check has seen to be missing.
TRIES = 4


def from_release(
    bench: Workbench,
    name: str,
    index: int,
    goal: Pose,
    releases: Releases,
    search: Search,
    light: bool,
) -> Found | None:
    """The throw that release `index` leads to with solver `name`; None if it leads to none.

    light: without heavy guards. A release that led nowhere is not tried again with the same
    guards and room.
    """
    flight = releases.flight_time(index, goal.z, bench.scene.gravity)
    state = releases.q[index].tobytes(), releases.detach[index].tobytes()
    held, sampled, tried = search.room.held, True, []
    for _ in range(TRIES):
        nlp, asked = bench.nlp(goal, search), search.asked
        if sampled:
            this = name, state, goal, asked
            if this in search.tried:
                break
            tried.append(this)
        with search.clock("guess"):
            guess = (
                guess_from(nlp, search.scene, bench.mover, releases, index, flight)
                if sampled
                else again(nlp, search)
            )
        problem = bench.problem(goal, name, search)
        thrown = attempt(problem, bench.mover, goal, guess, search)
        if thrown is not None:
            return Found(goal, thrown, problem.solver.name)
        if search.broken is None or search.asked == asked or search.late:
            break
        if light and search.guards & HEAVY:
            search.guards, search.room = asked
            tried.clear()
            break
        # A sampled release that clears column and hand leads there sooner than a throw that
        # does not; for all else the throw is nearer.
        sampled = sampled and search.guards == {"flight"} and bool(releases.clear[index])
    search.tried.update(tried)
    if "carry" not in search.guards:
        # Where one throw's corners needed room another's may not.
        search.room = replace(search.room, held=held)
    return None
