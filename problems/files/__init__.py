"""Files: reading with errors that name the place, and writing complete files or none."""

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
