"""The tests have a cache folder of their own and compile only where they say so."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator

import pytest

_FOLDER = tempfile.TemporaryDirectory(prefix="throwplan-tests-")
os.environ["THROWPLAN_CACHE"] = _FOLDER.name
os.environ["THROWPLAN_COMPILE"] = "0"


@pytest.fixture(scope="module")
def compiling() -> Iterator[None]:
    """Compiled code where there is a compiler: the limit surface takes minutes without."""
    from throwplan.planner.compile import c_compiler

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_COMPILE", "1")
        c_compiler.cache_clear()
        yield
    c_compiler.cache_clear()
