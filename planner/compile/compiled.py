"""Compiled functions, an NLP's mostly, from the cache folder, where a C compiler is there.

The library's name in the cache is a hash of the generated C code, compiler and machine.
The code is kept too, under a hash of what it comes from, so that a library is found without
deriving and generating anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import casadi as ca

from .cache import cache_folder, digest, publish
from .compiler import compiler, library_path, shared_library, sound

#: no: never; cached: what is there already; background: and start what is not, for later;
#: wait: compile what is not there.
Compile = Literal["no", "cached", "background", "wait"]

#: More optimisation compiles twice as long and runs no faster.
FLAGS = ("-O1",)
#: The names of an NLP's functions for a solver.
NAMES = ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l", "nlp_grad")
#: Closes a complete source file.
_END = "/* end */\n"
#: Code longer than this (bytes), that of scenarios, takes minutes and gigabytes to compile: it
#: is left alone, and a file that says so kept instead.
LARGEST = 8_000_000
_TOO_LARGE = "/* too large to compile */\n"


def compiled_functions(
    key: str,
    make: Callable[[], dict[str, ca.Function]],
    compiling: Compile,
    names: Sequence[str] = NAMES,
) -> dict[str, ca.Function] | None:
    """The functions `names` compiled, or None.

    key: all that they depend on; make: derives them, called when no code is cached.
    """
    source = _source(key, make, compiling)
    path = None if source is None else shared_library(source, FLAGS, wait=compiling == "wait")
    return None if path is None else _loaded(path, names)


class Code:
    """Compiled functions that may still be on their way from another process.

    functions: what is there from the start, see `compiled_functions`; None if nothing is.
    """

    def __init__(
        self,
        key: str,
        make: Callable[[], dict[str, ca.Function]],
        compiling: Compile,
        names: Sequence[str] = NAMES,
    ) -> None:
        self.functions = compiled_functions(key, make, compiling, names)
        waits = self.functions is None and compiling == "background"
        self._names, self._awaited = names, _library(key) if waits else None

    @property
    def awaited(self) -> bool:
        """Whether another process is still compiling them."""
        path = self._awaited
        return path is not None and not (path.exists() and sound(path))

    def arrived(self) -> dict[str, ca.Function] | None:
        """The functions if they were awaited and are there now, once."""
        path = self._awaited
        if path is None or self.awaited:
            return None
        self._awaited = None
        return _loaded(path, self._names)


def _library(key: str) -> Path | None:
    """Where the functions of `key` will be when a process has compiled them."""
    source = _source(key, dict, "cached")
    return None if source is None else library_path(source, FLAGS)


def _loaded(path: Path, names: Sequence[str]) -> dict[str, ca.Function]:
    return {name: ca.external(name, str(path)) for name in names}


def _source(key: str, make: Callable[[], dict[str, ca.Function]], compiling: Compile) -> str | None:
    """The generated code, from the cache or made now; None where it is of no use."""
    folder = cache_folder()
    if compiling == "no" or folder is None or compiler() is None:
        return None
    name = f"{digest(key, ca.CasadiMeta.version())}.c"
    try:
        source = (folder / name).read_text(encoding="utf-8")
    except (OSError, ValueError):
        source = ""
    if not source.endswith(_END):
        if compiling == "cached":
            return None
        source = _generated(make())
        if len(source) > LARGEST:
            source = _TOO_LARGE + _END
        publish(folder, name, lambda path: _write(path, source))
    return None if source.startswith(_TOO_LARGE) else source


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _generated(functions: dict[str, ca.Function]) -> str:
    generator = ca.CodeGenerator("throw")
    for function in functions.values():
        generator.add(function)
    return str(generator.dump()) + _END
