"""Many picks and bins as one motion in the least time: throws, their order, what joins them."""

from .cycle import Cycle, Step
from .planning import plan_cycle
