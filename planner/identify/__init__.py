"""Measured throws: contact parameters and calibrations fitted to them, and predictions."""

from .belief import Belief, applied, contact_text, prior_of
from .calibration import FILES as CALIBRATE_FILES
from .calibration import Calibrated, calibrate, conformal_region
from .identification import FILES as IDENTIFY_FILES
from .identification import Identified, identify, one_surface, save_identified, summary_of
from .measured import SURFACE, batch_rows, conditions, measured, throw_data
from .predict import AXES, MISSED, Grid, Predictor, check_model, grid_of, parameter_sets, thrown
