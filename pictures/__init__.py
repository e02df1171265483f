"""Pictures, films and the 3-D view of results, in one style; tables.

`draw` makes a Matplotlib figure of a result, `save` writes all its pictures, `view` shows a motion
in 3-D. Matplotlib is imported with the first picture, the extras `view` and `film` where they are
used.
"""

from .commands import COMMANDS
from .drawings import draw_bars, draw_cup, draw_flight
from .release_pictures import draw_releases
from .results import draw, save
from .scene_picture import draw_scene
from .space import view
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, TEAL, new_figure, own_style, save_figure
from .tables import Row, Table, shown
