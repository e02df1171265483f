"""Measured throws: contact parameters and calibrations fitted to them, and predictions."""

from .belief import Belief, applied, contact_text, prior_of
from .calibration import FILES as CALIBRATE_FILES
from .calibration import Calibrated, calibrate, conformal_region
from .commands import COMMANDS
from .comparison import FITTED, compare, left_out
from .identification import FILES as IDENTIFY_FILES
from .identification import Identified, identify, one_surface, save_identified, summary_of
from .measured import measured, throw_data
from .mujoco import ObjectReplay, Replay, replay
from .predict import Predictor, check_model, parameter_sets, thrown
from .throws import MeasuredThrow, Shared, ThrowData, load_throws
