"""Setuptools' build backend; it takes a C compiler from the package index where there is none."""

# mypy: ignore-errors

import os
import shutil

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403

#: Where no C compiler is on PATH; 400 MB unpacked.
ZIG = "ziglang>=0.13"


def _more(hook, settings):
    names = [*os.environ.get("CC", "").split()[:1], "cc", "gcc", "clang"]
    return hook(settings) + ([] if any(map(shutil.which, names)) else [ZIG])


def get_requires_for_build_wheel(config_settings=None):
    """What building a wheel needs."""
    return _more(build_meta.get_requires_for_build_wheel, config_settings)


def get_requires_for_build_editable(config_settings=None):
    """What an editable installation needs."""
    return _more(build_meta.get_requires_for_build_editable, config_settings)
