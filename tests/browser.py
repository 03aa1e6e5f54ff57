"""A headless Chromium, told over a pipe what to do: the DevTools protocol needs no library that way."""

from __future__ import annotations

import base64
import fcntl
import io
import json
import os
import shutil
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

NAMES = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable"
_FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars"),
    # WebGL on the processor.
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
    # Nothing but what the page asks for.
    *("--disable-background-networking", "--disable-component-update", "--disable-extensions", "--disable-sync"),
    "--remote-debugging-pipe",
)


def found_browser() -> str | None:
    return next((place for place in map(shutil.which, NAMES) if place), None)


class Browser:
    """One page in a browser of its own."""

    def __init__(self, program: str, profile: Path) -> None:
        # The browser reads from its file descriptor 3 and writes to 4; these stay clear of both.
        ours, theirs = [], []
        for reading_end in (1, 0):
            pipe = os.pipe()
            ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 5) for end in pipe]
            for end in pipe:
                os.close(end)
            ours.append(ends[reading_end])
            theirs.append(ends[1 - reading_end])
        self.writer, self.reader = os.fdopen(ours[0], "wb"), os.fdopen(ours[1], "rb")
        command = (program, *_FLAGS, f"--user-data-dir={profile}", "about:blank")
        self.process = subprocess.Popen(
            ("bash", "-c", f'exec "$@" 3<&{theirs[0]} 4>&{theirs[1]}', "bash", *command),
            pass_fds=theirs,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for end in theirs:
            os.close(end)
        self.number = 0
        self.session: str | None = None
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.session = None
        with suppress(OSError, EOFError):
            self.call("Browser.close")
        try:
            self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.writer.close()
        self.reader.close()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Answer to a command of the protocol."""
        self.number += 1
        message: dict[str, Any] = {"id": self.number, "method": method, "params": parameters}
        if self.session is not None:
            message["sessionId"] = self.session
        self.writer.write(json.dumps(message).encode() + b"\0")
        self.writer.flush()
        while True:
            answer = self._read()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                result: dict[str, Any] = answer["result"]
                return result
            self.events.append(answer)

    def _read(self) -> dict[str, Any]:
        text = bytearray()
        while not text.endswith(b"\0"):
            # At least a byte: pictures have a million.
            there = self.reader.peek()
            if not there:
                raise EOFError("the browser has ended")
            text += self.reader.read(there.find(b"\0") + 1 or len(there))
        del text[-1]
        answer: dict[str, Any] = json.loads(text)
        return answer

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression, waited for if it is a promise."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def wait(self, expression: str, seconds: float = 600) -> None:
        """Until an expression is true."""
        end = time.monotonic() + seconds
        while not self.evaluate(expression):
            if time.monotonic() > end:
                raise TimeoutError(f"never true: {expression}; {self.faults()}")
            time.sleep(0.02)

    def size(self, width: int, height: int, *, dark: bool = False) -> None:
        """The window, and what the user prefers."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def visit(self, page: Path, fragment: str = "") -> None:
        # By way of an empty page: another fragment alone would not load it anew.
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=page.as_uri() + fragment)
        self.wait("document.readyState === 'complete' && location.protocol === 'file:'")

    def drawn(self) -> None:
        """Wait until the relief is drawn."""
        self.wait("document.querySelector('#relief canvas').getAttribute('aria-busy') === 'false'")
        self.frame()

    def frame(self) -> None:
        self.evaluate("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(() => go(true))))")

    def picture(self, selector: str | None = None) -> NDArray[np.uint8]:
        """Pixels of the window, or of an element in it."""
        keywords: dict[str, Any] = {}
        if selector is not None:
            keywords["clip"] = {**self.box(selector), "scale": 1}
        data = base64.b64decode(self.call("Page.captureScreenshot", **keywords)["data"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def box(self, selector: str) -> dict[str, float]:
        """Where an element is in the window."""
        box: dict[str, float] = self.evaluate(
            f"(({{x, y, width, height}}) => ({{x, y, width, height}}))"
            f"(document.querySelector({json.dumps(selector)}).getBoundingClientRect())"
        )
        return box

    def mouse(self, kind: str, x: float, y: float, **keywords: Any) -> None:
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **keywords)

    def drag(self, selector: str, across: float, down: float) -> None:
        """Drag from the middle of an element."""
        box = self.box(selector)
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
        for step in range(1, 5):
            self.mouse("mouseMoved", x + across * step / 4, y + down * step / 4, button="left", buttons=1)
        self.mouse("mouseReleased", x + across, y + down, button="left", clickCount=1)
        self.frame()

    def click(self, selector: str, count: int = 1) -> None:
        box = self.box(selector)
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for clicks in range(1, count + 1):
            for kind in ("mousePressed", "mouseReleased"):
                self.mouse(kind, x, y, button="left", clickCount=clicks)
        self.frame()

    def press(self, key: str, text: str = "") -> None:
        code = {"code": key} if len(key) > 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=text, **code)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, **code)
        self.frame()

    def type(self, text: str) -> None:
        self.call("Input.insertText", text=text)

    def faults(self) -> list[str]:
        """What went wrong in the page so far: exceptions, messages of errors."""
        return [
            str(event["params"])
            for event in self.events
            if event.get("method") == "Runtime.exceptionThrown"
            or (event.get("method") == "Log.entryAdded" and event["params"]["entry"]["level"] == "error")
        ]

    def requested(self) -> list[str]:
        """Addresses that the page asked for so far."""
        return [
            event["params"]["request"]["url"]
            for event in self.events
            if event.get("method") == "Network.requestWillBeSent"
        ]
