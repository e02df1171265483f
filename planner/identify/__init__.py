"""Measured throws: contact parameters fitted to them, release models validated on them.

Also makes synthetic throws on the published design, to know the truth that a fit should find.
"""

from .belief import Belief, applied, contact_text, prior_of
from .design import conditions, design, grip_use, scene_with
from .factors import SURFACE, comparisons, factor_rows, usual_surface
from .grid import Grid, grid_of
from .identified import FILES as IDENTIFY_FILES
from .identified import Identified, identify, save_identified
from .measured import measured, throw_data
from .predict import UNKNOWNS, Predictor, check_model, parameter_sets, thrown
from .synthetic import Flown, Making, Noise, make_throws, object_names
from .tables import FILES as VALIDATION_FILES
from .tables import as_dict, as_text, save_validation
from .validation import PAPER_MODELS, Validation, bootstrap, fold_of, validate
