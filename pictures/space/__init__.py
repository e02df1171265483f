"""Motions in 3-D: on a page of this machine, as a picture, as a film; the page of `play`."""

from .motion import SpaceMotion, SpaceThrow, space_motion, space_throw
from .painter import save_in_space
from .play import PlayPage, first_plan
from .server import Panel, empty_page, open_browser, run_panel, serving
from .stage import rgb
from .viewing import motion_to_rest, view
