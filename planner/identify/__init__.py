"""Measured throws: contact parameters fitted to them, release models validated on them.

Also makes synthetic throws on the published design, to know the truth that a fit should find.
"""

from .design import conditions, design, grip_use, scene_with
from .factors import SURFACE, usual_surface
from .factors_picture import factors_picture
from .fit_belief import UNKNOWNS, Belief
from .fit_scene import applied, prior_of
from .grid import Grid, estimated_seconds, grid_of
from .identify_files import FILES as IDENTIFY_FILES
from .identify_files import save_identified
from .identify_pictures import draw_grid
from .identify_run import Identified, identify
from .learn import throw_data, thrown, updated
from .measured import measured
from .predict import Predictor, check_model
from .synthetic import Flown, Law, Making, Noise, make_throws, object_names
from .validation import PAPER_MODELS, Validation, validate
from .validation_files import FILES as VALIDATION_FILES
from .validation_files import as_dict, as_text, errors_by_throw, save_validation
from .validation_notes import head, notes
from .validation_tables import crossed_table, error_table, factor_table, parameter_table

__all__ = [
    "IDENTIFY_FILES",
    "PAPER_MODELS",
    "SURFACE",
    "UNKNOWNS",
    "VALIDATION_FILES",
    "Belief",
    "Flown",
    "Grid",
    "Identified",
    "Law",
    "Making",
    "Noise",
    "Predictor",
    "Validation",
    "applied",
    "as_dict",
    "as_text",
    "check_model",
    "conditions",
    "crossed_table",
    "design",
    "draw_grid",
    "error_table",
    "errors_by_throw",
    "estimated_seconds",
    "factor_table",
    "factors_picture",
    "grid_of",
    "grip_use",
    "head",
    "identify",
    "make_throws",
    "measured",
    "notes",
    "object_names",
    "parameter_table",
    "prior_of",
    "save_identified",
    "save_validation",
    "scene_with",
    "throw_data",
    "thrown",
    "updated",
    "usual_surface",
    "validate",
]
