"""Measured throws: contact parameters fitted to them, release models validated on them.

Also makes synthetic throws on the published design, to know the truth that a fit should find.
"""

from .belief import Belief, applied, contact_text, prior_of
from .design import conditions, design, grip_use, scene_with
from .factors import SURFACE, comparisons, factor_rows, mann_whitney, usual_surface
from .grid import Grid, estimated_seconds, grid_of
from .identified import FILES as IDENTIFY_FILES
from .identified import Identified, identify, save_identified
from .measured import Measured, measured, velocities
from .pictures import errors_picture, factors_picture, grid_picture, save_pictures
from .planned import throw_data, thrown
from .predict import UNKNOWNS, Predictor, check_model, parameter_sets
from .synthetic import Flown, Law, Making, Noise, make_throws, object_names
from .tables import FILES as VALIDATION_FILES
from .tables import (
    as_dict,
    as_text,
    crossed_table,
    error_table,
    errors_by_throw,
    factor_table,
    head,
    notes,
    parameter_table,
    save_validation,
)
from .validation import PAPER_MODELS, Validation, bootstrap, fold_of, validate

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
    "Measured",
    "Noise",
    "Predictor",
    "Validation",
    "applied",
    "as_dict",
    "as_text",
    "bootstrap",
    "check_model",
    "comparisons",
    "conditions",
    "contact_text",
    "crossed_table",
    "design",
    "error_table",
    "errors_by_throw",
    "errors_picture",
    "estimated_seconds",
    "factor_rows",
    "factor_table",
    "factors_picture",
    "fold_of",
    "grid_of",
    "grid_picture",
    "grip_use",
    "head",
    "identify",
    "make_throws",
    "mann_whitney",
    "measured",
    "notes",
    "object_names",
    "parameter_sets",
    "parameter_table",
    "prior_of",
    "save_identified",
    "save_pictures",
    "save_validation",
    "scene_with",
    "throw_data",
    "thrown",
    "usual_surface",
    "validate",
    "velocities",
]
