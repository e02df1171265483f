"""A page on which one moves the target, and the throw follows."""

from .around import late_and_early
from .page import PlayPage, first_plan
