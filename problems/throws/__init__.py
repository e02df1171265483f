"""Measured throws: a folder with dataset.toml, throws.csv and a file per recording."""

from .data import MeasuredThrow, Shared, ThrowData
from .reading import load_throws
from .writing import THROW_DATA_FILES, write_throws
