"""`python tests/browser.py ADDRESS FILE` writes a picture of a page, by headless Chromium."""

from __future__ import annotations

import base64
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from websockets.sync.client import connect

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)


class Page:
    """A page that is open in the browser."""

    def __init__(self, devtools: Any) -> None:
        self._devtools = devtools

    def call(self, method: str, **values: Any) -> dict[str, Any]:
        """What a method of the DevTools protocol answers; empty where it fails."""
        self._devtools.send(json.dumps({"id": 1, "method": method, "params": values}))
        while (answer := json.loads(self._devtools.recv(timeout=60))).get("id") != 1:
            pass
        return answer.get("result", {})

    def picture(self) -> np.ndarray:
        """(height, width, 3) of 0 to 1, black where there is none yet."""
        answer = self.call("Page.captureScreenshot")
        if not answer:
            return np.zeros((800, 1200, 3))
        picture = Image.open(io.BytesIO(base64.b64decode(answer["data"])))
        return np.asarray(picture.convert("RGB")) / 255

    def value(self, script: str) -> Any:
        """What a line of JavaScript comes to."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True)
        return answer.get("result", {}).get("value")


@contextmanager
def browsing(address: str) -> Iterator[Page]:
    """The page in headless Chromium.

    Over its DevTools protocol, in real time: with --screenshot it takes the
    picture too early, and with a virtual clock it may wait for ever.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            *(str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1200,800"),
            *("--hide-scrollbars", f"--user-data-dir={profile}", "--remote-debugging-port=0"),
            address,
        ]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(command, **quiet, start_new_session=True)
        try:
            port = waited(lambda: (Path(profile) / "DevToolsActivePort").read_text().split()[0])
            with connect(waited(lambda: page_socket(port)), max_size=None) as devtools:
                yield Page(devtools)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def waited(ask: Callable[[], str]) -> str:
    """What `ask` answers as soon as it can, within a minute."""
    end = time.monotonic() + 60
    while True:
        try:
            return ask()
        except (OSError, LookupError):
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def page_socket(port: str) -> str:
    """Where the DevTools protocol of the browser's page is spoken."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=20) as answer:
        pages = [page for page in json.load(answer) if page["type"] == "page"]
    return pages[0]["webSocketDebuggerUrl"]


if __name__ == "__main__":
    with browsing(sys.argv[1]) as opened:
        time.sleep(20.0)  # Until viser's page has drawn all, and says that it draws in software.
        opened.value("document.querySelector('[class*=Notification] button')?.click()")
        time.sleep(3.0)
        Image.fromarray((255 * opened.picture()).astype(np.uint8)).save(sys.argv[2])
