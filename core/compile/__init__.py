"""CasADi functions as machine code, and the folder that keeps what is slow to make.

Compiler and folder may be missing: callers then run slower and give the same answers.
"""

from .cache import DAMAGED, cache_folder, digest, keep, kept, publish, scratch_folder, source_of
from .machine_code import Made, c_compiler, compiled, compiled_later
