"""Pictures, films and the 3-D view of throws and releases in one style, and tables."""

from .drawings import draw_bars, draw_cup, draw_flight
from .painter import save_in_space
from .release_pictures import draw_releases
from .scene_picture import draw_scene
from .server import Panel, empty_page, open_browser, run_panel, serving
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, TEAL, new_figure, own_style, save
from .tables import Row, Table, shown
from .throw_picture import draw_throw, draw_throw_moving
from .timeline import timeline as over_time
from .view import rgb
from .view_throw import SpaceMotion, SpaceThrow, space_motion, space_throw
