"""A Chromium with a pointer, by the W3C's WebDriver protocol through chromedriver."""

from __future__ import annotations

import base64
import io
import json
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from PIL import Image

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader",
    "--use-gl=angle", "--use-angle=swiftshader", "--hide-scrollbars", "--window-size=1000,760",
)  # fmt: skip
PATIENCE = 120.0  # s


class Browser:
    """A page, a pointer, and eyes."""

    def __init__(self, url: str, session: str) -> None:
        self._url = f"{url}/session/{session}"

    def open(self, address: str) -> None:
        self._ask("url", {"url": address})

    def run(self, script: str) -> Any:
        """What the body of a function in the page returns."""
        return self._ask("execute/sync", {"script": script, "args": []})

    def wait(self, script: str, what: str) -> Any:
        """Waits until an expression is true."""
        end = time.monotonic() + PATIENCE
        while not (value := self.run(f"return {script}")):
            assert time.monotonic() < end, f"{what} did not happen"
            time.sleep(0.1)
        return value

    def resize(self, width: int, height: int) -> None:
        """The window's size, px, with what is around a page."""
        self._ask("window/rect", {"width": width, "height": height})

    def drag(self, *places: tuple[float, float]) -> None:
        """Presses at the first place, css px of the window, and lets go at the last."""
        moves = [_move(*places[0]), {"type": "pointerDown", "button": 0}]
        moves += [_move(*place, 120) for place in places[1:]]
        self._act([*moves, {"type": "pointerUp", "button": 0}])

    def double_click(self, place: tuple[float, float]) -> None:
        press = [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self._act([_move(*place), *press, *press])

    def picture(self) -> np.ndarray:
        """(H, W, 3) what the window shows."""
        data = base64.b64decode(self._ask("screenshot"))
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def _act(self, actions: list[dict[str, Any]]) -> None:
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
        self._ask("actions", {"actions": [{**mouse, "actions": actions}]})

    def _ask(self, what: str, body: dict[str, Any] | None = None) -> Any:
        return ask(f"{self._url}/{what}", body)


def _move(x: float, y: float, milliseconds: int = 0) -> dict[str, Any]:
    return {"type": "pointerMove", "x": round(x), "y": round(y), "duration": milliseconds}


def ask(url: str, body: dict[str, Any] | None = None, method: str | None = None) -> Any:
    """The answer of the driver."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        return json.load(answer)["value"]


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """A headless Chromium; skips where there is none with its driver."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    driver = shutil.which("chromedriver")
    if found is None or driver is None:
        pytest.skip("there is no Chromium with its driver (packages chromium, chromium-driver)")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    with subprocess.Popen([driver, f"--port={port}"], stdout=subprocess.DEVNULL) as process:
        try:
            session = _session(url, found)
            try:
                yield Browser(url, session)
            finally:  # else Chromium outlives its driver
                ask(f"{url}/session/{session}", method="DELETE")
        finally:
            process.terminate()


def _session(url: str, browser: str) -> str:
    chrome = {"binary": browser, "args": list(OPTIONS)}
    wanted = {"capabilities": {"alwaysMatch": {"goog:chromeOptions": chrome}}}
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return ask(f"{url}/session", wanted)["sessionId"]
        except OSError:
            assert time.monotonic() < end, "the driver does not answer"
            time.sleep(0.2)
