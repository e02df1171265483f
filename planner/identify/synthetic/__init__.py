"""Synthetic measured throws on the published design, to test a fit against a known truth."""

from .design import conditions, design, grip_use, scene_with
from .throws import Flown, Noise, SynthesisConfig, make_throws, object_names
