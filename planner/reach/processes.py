"""The growth of a library by several processes, which share no more than its folder."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import time
from dataclasses import dataclass

from ...problems import Scene
from ..check import make_mover
from ..search import Clock, Library, Problems, Reach, Releases, ReleaseSampler, Sources
from .cells import Landings, landings_of
from .growing import Growth, always_asked
from .maps import Progress

#: Fewer throws are solved by this process alone: others take some seconds to start.
ALONE = 400
#: Processes, and the time [s] between two looks at how far they are.
PROCESSES, LOOK = 2, 0.5
#: A process that is told to end keeps what it has, and may take so long [s].
ENDING = 10.0
#: What a process runs: it finds the package where this one did.
BOOT = (
    "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer);"
    f"import {__name__} as started; started.work(pickle.load(sys.stdin.buffer))"
)


@dataclass(frozen=True)
class Order:
    """What a process is given to do, and by which process."""

    scene: Scene
    releases: Releases
    landings: Landings
    throws: int
    share: tuple[int, int]
    parent: int


def grow(sources: Sources, library: Library, throws: int, progress: Progress | None) -> None:
    """Grows a scene's library to about `throws`.

    Ctrl-C ends it with what there is by then.
    """
    problems, releases = sources.problems, sources.table()
    scene, landings = problems.scene, landings_of(problems.scene)
    if throws >= ALONE:
        assert scene.target is not None
        problems.problem(scene.target, always_asked(scene), "fatrop", Clock()).solver.compile()
    count = min(PROCESSES, os.cpu_count() or 1)
    if throws < ALONE or count == 1 or library.folder is None:
        Growth(sources, library, landings, throws).grow(progress)
        return
    orders = [
        Order(scene, releases, landings, throws, (k, count), os.getpid()) for k in range(count)
    ]
    running = [_started(order) for order in orders]
    try:
        while any(process.poll() is None for process in running):
            time.sleep(LOOK)
            library.refresh()
            if progress is not None:
                progress(min(len(library), throws), throws)
        if any(process.returncode for process in running):
            # One was killed: its share is done here.
            Growth(sources, library, landings, throws).grow(progress)
    finally:
        for process in running:
            if process.poll() is None:
                process.terminate()
        for process in running:
            try:
                process.wait(ENDING)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        library.refresh()


def _started(order: Order) -> subprocess.Popen[bytes]:
    # One thread each: those of the linear algebra would wait for one another.
    alone = os.environ | dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    process = subprocess.Popen(
        [sys.executable, "-c", BOOT],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=alone,
        start_new_session=True,
    )
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError), process.stdin as given:
        given.write(pickle.dumps([os.path.abspath(path) for path in sys.path]))
        given.write(pickle.dumps(order))
    return process


def work(order: Order) -> None:
    """One process' part, until it is done, told to end, or left alone."""

    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, ended)
    mover = make_mover(order.scene)
    sampler, reach = ReleaseSampler(order.scene, mover), Reach(order.scene, mover)
    sources = Sources(Problems(order.scene, mover), sampler, reach, lambda: order.releases)
    library = Library(order.scene, mover)
    growth = Growth(sources, library, order.landings, order.throws, order.share)

    def watched(done: int, throws: int) -> None:
        if os.getppid() != order.parent:
            raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        growth.grow(watched)
