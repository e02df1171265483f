"""A motion as it is sent, thrown by the exact models.

Nothing here knows how a throw was found; what it breaks, `planner/verdict` says.
"""

from .batch import BatchFlights, ThrowBatch
from .loads import friction_use, load_torques, rest_torques, torque_limits, torques_of
from .manipulator import Limits, Manipulator, State, joint_limits, make_manipulator, outline
from .sending import NO_SAMPLES, TICK, Samples, SmoothingError, braked, excesses, send
from .throw import CARRY_STEP, EXACT, LandingPoint, Throw, case_of, column_of, cup_entries
from .transfers import Transfer, arm_excesses, transfer
