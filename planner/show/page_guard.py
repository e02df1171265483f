"""Who may open the page, and what a browser may send to it.

Any web page can send requests to a port of this machine, and any program messages of any shape.
viser takes them all and has no place for a check: `guarded` puts one in front of it.
"""

from __future__ import annotations

import contextlib
import math
import sys
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

#: Names of this machine in the address of the page.
LOCAL = ("127.0.0.1", "localhost")
#: Longest message [bytes], and longest text of a control [characters].
LONGEST_MESSAGE, LONGEST_TEXT = 1 << 16, 1000
#: Close codes of connections that break the rules of WebSocket, or send too much.
BROKEN = (1002, 1003, 1007, 1009)
#: Messages that the page takes: how many numbers a field has (0: one that is no list), or its type.
MESSAGES: dict[str, dict[str, int | type]] = {
    "GuiUpdateMessage": {"uuid": str, "updates": dict},
    "TransformControlsUpdateMessage": {"name": str, "owner": str, "wxyz": 4, "position": 3},
    "TransformControlsDragStartMessage": {"name": str, "owner": str},
    "TransformControlsDragEndMessage": {"name": str, "owner": str},
    "ViewerCameraMessage": {
        **{"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3},
        **{"fov": 0, "near": 0, "far": 0, "image_height": 0, "image_width": 0},
    },
}
#: Only one page starts at a time: its start replaces a function of websockets.
_STARTING = threading.Lock()


@dataclass
class PageState:
    """controls: viser's handles of the page's controls, by their keys in messages. active: whether
    requests and messages to the server are checked."""

    controls: Mapping[str, Any] = field(default_factory=dict)
    active: bool = False


@contextlib.contextmanager
def guarded(host: str, port: int) -> Iterator[PageState]:
    """Checks requests and messages to the viser server that the block starts at this address, as
    long as it runs; yields the state that the checks read."""
    import viser
    from websockets.asyncio import server
    from websockets.exceptions import ConnectionClosed

    serve, state = server.serve, PageState()

    class Connection(server.ServerConnection):
        """A connection that leaves out messages with a mistake."""

        async def recv(self, decode: bool | None = None) -> Any:
            while True:
                try:
                    raw = await super().recv(decode)
                except ConnectionClosed as error:
                    if error.sent is not None and error.sent.code in BROKEN:
                        _report(f"a connection is closed: {_short(error.sent.reason)}")
                    raise
                mistake = mistake_in(raw, state.controls)
                if not mistake:
                    return raw
                _report(f"a message is left out: {mistake}")

    def serve_guarded(handler: Any, *address: Any, process_request: Any, **options: Any) -> Any:
        if address != (host, port):
            return serve(handler, *address, process_request=process_request, **options)

        def checked(connection: Any, request: Any) -> Any:
            refusal = refusal_of(request.headers)
            if refusal:
                _report(f"a request is refused: {refusal}")
                return connection.respond(HTTPStatus.FORBIDDEN, f"{refusal}\n")
            return process_request(connection, request)

        async def handle(connection: Any) -> None:
            if connection.subprotocol == f"viser-v{viser.__version__}":
                await handler(connection)
            else:  # viser would print on stdout.
                await connection.close(1002, "another version of viser: reload the page")

        state.active = True
        options |= {"create_connection": Connection, "max_size": LONGEST_MESSAGE}
        return serve(handle, *address, process_request=checked, **options)

    with _STARTING:
        server.serve = serve_guarded  # type: ignore[assignment,misc]
        try:
            yield state
        finally:
            server.serve = serve  # type: ignore[misc]


def refusal_of(headers: Any) -> str:
    """Why a request is refused, from its headers; empty for one of the page itself.

    Browsers name the page that sends a request as its origin. A foreign name of this machine is one
    that a foreign page has made its own (DNS rebinding). Programs name no origin.
    """
    hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
    if len(hosts) != 1 or hosts[0].lower().partition(":")[0] not in LOCAL:
        return f"Host is {_short(', '.join(hosts))}, must be {' or '.join(LOCAL)}"
    if origins not in ([], [f"http://{hosts[0]}"]):
        return f"Origin is {_short(', '.join(origins))}, must be http://{hosts[0]}"
    return ""


def mistake_in(raw: str | bytes, controls: Mapping[str, Any]) -> str:
    """What is wrong with a message; empty for one that the page's controls can have sent."""
    from msgspec import MsgspecError, msgpack

    try:
        message = msgpack.decode(raw) if isinstance(raw, bytes) else None
    except (MsgspecError, RecursionError, ValueError):
        message = None
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        return "must be a map with a type, in MessagePack"
    kind = message.pop("type")
    if kind not in MESSAGES:
        return f"type is {_short(kind)}, must be one of {', '.join(MESSAGES)}"
    if message.keys() != MESSAGES[kind].keys():
        return f"{kind}: must have the fields {', '.join(MESSAGES[kind])}"
    for name, allowed in MESSAGES[kind].items():
        if not _is_of(allowed, message[name]):
            words = allowed.__name__ if isinstance(allowed, type) else f"{allowed or 1} number(s)"
            return f"{kind}: {name} is {_short(message[name])}, must be {words}"
    if kind != "GuiUpdateMessage":
        return ""
    control, updates = controls.get(message["uuid"]), message["updates"]
    if control is None or updates.keys() != {"value"}:
        return f"{kind}: must change the value of a control of the page"
    value, label = updates["value"], getattr(control, "label", "")
    words = _allowed_instead(control, value)
    return words and f"{label} is {_short(value)}, must be {words}"


def _is_of(allowed: int | type, value: Any) -> bool:
    """Whether a field has the type or the numbers that `MESSAGES` says."""
    if isinstance(allowed, type):
        return isinstance(value, allowed)
    if not allowed:
        return _is_number(value)
    return isinstance(value, list) and len(value) == allowed and all(map(_is_number, value))


def _allowed_instead(control: Any, value: Any) -> str:
    """What a control allows instead of a value; empty if it allows the value."""
    options, now = getattr(control, "options", None), control.value
    if options is not None:
        return "" if value in options else f"one of {', '.join(options)}"
    if isinstance(now, bool):
        return "" if isinstance(value, bool) else "true or false"
    if isinstance(now, str):
        fits = isinstance(value, str) and len(value) <= LONGEST_TEXT
        return "" if fits else f"a text of at most {LONGEST_TEXT} characters"
    low, high, step = (getattr(control, name, None) for name in ("min", "max", "step"))
    if low is None or high is None:
        return "" if _is_number(value) else "a finite number"
    # A slider's steps need not end at its limits.
    fits = _is_number(value) and low - step <= value <= high + step
    return "" if fits else f"a number from {low:g} to {high:g}"


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and math.isfinite(value)


def _short(value: Any) -> str:
    """A value in at most 60 printable characters."""
    return f"{value!r:.60}"


def _report(words: str) -> None:
    print(f"throwplan: the page: {words}", file=sys.stderr, flush=True)
