"""Pictures, GIF and 3-D view of throws and releases, in one style."""

from .moving_picture import draw_throw_moving
from .picture import MIN_WIDTH, draw_throw
from .release_pictures import draw_release_pictures
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, TEAL, draw_cup, new_figure, save
from .view_film import save_film
from .view_poses import space_throw
from .view_server import open_browser, run_panel, serving

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "MIN_WIDTH",
    "ORANGE",
    "RED",
    "TEAL",
    "draw_cup",
    "draw_release_pictures",
    "draw_throw",
    "draw_throw_moving",
    "new_figure",
    "open_browser",
    "run_panel",
    "save",
    "save_film",
    "serving",
    "space_throw",
]
