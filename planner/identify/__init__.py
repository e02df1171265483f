"""Measured throws: contact parameters fitted to them, release models validated on them."""

from .belief import Belief, applied, contact_text, prior_of
from .calibration import FILES as CALIBRATE_FILES
from .calibration import Calibrated, calibrate
from .conformal import region as conformal_region
from .identification import FILES as IDENTIFY_FILES
from .identification import Identified, identify, one_surface, save_identified, summary_of
from .measured import measured, throw_data
from .predict import Grid, Predictor, check_model, grid_of, parameter_sets, thrown
from .validation import PAPER_MODELS, Validation, bootstrap, fold_of, validate
from .validation_report import FILES as VALIDATION_FILES
from .validation_report import as_dict, as_text, save_validation
