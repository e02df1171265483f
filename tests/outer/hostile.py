"""Hypothesis strategies for files and command lines that are nearly right: each one edited."""

from __future__ import annotations

import copy
import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

Tree = Any

_ODD_NUMBERS = (0, -0.0, -1, 1, 0.5, 3, 7, 100, 1e-12, 1e-300, 5e-324, 1e4, 1e9, 1e30, 1e155)
_ODDER_NUMBERS = (1e300, 1.7e308, -1e-9, -1e300, 2**31, 2**63, -(2**63), 10**400)
NUMBERS = st.sampled_from((*_ODD_NUMBERS, *_ODDER_NUMBERS, math.nan, math.inf, -math.inf))
_PATHS = ("", " ", ".", "..", "/proc", "~", "a" * 300, "a/" * 3000, "\0", "/dev/null")
_WORDS = ("\x1b[31m", "a\nb", "ä∞", "%s{0}", "$\\frac{$", "-1", "nan", "1e999", "9" * 5000)
_KNOWN = ("panda", "drop", "free", "--json")
TEXTS = st.sampled_from((*_PATHS, *_WORDS, *_KNOWN)) | st.text(max_size=5)
VALUES = st.one_of(
    NUMBERS,
    NUMBERS,
    TEXTS,
    st.booleans(),
    st.lists(NUMBERS, max_size=4),
    st.lists(st.lists(NUMBERS, max_size=3), max_size=3),
    st.dictionaries(st.sampled_from(["uniform", "x", "a b", ""]), NUMBERS, max_size=2),
)


def _places(tree: Tree) -> Iterator[tuple[Tree, Any]]:
    """Every key of every table and every index of every list, with what holds it."""
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)):
        yield tree, key
        if isinstance(tree[key], dict | list):
            yield from _places(tree[key])


@st.composite
def edited(draw: st.DrawFn, tree: Tree) -> Tree:
    """A table with some edits: other values, keys gone, added or renamed, scaled numbers."""
    found = copy.deepcopy(tree)
    for _ in range(draw(st.sampled_from([1, 1, 1, 2, 3]))):
        places = list(_places(found))
        if not places:
            break
        holder, key = draw(st.sampled_from(places))
        old, kind = holder[key], draw(st.sampled_from("ssssssxxxdr"))
        if kind == "x" and isinstance(old, int | float) and not isinstance(old, bool):
            factor = draw(st.sampled_from([-1, 0, 0.5, 2, 10, 1e-3, 1e3, 1e6, 1e-9]))
            # Of a whole number beyond all floats there are only whole multiples.
            holder[key] = old * (factor if abs(old) < 1e300 else int(factor))
        elif kind == "d":
            del holder[key]
        elif kind == "r" and isinstance(holder, dict):
            holder[draw(TEXTS)] = holder.pop(key)
        elif kind == "r":
            holder += holder[: draw(st.integers(1, 3))]
        else:
            holder[key] = draw(VALUES)
    return found


@st.composite
def damaged(draw: st.DrawFn, text: str) -> bytes:
    """A file's bytes, one time in eight cut, doubled or with something strange in the middle."""
    data = text.encode("utf-8", "surrogatepass")
    if draw(st.integers(0, 7)):
        return data
    at = draw(st.integers(0, len(data)))
    odd = (b"", b"\0", b"\xff\xfe", b"\r", b"[", b"{", b'"', b"=\n", b"<")
    middle = draw(st.sampled_from((*odd, b"9" * 5000, b"[[" * 2000)))
    return data[:at] + middle + draw(st.sampled_from([data[at:], b"", data]))


def toml(table: dict[str, Tree]) -> str:
    """A table as TOML: tables in it, and lists of tables, written in line."""
    return "".join(f"{json.dumps(key)} = {_literal(value)}\n" for key, value in table.items())


def _literal(value: Tree) -> str:
    if isinstance(value, dict):
        rows = (f"{json.dumps(key)} = {_literal(item)}" for key, item in value.items())
        return "{" + ", ".join(rows) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_literal, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)


@st.composite
def toml_file(draw: st.DrawFn, table: dict[str, Tree]) -> bytes:
    """A TOML file nearly as the table has it."""
    return draw(damaged(toml(draw(edited(table)))))


@st.composite
def json_file(draw: st.DrawFn, table: dict[str, Tree]) -> bytes:
    """The same in JSON, which Python reads with NaN and infinities in it."""
    return draw(damaged(json.dumps(draw(edited(table)))))


@st.composite
def csv_file(draw: st.DrawFn, text: str) -> bytes:
    """A CSV file with a few cells of other numbers and words, lines gone or doubled."""
    rows = [line.split(",") for line in text.splitlines()]
    for _ in range(draw(st.integers(0, 2))):
        if not rows:
            break
        row = draw(st.integers(0, len(rows) - 1))
        if rows[row] and draw(st.integers(0, 3)):
            cell = draw(st.integers(0, len(rows[row]) - 1))
            rows[row][cell] = str(draw(NUMBERS | TEXTS))
        else:
            rows[row : row + draw(st.integers(0, 2))] = [rows[0], []][: draw(st.integers(0, 2))]
    return draw(damaged("\n".join(map(",".join, rows)) + "\n"))


@st.composite
def xml_file(draw: st.DrawFn, text: str) -> bytes:
    """An XML file with other attributes, and elements gone, doubled or moved."""
    root = ET.fromstring(text)
    for _ in range(draw(st.sampled_from([1, 1, 2, 3]))):
        parents = [element for element in root.iter() if len(element)]
        holders = [element for element in root.iter() if element.attrib]
        kind = draw(st.sampled_from("aaaadmr"))
        if kind == "a" and holders:
            holder = draw(st.sampled_from(holders))
            key = draw(st.sampled_from(sorted(holder.attrib)))
            words = [str(draw(NUMBERS)) for _ in holder.attrib[key].split() or [""]]
            holder.attrib[key] = draw(st.sampled_from([" ".join(words), draw(TEXTS)]))
        elif parents:
            parent = draw(st.sampled_from(parents))
            child = draw(st.sampled_from(list(parent)))
            if kind == "d":
                parent.remove(child)
            elif kind == "m":
                parent.append(copy.deepcopy(child))
            else:
                child.tag = draw(st.sampled_from(["link", "joint", "limit", "origin", "x"]))
    return draw(damaged(ET.tostring(root, encoding="unicode")))


@st.composite
def command_line(draw: st.DrawFn, options: dict[str, int], first: list[str]) -> list[str]:
    """A command's words: `first`, then some of its options with as many values as they take."""
    words = [draw(TEXTS | NUMBERS.map(str)) if not draw(st.integers(0, 9)) else w for w in first]
    for _ in range(draw(st.integers(0, 3))):
        option = draw(st.sampled_from(sorted(options)))
        count = options[option] + draw(st.sampled_from([0, 0, 0, 0, 1, -1]))
        words += [option, *(draw(TEXTS | NUMBERS.map(str)) for _ in range(count))]
    return words
