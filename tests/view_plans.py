"""Plans to look at in 3-D, as folders, and a free port."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest
from throwplan import Planner, Pose, load_scene

AZIMUTH = 0.5


def cup_plan(factory: pytest.TempPathFactory) -> Path:
    """The folder of a plan out of the plane y = 0."""
    target = Pose(x=0.92 * np.cos(AZIMUTH), y=0.92 * np.sin(AZIMUTH), z=0.22, theta=-np.pi / 2)
    return _saved(factory, "cup", target)


def hand_plan(factory: pytest.TempPathFactory) -> Path:
    """The folder of a free hand's plan."""
    return _saved(factory, "hand-flip", None)


def _saved(factory: pytest.TempPathFactory, name: str, target: Pose | None) -> Path:
    folder = factory.mktemp(name)
    Planner(load_scene(name)).plan(target).save(folder, draw=False)
    return folder


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
