"""Where the object ends: from a flight among the scene's bodies until it rests, by MuJoCo.

Needs the extra `mujoco`, which only scenes with [rest] and replays import.
"""

from .contact_model import (
    COLUMN,
    CUP_WALL,
    ContactModel,
    add_contacts,
    add_cup,
    add_object,
    add_palm,
    add_solid,
    body_of,
    floor_of,
    has_hand,
    load_mujoco,
    plane_poses,
    pose_of,
    set_contacts,
)
from .rollouts import Ends, enters_cup, entry_states, is_in_cup, is_still, rest_motion, roll_to_rest
