"""Machine code and tables: the cache folder, CasADi kernels, compiled batches.

Everything here may be missing: callers then run slower and give the same answers.
"""

from .cache import DAMAGED, cache_folder, digest, publish, source_of
from .compiled import Code, Compile
from .compiler import compiler as c_compiler
