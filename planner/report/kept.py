"""Sections of an earlier report in the same folder, so that one can be measured again alone."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .page import Part, Picture, Section, Table, files_of

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
            "short": section.short,
            "parts": [_kept(part) for part in section.parts],
        }
        for section in sections
    ]
    text = ",\n".join(json.dumps(section, allow_nan=True) for section in found)
    (folder / NAME).write_text(f"[\n{text}\n]\n", encoding="utf-8")


def kept(folder: Path) -> list[Section]:
    """The sections kept in a folder whose files are all still there; none if there are none."""
    try:
        found = json.loads((folder / NAME).read_text(encoding="utf-8"))
        sections = [_section(entry) for entry in found]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [section for section in sections if _whole(folder, section)]


def _whole(folder: Path, section: Section) -> bool:
    return all((folder / name).exists() for part in section.parts for name in files_of(part))


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
        data = {} if part.data is None else {"data": part.data.name}
        return {"picture": part.name, "caption": part.caption, **data}
    return {"words": part}


def _section(entry: dict[str, Any]) -> Section:
    parts = [_part(part) for part in entry["parts"]]
    seconds = math.nan if entry["seconds"] is None else float(entry["seconds"])
    short = [str(words) for words in entry.get("short", [])]
    return Section(entry["key"], entry["title"], parts, seconds, entry["made"], short)


def _part(entry: dict[str, Any]) -> Part:
    if "words" in entry:
        return str(entry["words"])
    if "table" in entry:
        columns, rows = entry["columns"], entry["rows"]
        return Table(entry["table"], entry["caption"], columns, rows, entry["digits"])
    data = Table(entry["data"], "", (), ()) if "data" in entry else None
    return Picture(entry["picture"], entry["caption"], _is_there, data)


def _is_there(path: Path) -> None:
    """A kept picture is not drawn again."""
