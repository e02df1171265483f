"""A page on which one moves the target, and the throw follows."""

from .page import PlayPage, first_plan
