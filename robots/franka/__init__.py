"""A motion played on a Franka robot by libfranka's Python binding, and watched (extra `franka`)."""

from .connection import Franka, check_motion, connected
from .run import approach, rehearse, throws
from .watch import find_stops
