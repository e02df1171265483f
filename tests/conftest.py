"""The tests have a cache folder of their own."""

from __future__ import annotations

import os
import tempfile

_FOLDER = tempfile.TemporaryDirectory(prefix="throwplan-tests-")
os.environ["THROWPLAN_CACHE"] = _FOLDER.name
