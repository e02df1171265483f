"""A throw under [uncertainty]: sampled throws, delays of the opening, and where the object rests.

`planner/verdict` judges each throw; here they are drawn, counted and put into sentences.
"""

from .delays import FURTHEST, SAID, DelayScan, DelayTolerance, scan_delays, with_delays
from .rest_count import Entries, RestCount, RestingThrow, count_rests
from .sampled_throws import spread, warnings
from .sampler import Sampler, sampler_of
