"""The tests have a cache folder of their own and compile only where they say so."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator

import pytest

_FOLDER = tempfile.TemporaryDirectory(prefix="throwplan-tests-")
os.environ["THROWPLAN_CACHE"] = _FOLDER.name
os.environ["THROWPLAN_COMPILE"] = "0"


def _compiling() -> Iterator[None]:
    """Compiled code where there is a compiler: the limit surface takes minutes without."""
    from throwplan.planner.compile import compiled_batch
    from throwplan.planner.compile.compiler import compiler

    caches = (compiler, compiled_batch._library)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_COMPILE", "1")
        for cached in caches:
            cached.cache_clear()
        yield
    for cached in caches:
        cached.cache_clear()


compiling = pytest.fixture(_compiling, name="compiling")
#: The same for a whole file of tests.
compiling_all = pytest.fixture(_compiling, scope="module", name="compiling_all")
