"""The tests have a cache folder of their own and compile only where they say so."""

from __future__ import annotations

import os
import tempfile

_FOLDER = tempfile.TemporaryDirectory(prefix="throwplan-tests-")
os.environ["THROWPLAN_CACHE"] = _FOLDER.name
os.environ["THROWPLAN_COMPILE"] = "0"
