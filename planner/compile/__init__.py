"""The cache folder, functions compiled by the C compiler at hand, and the core's laws as C text.

Everything here may be missing: callers then run slower and give the same answers.
"""

from .cache import DAMAGED, cache_folder, digest, keep, kept, publish, source_of
from .machine_code import c_compiler, compiled
