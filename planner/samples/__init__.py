"""Sampled throws in closed form: drawn within the limits, thrown, and looked up by landing."""

from .closed_form import carry, flies_past_column, in_obstacles, polynomial, run_up, sampled_throw
from .releases import Releases, arrival, highest, joined, nearest, starts
from .sampling import ReleaseSampler, sparse_parents, stored_releases
