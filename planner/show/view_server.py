"""The viser server of the 3-D view: on this machine only, on the port that was asked for."""

from __future__ import annotations

import contextlib
import io
import os
import socket
import sys
import time
import webbrowser
from collections.abc import Iterator
from typing import Any

from ...problems import InputError
from .view_poses import SpaceThrow

HOST = "127.0.0.1"
#: Steps of playing a second.
RATE = 50.0


@contextlib.contextmanager
def serving(throw: SpaceThrow, port: int) -> Iterator[tuple[str, Any]]:
    """Address and panel of the throw's view while it is served.

    InputError where viser is missing or the port cannot be had.
    """
    try:
        import viser
    except ImportError:
        raise InputError("view needs viser: pip install 'throwplan[view]'") from None
    from .view import View
    from .view_panel import Panel

    check_port(port)
    # It says on stdout that it starts and stops, which is for the command to say.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=HOST, port=port, label=throw.scene.name, verbose=False)
    try:
        if server.get_port() != port:
            raise InputError(f"--port {port}: is taken; choose another with --port")
        # The share button would let other machines in.
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        yield f"http://{HOST}:{port}", Panel(server, View(server, throw))
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def check_port(port: int) -> None:
    """InputError for a port that cannot be had; viser would take another."""
    with socket.socket() as probe:
        if os.name == "posix":
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise InputError(f"--port {port}: {reason}; choose another with --port") from None


def run_panel(panel: Any, hold: float | None) -> None:
    """Plays what the panel asks for, for `hold` seconds or until interrupted."""
    start = last = time.perf_counter()
    while hold is None or last - start < hold:
        time.sleep(1 / RATE)
        now = time.perf_counter()
        panel.advance(now - last)
        last = now


def open_browser(address: str) -> bool:
    """Opens the default browser; False where there is none."""
    displays = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in displays):
        return False
    try:
        return webbrowser.open(address)
    except (webbrowser.Error, OSError):
        return False
