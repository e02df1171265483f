"""Measured throws: contact parameters and corrections fitted to them; replays in MuJoCo."""

from .belief import Belief, applied, contact_text, prior_of
from .calibration import Calibrated, calibrate, conformal_region
from .commands import COMMANDS
from .comparison import compare, left_out
from .identification import Identified, identify
from .measured import measured, throw_data
from .mujoco import ObjectReplay, Replay, replay
from .predict import Predictor, parameter_sets, thrown
from .throws import MeasuredThrow, Shared, ThrowData, load_throws
