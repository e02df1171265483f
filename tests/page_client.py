"""A program that talks to the page as a browser does, and odd messages to it."""

from __future__ import annotations

import math
import random
import socket
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

PROTOCOL = f"viser-v{viser.__version__}"
#: Values that no control allows.
ODD = (None, math.nan, math.inf, -math.inf, [], [1.0, 2.0, 3.0], {}, {"a": 1}, b"\0", "x" * 2000)
ODD += ([[[[]]]], "abc\nTraceback", "1/7", 1e300, -1e300, 2**63, "true", 5, True)
CAMERA: dict[str, Any] = {"wxyz": (1.0, 0.0, 0.0, 0.0)}
CAMERA |= dict.fromkeys(("position", "look_at", "up_direction"), (0.0, 0.0, 1.0))
CAMERA |= {"fov": 1.0, "near": 0.1, "far": 9.0, "image_height": 99, "image_width": 99}
#: Frames that break the rules of WebSocket: reserved bits, an unknown kind, no mask, too long.
BROKEN = (b"\xf2\x80\0\0\0\0", b"\x83\x80\0\0\0\0", b"\x82\x01a", b"\x82\xff\x7f" + b"\xff" * 11)


def connected(address: str) -> ClientConnection:
    """A connection to the page."""
    place = address.replace("http", "ws")
    return connect(place, subprotocols=[PROTOCOL], max_size=None, compression=None)


def replay(connection: ClientConnection) -> list[dict[str, Any]]:
    """The messages that make the page what it is."""
    found = list[dict[str, Any]]()
    while not any(message["type"] == "ReplayDoneMessage" for message in found):
        raw = bytes(connection.recv(timeout=60))
        size, end = int.from_bytes(raw[:8], "little"), 16 + int.from_bytes(raw[8:16], "little")
        text = zstandard.ZstdDecompressor().decompress(raw[16:end], max_output_size=size)
        found += msgspec.msgpack.decode(text)["messages"]
    return found


def controls(connection: ClientConnection) -> dict[str, dict[str, Any]]:
    """The page's controls by their labels, with their `uuid`."""
    found = (message for message in replay(connection) if "value" in message)
    return {message["props"]["label"]: message for message in found}


def packed(kind: Any, **fields: Any) -> bytes:
    """A message of this type."""
    return msgspec.msgpack.encode({"type": kind, **fields})


def update(control: dict[str, Any], value: Any) -> bytes:
    """The message that changes a control."""
    return packed("GuiUpdateMessage", uuid=control["uuid"], updates={"value": value})


def odd_message(any_of: random.Random, controls: dict[str, dict[str, Any]]) -> bytes | str:
    """A message that the page cannot have sent."""
    one = any_of.choice(list(controls.values()))
    number = any_of.choice((math.nan, math.inf, "1", None, [1.0], True))
    field = any_of.choice(list(CAMERA))
    camera = CAMERA | {field: any_of.choice((None, "abc", (number,) * 3, {}, (1.0,) * 7, number))}
    drag = {"name": "/drag", "owner": "", "wxyz": CAMERA["wxyz"], "position": (1.0, 0.0, number)}
    name = any_of.choice(("max", "visible", "sync_cb", "uuid", "nothing", ""))
    kind = any_of.choice(("ShareUrlRequest", "GuiRemoveMessage", "nothing", "", 5, None, [], {}))
    whole = packed("ViewerCameraMessage", **CAMERA)
    return any_of.choice(
        (
            *(update(one, odd_value(any_of, one)) for _ in range(5)),
            packed("GuiUpdateMessage", uuid=one["uuid"], updates={name: number}),
            packed("GuiUpdateMessage", uuid=number, updates={"value": 1.0}),
            packed("GuiUpdateMessage", uuid=one["uuid"], updates=number),
            packed("GuiUpdateMessage", uuid=one["uuid"]),
            packed("ViewerCameraMessage", **camera),
            packed("ViewerCameraMessage", **CAMERA, more=1.0),
            packed("TransformControlsUpdateMessage", **drag),
            packed("TransformControlsUpdateMessage", **drag | {"name": number}),
            packed(kind, uuid=one["uuid"]),
            msgspec.msgpack.encode(any_of.choice(ODD)),
            whole[: any_of.randrange(len(whole))],
            any_of.randbytes(any_of.randrange(200)),
            b"\x91" * any_of.choice((10, 60_000)),
            b"\x81\x91\x01\x02",
            "a text",
        )
    )


def odd_value(any_of: random.Random, control: dict[str, Any]) -> Any:
    """A value that a control does not allow."""
    kind, now = control["type"], control.get("value")
    allowed: tuple[Any, ...] = ()
    if isinstance(now, str):
        allowed = ("true", "1/7", "abc\nTraceback") if kind == "GuiTextMessage" else ()
    elif isinstance(now, bool):
        allowed = (True,)
    elif kind == "GuiNumberMessage":
        allowed = (1e300, -1e300, 2**63, 5)
    else:
        allowed = (5,)
    return any_of.choice([odd for odd in ODD if not any(odd is one for one in allowed)])


def send(connection: ClientConnection, message: bytes | str) -> None:
    """Send a message; one of `BROKEN` as it is, whose answer is waited for."""
    if message not in BROKEN:
        connection.send(message)
        return
    connection.socket.sendall(message)
    with connection:
        try:
            while True:
                connection.recv(timeout=60)
        except ConnectionClosed:
            pass


def answer(address: str, headers: dict[str, str], upgrade: bool) -> int:
    """The status of the page's answer to a request with these headers."""
    host, port = address.removeprefix("http://").split(":")
    if upgrade:
        headers = headers | {"Upgrade": "websocket", "Connection": "Upgrade"}
        headers |= {"Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "A" * 22 + "=="}
    lines = ["GET / HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items()), "", ""]
    with socket.create_connection((host, int(port)), 60) as connection:
        connection.sendall("\r\n".join(lines).encode())
        return int(connection.recv(12, socket.MSG_WAITALL).split()[1])
