"""The C headers' declarations, with what their comments say of the arrays behind pointers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_FOLDER = Path(__file__).parent
_STRUCTURES = (_FOLDER / "structures.h").read_text("utf-8")
_FUNCTIONS = (_FOLDER / "functions.h").read_text("utf-8")

#: Lengths that the headers define.
LENGTHS = {name: int(value) for name, value in re.findall(r"#define (\w+) (\d+)", _STRUCTURES)}
#: The text inside each structure, by its name.
_BODIES = {n: body for body, n in re.findall(r"typedef struct {([^}]*)} (\w+);", _STRUCTURES)}


class Variable(NamedTuple):
    """A field of a structure, or an argument of a function.

    lengths: of an array in place. A pointer leads to an array of `shape`, such as "[rows][n]", or
    to one structure where that is empty; constant: it is not written; optional: it may be NULL.
    """

    kind: str
    name: str
    lengths: tuple[int, ...]
    pointer: bool
    constant: bool
    shape: str
    optional: bool

    @property
    def length(self) -> str:
        """The array's number of elements, as a Python expression of other variables."""
        factors = re.findall(r"\[([^\]]+)\]", self.shape)
        return " * ".join(f"({factor})" for factor in factors).replace("->", ".")


class Function(NamedTuple):
    """A function. requires: what must hold for its arguments, as a Python expression, or empty."""

    name: str
    result: str
    arguments: list[Variable]
    requires: str


def fields_of(structure: str) -> list[Variable]:
    """The fields of a structure, by its name."""
    return list(_variables(_BODIES[structure], ";"))


def functions() -> list[Function]:
    """The functions that Python calls."""
    before, *parts = _FUNCTIONS.split("\nEXPORT ")
    found = []
    for part in parts:
        match = re.match(r"(\w+) (\w+)\((.*?)\);(?:\n|$)", part, re.DOTALL)
        assert match is not None, part
        result, name, arguments = match.groups()
        required = re.search(r"Requires ([^/]*)\. \*/$", before)
        requires = "" if required is None else " ".join(required[1].split())
        requires = requires.replace("->", ".").replace("&&", "and")
        found.append(Function(name, result, list(_variables(arguments, ",")), requires))
        before = part
    return found


def _variables(text: str, separator: str) -> Iterator[Variable]:
    """Declarations, each with the comment that follows it."""
    for declaration, comment in re.findall(
        rf"([^{separator}/]+){separator}?\s*(?:/\*(.*?)\*/)?", text, re.DOTALL
    ):
        match = re.fullmatch(r"\s*(const )?(unsigned char|\w+) (.*?)\s*", declaration, re.DOTALL)
        if match is None:
            continue
        shape = re.match(r"\s*((?:\[[^\]]*\])*)", comment)
        for label in match[3].split(","):
            name, *lengths = re.findall(r"\w+", label)
            yield Variable(
                match[2],
                name,
                tuple(LENGTHS.get(length) or int(length) for length in lengths),
                "*" in label,
                match[1] is not None,
                "" if shape is None else shape[1],
                "NULL" in comment,
            )
