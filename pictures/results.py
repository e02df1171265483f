"""What is drawn of each result: one figure by `draw`, all its pictures as files by `save`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ..planner import (
    NEAREST,
    Plan,
    ReachMap,
    Sendable,
    SentMotion,
    Sweep,
    Throw,
    is_cycle,
    load_curve,
    sent_motion,
    throw_of,
)
from ..problems import InputError, checked, filling
from .cycle_picture import draw_cycle
from .map_picture import draw_map
from .style import save_figure
from .sweep_pictures import draw_delay, draw_landings, draw_tornado
from .throw_picture import draw_throw, draw_throw_moving

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Pictures of one kind of result, which take the place of those of an earlier one.
FILES = (
    ("throw.png", "throw.gif"),
    ("landings.png", "delay.png", "tornado.png"),
    ("map.png",),
    ("cycle.png",),
)
#: What has a picture: results, motions, and the files of plans and cycles.
Drawable = Plan | Throw | Sweep | ReachMap | SentMotion | Sendable | str | Path


def draw(result: Drawable, file: str | Path | None = None) -> Figure:
    """A result as one Matplotlib figure, also written to `file` (.png) if given.

    result: a plan, a throw, a sweep (its landings), a reach map, a cycle, or the path of a
    plan.json, a cycle.json or of their folder. InputError for a plan or cycle without a throw, and
    for a file that cannot be written.
    """
    file = checked("file", file, str | Path | None, {})
    if file is not None and Path(file).suffix != ".png":
        raise InputError(f"file = {str(file)!r}: must be a .png file")
    figure = next(iter(_figures(result).values()))()
    if file is not None:
        try:
            save_figure(figure, Path(file))
        except OSError as error:
            raise InputError(f"{file}: {error.strerror or error}") from None
    return figure


def save(result: Drawable, folder: str | Path) -> None:
    """Write all pictures of a result into a folder, which is made if it is not there.

    Save the data first: `save` of a plan, sweep, map or cycle deletes pictures of an earlier one.
    A plan has throw.png and throw.gif, of the nearest throw in the folder `nearest` where none to
    the target was found; a sweep landings.png, delay.png and, of several parameters, tornado.png; a
    map map.png; a cycle cycle.png. InputError for what `draw` refuses, and, with the folder left as
    it was, if they cannot be written.
    """
    folder = Path(checked("folder", folder, str | Path, {}))
    if isinstance(result, Plan) and not result.solved and result.nearest is not None:
        return save(result.nearest, folder / NEAREST)
    figures, films = _figures(result), _films(result)
    names = next((names for names in FILES if {*figures, *films} <= {*names}), ())
    with filling(folder, names) as scratch:
        for name, figure in figures.items():
            save_figure(figure(), scratch / name)
        for name, film in films.items():
            film(scratch / name)


def _figures(result: Drawable) -> Mapping[str, Callable[[], Figure]]:
    """The figures of a result by the names of their files, the main one first."""
    if isinstance(result, Sweep):
        more = (
            {"tornado.png": lambda: draw_tornado(result)} if len(result.sampler.names) > 1 else {}
        )
        return {
            "landings.png": lambda: draw_landings(result),
            "delay.png": lambda: draw_delay(result),
            **more,
        }
    if isinstance(result, ReachMap):
        if not result.found:
            raise InputError(result.message)
        return {"map.png": lambda: draw_map(result)}
    if (motion := _cycle_of(result)) is not None:
        return {"cycle.png": lambda: draw_cycle(motion)}
    throw, short_of, load = _throw_of(result), None, None
    if isinstance(result, Plan):
        short_of, load = result.short_of, load_curve(throw) if result.robust else None
    return {"throw.png": lambda: draw_throw(throw, load, short_of)}


def _films(result: Drawable) -> Mapping[str, Callable[[Path], None]]:
    """The films of a result by the names of their files."""
    if isinstance(result, Sweep | ReachMap) or _cycle_of(result) is not None:
        return {}
    throw = _throw_of(result)
    return {"throw.gif": lambda path: draw_throw_moving(throw, path)}


def _throw_of(result: Drawable) -> Throw:
    """The throw of a result that has one; InputError for others."""
    if isinstance(result, Plan | Throw | str | Path):
        return throw_of(result)
    if isinstance(result, SentMotion) or hasattr(result, "sent_motion"):
        return sent_motion(result).throw
    allowed = "a plan, a throw, a sweep, a reach map, a cycle, a sent motion or the path of a file"
    raise InputError(f"result = {str(result)[:60]!r}: must be {allowed}")


def _cycle_of(result: Drawable) -> SentMotion | None:
    """The motion of a cycle; None for other results."""
    if isinstance(result, Plan | Throw | Sweep | ReachMap):
        return None
    if isinstance(result, str | Path) and not is_cycle(result):
        return None
    if not isinstance(result, SentMotion | str | Path) and not hasattr(result, "sent_motion"):
        return None
    motion = sent_motion(result)
    return motion if motion.picks else None
