"""A motion as it is sent, thrown by the exact models.

Nothing here knows how a throw was found; what it breaks, `planner/verdict` says.
"""

from .batch import BatchFlights, ThrowBatch, flight_of
from .loads import core_torques, friction_use, rest_torques, torque_limits, torque_uses
from .manipulator import Limits, Manipulator, State, joint_limits, make_manipulator, outline
from .sent_samples import NO_SAMPLES, TICK, Samples, SmoothingError, braked, excesses, send
from .simulation import (
    Simulation,
    given_hand,
    named_model,
    planar_joints,
    recorded_joints,
    simulate,
    simulate_batch,
)
from .throw import (
    EXACT,
    LandingPoint,
    Throw,
    case_of,
    column_of,
    core_scene,
    cup_entries,
    release_model,
)
from .transfers import Transfer, arm_excesses, transfer
