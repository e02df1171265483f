"""The page of the 3-D view, on this machine only: viser's server, panel and clock."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Iterator
from typing import Any

from ...problems import InputError
from ..style import PHASES
from .motion import SpaceMotion, SpaceThrow
from .stage import View

HOST = "127.0.0.1"
#: Playback speeds over real time, by their labels.
SPEEDS = {"1": 1.0, "1/5": 0.2, "1/20": 0.05}


@contextlib.contextmanager
def serving(shown: SpaceMotion, port: int) -> Iterator[tuple[str, Panel]]:
    """Address and panel of a motion's view while it is served; errors: `empty_page`."""
    with empty_page(shown.name, port) as (address, server):
        yield address, Panel(server, shown)


@contextlib.contextmanager
def empty_page(title: str, port: int) -> Iterator[tuple[str, Any]]:
    """Address and viser server of a page with nothing on it while it is served.

    InputError without viser, or if the port is not available.
    """
    try:
        import viser
    except ImportError:
        raise InputError("the page needs viser: pip install viser") from None
    unavailable = InputError(f"--port {port}: is not available; choose another with --port")
    with socket.socket() as probe:
        if probe.connect_ex((HOST, port)) == 0:
            raise unavailable
    # Browsers open connections and drop them silently.
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    # viser prints its start and stop on stdout, which belongs to the command.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=HOST, port=port, label=title, verbose=False)
    try:
        if server.get_port() != port:  # viser takes the next free one.
            raise unavailable
        # No tunnel from other machines, neither by the button nor by a message.
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        server.gui.main_panel.dock_right()
        # Light from all sides, and no environment picture, which viser would download.
        server.scene.configure_environment_map(None)
        server.scene.add_light_ambient("/light", intensity=2.0)
        yield f"http://{HOST}:{port}", server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def run_panel(panel: Any, hold: float | None) -> None:
    """Play the panel, 50 steps a second, for `hold` seconds or until interrupted."""
    start = last = time.perf_counter()
    while hold is None or last - start < hold:
        time.sleep(0.02)
        now = time.perf_counter()
        panel.advance(now - last)
        last = now


def open_browser(address: str) -> bool:
    """Open the default browser; False without one."""
    displays = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in displays):
        return False
    try:
        return webbrowser.open(address)
    except (webbrowser.Error, OSError):
        return False


class Player:
    """Slider, play button and words of a view; `advance` plays.

    end [s]: of what is shown; time [s]: the instant shown. viser calls back from other threads, so
    a lock guards the state.
    """

    def __init__(self, gui: Any, end: float, speed: str) -> None:
        self.end, self.time, self.playing = end, 0.0, False
        self._lock = threading.RLock()
        self.words = gui.add_markdown("")
        self.slider = gui.add_slider(
            "time [ms]", min=0, max=round(1e3 * self.end), step=1, initial_value=0
        )
        self.button = gui.add_button("play", hint="play from here; from the start at the end")
        self.speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value=speed)
        self.slider.on_update(lambda _: self._slider_moved())
        self.button.on_click(lambda _: self.play(not self.playing))

    def show(self, time: float) -> str:
        """Move the view to `time` [s]; words for it."""
        raise NotImplementedError

    def go(self, time: float) -> None:
        """Show the instant at `time` [s]."""
        with self._lock:
            self.time = min(max(time, 0.0), self.end)
            self.words.content = self.show(self.time)
            self.slider.value = round(1e3 * self.time)

    def play(self, playing: bool) -> None:
        """Start or stop; at the end start again from rest."""
        with self._lock:
            if playing and self.time >= self.end:
                self.go(0.0)
            self.playing = playing
            self.button.label = "pause" if playing else "play"

    def advance(self, seconds: float) -> None:
        """Advance by `seconds` of real time."""
        with self._lock:
            if not self.playing:
                return
            self.go(self.time + SPEEDS[self.speed.value] * seconds)
            if self.time >= self.end:
                self.play(False)

    def _slider_moved(self) -> None:
        """The user moved the slider, or `go` moved it to the time it shows."""
        with self._lock:
            if self.slider.value != round(1e3 * self.time):
                self.go(1e-3 * self.slider.value)


class Panel(Player):
    """The player of a motion's view, of a single throw with a legend of its phases; `change` shows
    another motion."""

    def __init__(self, server: Any, motion: SpaceMotion) -> None:
        self.view, self.motion = View(server, motion), motion
        speed = "1/5" if motion.is_single else "1"
        super().__init__(server.gui, float(motion.times[-1]), speed)
        self.release = server.gui.add_button(
            "go to the release", hint="the opening: the force starts to fall"
        )
        self.legend = server.gui.add_html(self._legend)
        self.release.on_click(lambda _: self.go(self._opening))
        self.go(0.0)

    @property
    def throw(self) -> SpaceThrow:
        """The throw, of several the first."""
        return self.motion.throws[0]

    @property
    def _opening(self) -> float:
        """When the pads begin to open for it [s]."""
        return self.motion.begins[0] + self.throw.throw.opening_time

    @property
    def _legend(self) -> str:
        return _legend(self.throw.shown_phases()) if self.motion.is_single else ""

    def change(self, motion: SpaceMotion) -> None:
        """Show another motion of the scene, at its opening or at the current time of playback."""
        with self._lock:
            self.motion, self.end = motion, float(motion.times[-1])
            # The slider goes to its own time when it is set.
            time = self.time if self.playing else self._opening
            self.view.change(motion)
            self.slider.value, self.slider.max = 0, round(1e3 * self.end)
            self.legend.content = self._legend
            self.go(time)

    def show(self, time: float) -> str:
        """Move the view to `time` [s]; what the last object does."""
        words = f"**{self.motion.words(self.view.show(time))}**, {1e3 * time:.0f} ms"
        if not self.motion.is_single:
            return words
        since = 1e3 * (time - self._opening)
        return f"{words} (opening {'−' if since < 0 else '+'} {abs(since):.0f} ms)"


def _legend(phases: dict[str, float]) -> str:
    """Colours and first instants of the phases."""
    square = '<span style="color:{}">&#9632;</span>'
    rows = [
        f"{square.format(PHASES[name])} {name} from {1e3 * start:.0f} ms"
        for name, start in phases.items()
        if name in PHASES
    ]
    rows.append(f"landing at {1e3 * phases['landing']:.0f} ms")
    body = "<br>".join(rows)
    return f'<div style="padding:0.5em 1em;font-size:0.875em;line-height:1.6">{body}</div>'
