"""Release models against measured throws, as in the paper; synthetic throws of known truth."""

from .report import FILES as VALIDATION_FILES
from .report import as_dict, as_text, save_validation
from .synthetic import (
    BARS,
    Flown,
    Noise,
    SynthesisConfig,
    conditions,
    design,
    grip_use,
    make_throws,
    panda,
    scene_with,
)
from .validation import PAPER_MODELS, Validation, bootstrap, fold_of, validate
