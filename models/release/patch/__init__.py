"""The pads as a meshed patch of points with Coulomb friction, the reference for model errors."""

from .points import RADIUS_PER_ARM, Patch, PointSolver, SlipProblem, disc
from .release import CREEP, PATCH_CHUNK, PatchRelease, PatchThrows, critical_damping
