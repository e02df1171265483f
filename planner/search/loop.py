"""The search for throws: the next try, what comes of it, and so on until there are enough."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ...interrupts import interrupts_deferred
from .approach import approach_goal
from .attempt import Attempt, attempts
from .history import Approach, Entry, History, Lead, Move, Solve, Try
from .lead import led
from .search import Search
from .strategies import Strategy


def find_throws(search: Search, strategies: Sequence[Strategy], history: History) -> History:
    """The history and further tries, until there are enough.

    Ends before that where no strategy has a next try, or time is over.
    """
    task = search.task
    while not search.is_complete(history) and not task.clock.late:
        with interrupts_deferred():
            tries = (strategy(search, history) for strategy in strategies)
            step = next((step for step in tries if step is not None), None)
            if step is None:
                break
            step = search.limited(step, history)
            history = history.with_entry(Entry(step, tuple(_outcome(search, step))))
    return history


def _outcome(search: Search, step: Try) -> Iterable[Attempt]:
    """Solve or move, send, throw, correct the aim and judge."""
    context, task = search.context, search.task
    match step:
        case Move(near):
            return [context.corrector.attempt(near, task)]
        case Solve(start):
            return attempts(context.problems, start, task)
        case Lead():
            return [led(context.corrector, step, task)]
        case Approach():
            return approach_goal(context.corrector, step, task)
