"""The tests have a cache folder of their own and compile only where they say so."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

_FOLDER = tempfile.TemporaryDirectory(prefix="throwplan-tests-")
os.environ["THROWPLAN_CACHE"] = _FOLDER.name
os.environ["THROWPLAN_COMPILE"] = "0"


@pytest.fixture(scope="module")
def odd_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The URDF of `planar_urdf`."""
    from planar_urdf import planar_urdf

    path = tmp_path_factory.mktemp("odd") / "odd.urdf"
    path.write_text(planar_urdf()[0])
    return path
