"""Commands run in this process, plans made once for all tests of the outer face."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from throwplan.cli import main


@dataclass(frozen=True)
class Said:
    """What a command printed and returned."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """Standard output as exactly one JSON object; NaN and infinities are errors."""
        answer = json.loads(self.out, parse_constant=_no_constant)
        assert isinstance(answer, dict)
        return answer


def _no_constant(name: str) -> NoReturn:
    raise AssertionError(f"{name} in JSON")


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A shell's background job ignores interrupts, under nohup hangups too, and would hand that
    on."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    hangup = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGINT, before)
    signal.signal(signal.SIGHUP, hangup)


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    """A function that runs a command line: words, the first one split at blanks."""

    def running(line: str, *words: object) -> Said:
        capfd.readouterr()
        status = main([*line.split(), *map(str, words)])
        return Said(status, *capfd.readouterr())

    return running


@pytest.fixture
def refused(run: Callable[..., Said]) -> Callable[..., str]:
    """A function that runs a command line that is wrong and returns its message.

    What holds for every refusal is asserted: status 2, on stderr `lines` lines (one for each
    mistake), with --json the same message as the only key of one object on stdout.
    """

    def refusing(line: str, *words: object, lines: int = 1) -> str:
        plain, as_json = run(line, *words), run(line, *words, "--json")
        assert (plain.status, plain.out, as_json.status) == (2, "", 2), plain
        said = plain.err.splitlines()
        assert len(said) == lines and "Traceback" not in plain.err, plain.err
        answer = as_json.json
        assert list(answer) == ["error"] and answer["error"].strip()
        assert [f"throwplan: {one}" for one in answer["error"].splitlines()] == said
        assert as_json.err == plain.err
        return plain.err

    return refusing


def listing(folder: Path) -> dict[str, bytes | None]:
    """Everything under a folder, with its content."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def untouched(tmp_path: Path):
    """The test leaves `tmp_path` as `untouched()` found it when it was called last."""
    before: list[dict[str, bytes | None]] = []
    yield lambda: before.append(listing(tmp_path))
    assert listing(tmp_path) == before[-1]


@pytest.fixture(scope="session")
def table() -> Callable[[Path], np.ndarray]:
    """Reads a CSV file with a header line."""
    return lambda path: np.genfromtxt(path, delimiter=",", names=True)
