"""Sections of an earlier report in the same folder, so that one can be measured again alone."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .page import Part, Picture, Section, Table

#: Where they are kept, beside the page.
NAME = "report.json"


def keep(folder: Path, sections: Sequence[Section]) -> None:
    """Writes the sections, tables with all digits, pictures by their name."""
    found = [
        {
            "key": section.key,
            "title": section.title,
            "made": section.made,
            "seconds": section.seconds,
            "parts": [_kept(part) for part in section.parts],
        }
        for section in sections
    ]
    (folder / NAME).write_text(json.dumps(found, indent=1, allow_nan=True) + "\n", encoding="utf-8")


def kept(folder: Path) -> list[Section]:
    """The sections kept in a folder whose files are all still there; none if there are none."""
    try:
        found = json.loads((folder / NAME).read_text(encoding="utf-8"))
        sections = [_section(entry) for entry in found]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [section for section in sections if _whole(folder, section)]


def _whole(folder: Path, section: Section) -> bool:
    names = [f"{p.name}.png" for p in section.parts if isinstance(p, Picture)]
    names += [f"{p.name}.csv" for p in section.parts if isinstance(p, Table)]
    return all((folder / name).exists() for name in names)


def _kept(part: Part) -> dict[str, Any]:
    if isinstance(part, Table):
        rows = [list(row) for row in part.rows]
        return {
            "table": part.name,
            "caption": part.caption,
            "columns": list(part.columns),
            "rows": rows,
            "digits": part.digits,
        }
    if isinstance(part, Picture):
        return {"picture": part.name, "caption": part.caption}
    return {"words": part}


def _section(entry: dict[str, Any]) -> Section:
    parts = [_part(part) for part in entry["parts"]]
    seconds = math.nan if entry["seconds"] is None else float(entry["seconds"])
    return Section(entry["key"], entry["title"], parts, seconds, entry["made"])


def _part(entry: dict[str, Any]) -> Part:
    if "words" in entry:
        return str(entry["words"])
    if "table" in entry:
        columns, rows = entry["columns"], entry["rows"]
        return Table(entry["table"], entry["caption"], columns, rows, entry["digits"])
    return Picture(entry["picture"], entry["caption"], _is_there)


def _is_there(path: Path) -> None:
    """A kept picture is not drawn again."""
