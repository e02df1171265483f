"""Prints docs/python.md, from the docstrings of what `import throwplan` gives:

.venv/bin/python examples/python_reference.py > docs/python.md
"""

import functools
import inspect
import re
from collections.abc import Iterator
from typing import Any

import throwplan as tp
from throwplan.problems.section import Section

INTRODUCTION = """\
# Python

Made by `examples/python_reference.py`; do not edit. `help(tp.Planner)` prints the same.

`import throwplan as tp` gives what is below. Everything is in SI units and radians. Wrong input
raises `tp.InputError`, with one line that says where, what, and what is allowed. Every other end of
planning is the plan's status.

Scenes, plans, planners and sessions can be pickled and copied. Arrays that an object keeps are
read-only: copy one to change it.
"""
#: What belongs together, in the order of use.
CHAPTERS = {
    "Plan": "Planner plan State Plan PlanPath view export replay Replay read_plan SavedThrow "
    "SentThrow",
    "Swings under way": "Session Update Response",
    "Drawings in your own axes": "draw_bars draw_cup draw_flight",
    "Releases and sweeps": "simulate simulate_batch sweep Sweep reach_map ReachMap",
    "Measured throws": "load_throws ThrowData throw_data thrown identify Identified calibrate "
    "Calibrated",
    "Scenes": "load_scene scene_names scene_text Scene",
    "Sections of a scene": "Object OutlinePart Contact Gripper Grasp Hand Robot Motion Target Pose "
    "Region Tolerance Cost Choice Cup Landing Workspace Obstacle Torque Uncertainty Distribution "
    "Robust Rest Calibration Mesh",
    "Errors": "InputError ThrowplanError",
}


def python_reference() -> str:
    """The whole page as Markdown."""
    parts = [INTRODUCTION]
    for title, names in CHAPTERS.items():
        parts.append(f"## {title}\n")
        parts += [entry for name in names.split() for entry in _entry(name, getattr(tp, name))]
    return "\n".join(parts)


def _entry(name: str, value: Any) -> Iterator[str]:
    """A function, or a class with its methods."""
    yield f"### {name}\n"
    if name == "Target":
        yield "Another name of [Pose](#pose).\n"
        return
    section = inspect.isclass(value) and issubclass(value, Section)
    if not inspect.isclass(value) or value is tp.Planner:
        yield f"```python\n{name}{_signature(value)}\n```\n"
    yield _fields(value) if section else f"{inspect.getdoc(value)}\n"
    if inspect.isclass(value) and (not section or value is tp.Scene):
        yield "".join(f"{line}\n" for line in _members(value))


def _members(kind: type[Any]) -> Iterator[str]:
    """The public methods and properties of a class, a line each."""
    for key, member in vars(kind).items():
        if key.startswith("_"):
            continue
        if inspect.isfunction(member) or isinstance(member, classmethod):
            yield f"- `{key}{_signature(getattr(kind, key))}`: {_line(member)}"
        elif isinstance(member, property | functools.cached_property):
            yield f"- `{key}`: {_line(member)}"


def _signature(value: Any) -> str:
    """A signature as it is written."""
    found = inspect.signature(value)
    kept = [p for name, p in found.parameters.items() if name != "self"]
    # Annotations are texts, defaults that are texts keep their quotes.
    return re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(found.replace(parameters=kept)))


def _line(value: Any) -> str:
    """The docstring in one line."""
    return " ".join((inspect.getdoc(value) or "").split())


def _fields(kind: type[Any]) -> str:
    """A section's docstring, its fields as a list."""
    text = inspect.getdoc(kind) or ""
    return re.sub(r"^(\w+): ", r"- `\1`: ", text, flags=re.M).rstrip() + "\n"


if __name__ == "__main__":
    print(python_reference(), end="")
