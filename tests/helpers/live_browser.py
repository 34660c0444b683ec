"""A headless Chromium that is driven by its DevTools protocol, for pages that need real time."""

import itertools
import json
import shutil
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import pytest
from websockets.sync.client import ClientConnection, connect

from navfw.recording.page_server import PageServer

ServerT = TypeVar("ServerT", bound=PageServer)


class LiveBrowser:
    """One tab; ``console`` has its errors and messages."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._numbers = itertools.count(1)
        self.console: list[str] = []
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """The answer to a command of the DevTools protocol."""
        number = next(self._numbers)
        self._connection.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message = json.loads(self._connection.recv(timeout=30))
            if message.get("method") in (
                "Runtime.exceptionThrown",
                "Runtime.consoleAPICalled",
                "Log.entryAdded",
            ):
                self.console.append(json.dumps(message["params"]))
            if message.get("id") == number:
                assert "error" not in message, message
                result: dict[str, Any] = message["result"]
                return result

    def open(self, url: str) -> None:
        """Go to ``url``."""
        self.call("Page.navigate", url=url)

    def evaluate(self, script: str) -> Any:
        """The value of an expression in the page; a promise is awaited."""
        asked = {"expression": script, "awaitPromise": True, "returnByValue": True}
        answer = self.call("Runtime.evaluate", **asked)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, script: str, patience: float = 20.0) -> Any:
        """The value of an expression, once it is true; one that fails is not."""
        script = f"(() => {{ try {{ return ({script}); }} catch {{ return false; }} }})()"
        until = time.monotonic() + patience
        while time.monotonic() < until:
            if value := self.evaluate(script):
                return value
            time.sleep(0.1)
        raise AssertionError(f"{script} stays false; console: {self.console}")

    def press(self, key: str, code: int, text: str = "") -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            words = {"text": text} if text and kind == "keyDown" else {}
            pressed = {"key": key, "code": key, "windowsVirtualKeyCode": code}
            self.call("Input.dispatchKeyEvent", type=kind, **pressed, **words)

    def resize(self, width: int, height: int) -> None:
        """Change the size of the page [CSS px]."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)


@contextmanager
def live_browser(profile: Path) -> Iterator[LiveBrowser]:
    """A browser with an empty ``profile``; skips without Chromium."""
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("no chromium; install the package chromium")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"]
    options += ["--host-resolver-rules=MAP rebound.test 127.0.0.1"]
    command = [program, *options, f"--user-data-dir={profile}", "about:blank"]
    with subprocess.Popen(  # noqa: S603 - options of our own
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            port_file, until = profile / "DevToolsActivePort", time.monotonic() + 30.0
            while not (port_file.exists() and port_file.read_text()):
                assert time.monotonic() < until, "Chromium does not start"
                time.sleep(0.05)
            port = port_file.read_text().split()[0]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
                tab = next(tab for tab in json.load(answer) if tab["type"] == "page")
            with connect(tab["webSocketDebuggerUrl"], max_size=None) as connection:
                yield LiveBrowser(connection)
        finally:
            process.terminate()


@contextmanager
def serving(server: ServerT, end: Callable[[ServerT], None]) -> Iterator[ServerT]:
    """The server at work in a thread, then ended by ``end``."""
    over = threading.Event()

    def work() -> None:
        while not over.is_set():
            server.serve(0.01)

    worker = threading.Thread(target=work)
    worker.start()
    try:
        yield server
    finally:
        over.set()
        worker.join()
        end(server)
