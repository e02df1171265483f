"""What is drawn of each result: one figure by `draw`, all its pictures as files by `save`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
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
    read_motion,
    read_plan,
    sent_motion,
)
from ..problems import InputError, checked, filling
from .cycle_picture import draw_cycle
from .map_picture import draw_map
from .style import save_figure
from .sweep_pictures import draw_delay, draw_landings, draw_tornado
from .throw_picture import draw_throw, draw_throw_moving

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    #: Figures by the names of their files, the main one first; films; and names of further pictures
    #: that an earlier result of the kind may have.
    _Pictures = tuple[
        Mapping[str, Callable[[], Figure]], Mapping[str, Callable[[Path], None]], tuple[str, ...]
    ]

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
    figure = next(iter(_pictures(result)[0].values()))()
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
    figures, films, others = _pictures(result)
    with filling(folder, (*figures, *films, *others)) as scratch:
        for name, figure in figures.items():
            save_figure(figure(), scratch / name)
        for name, film in films.items():
            film(scratch / name)


def _pictures(result: Drawable) -> _Pictures:
    """What is drawn of a result, and how."""
    if isinstance(result, str | Path):
        result = read_motion(result) if is_cycle(result) else read_plan(result)
    if isinstance(result, Sweep):
        figures = {"landings.png": draw_landings, "delay.png": draw_delay}
        several = len(result.sampler.names) > 1
        if several:
            figures["tornado.png"] = draw_tornado
        drawn = {name: partial(figure, result) for name, figure in figures.items()}
        return drawn, {}, () if several else ("tornado.png",)
    if isinstance(result, ReachMap):
        if not result.found:
            raise InputError(result.message)
        return {"map.png": partial(draw_map, result)}, {}, ()
    short_of = load = None
    if isinstance(result, Plan):
        throw, short_of = result.sent_throw(), result.short_of
        load = load_curve(throw) if result.robust else None
    elif isinstance(result, Throw):
        throw = result
    elif isinstance(result, SentMotion) or hasattr(result, "sent_motion"):
        motion = sent_motion(result)
        if motion.picks:
            return {"cycle.png": partial(draw_cycle, motion)}, {}, ()
        throw = motion.throw
    else:
        allowed = (
            "a plan, a throw, a sweep, a reach map, a cycle, a sent motion, the path of a file"
        )
        raise InputError(f"result = {str(result)[:60]!r}: must be {allowed}")
    return (
        {"throw.png": partial(draw_throw, throw, load, short_of)},
        {"throw.gif": partial(draw_throw_moving, throw)},
        (),
    )
