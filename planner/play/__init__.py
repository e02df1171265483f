"""A page on which one moves the target, and the throw follows."""

from .around import sweep_delays
from .page import PlayPage, first_plan
