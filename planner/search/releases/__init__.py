"""Sampled throws in closed form: drawn within the limits, thrown, and looked up by landing."""

from .release_table import Releases, arrival, highest, joined, nearest_releases
from .run_ups import carry, flies_past_column, run_up, sampled_throw
from .sampling import ReleaseSampler, sparse_parents, stored_releases
from .towards import UNMET, drawn_towards, kinds
