"""Where the object ends: from a flight among the scene's bodies until it rests, by MuJoCo.

Needs the extra `mujoco`, which only scenes with [rest] and replays import.
"""

from .contact_model import (
    COLUMN,
    ContactModel,
    add_contacts,
    add_object,
    add_opening,
    add_palm,
    add_solid,
    body_of,
    floor_of,
    has_hand,
    load_mujoco,
    plane_poses,
    pose_of,
    set_contacts,
    wall_name,
)
from .rollouts import Ends, enters, entry_states, is_inside, is_still, rest_motion, roll_to_rest
