"""Measured throws: contact parameters fitted to them, release models validated on them."""

from .belief import Belief, applied, contact_text, prior_of
from .identified import FILES as IDENTIFY_FILES
from .identified import Identified, identify, one_surface, save_identified, summary_of
from .measured import measured, throw_data
from .predict import Grid, Predictor, check_model, grid_of, parameter_sets, thrown
from .report import FILES as VALIDATION_FILES
from .report import as_dict, as_text, save_validation
from .validation import PAPER_MODELS, Validation, bootstrap, fold_of, validate
