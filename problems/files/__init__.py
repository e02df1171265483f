"""Files: what users write is read with clear errors; what we write is there whole or not at all."""

from .reading import read_csv, read_text, shipped, table_number, toml_tables
from .writing import (
    copy_out,
    filling,
    plain,
    prepare_folder,
    toml_key,
    toml_lines,
    write_json,
)
