"""A motion replayed in MuJoCo: contacts and flight independent of the planner (extra `mujoco`)."""

from .replay import ObjectReplay, Replay, replay
