"""A headless Chromium by its debugging pipe: pages at given widths, in light and dark and on paper.

Tests skip where there is no Chromium.
"""

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")

WIDTHS = (390, 1100, 1280, 1600)
"""CSS pixels: a telephone, a small and a usual notebook, a desk."""

CUT_OFF = """(() => {
  document.querySelectorAll('details').forEach(one => { one.open = true; });
  const width = document.documentElement.clientWidth;
  const found = [];
  if (document.documentElement.scrollWidth > width) found.push(`page ${document.documentElement.scrollWidth}`);
  for (const one of document.querySelectorAll('body *')) {
    if (one.closest('svg') && one.tagName !== 'svg' || one.closest('.visually-hidden, .skip')) continue;
    const box = one.getBoundingClientRect();
    const name = `${one.tagName}#${one.id}.${one.getAttribute('class')} ${(one.textContent || '').slice(0, 40)}`;
    if (box.width && (box.right > width + 0.5 || box.left < -0.5)) found.push(`${name}: ${box.left} to ${box.right}`);
    if (one.clientWidth <= 1) continue;
    const hides = getComputedStyle(one).overflowX !== 'visible' && one.tagName !== 'PRE' && one.tagName !== 'svg';
    if (hides && one.scrollWidth > one.clientWidth + 1) found.push(`${name}: ${one.scrollWidth} in ${one.clientWidth}`);
  }
  return found.slice(0, 12);
})()"""
"""What of the page, unfolded, does not fit the window, and what a box hides until it is scrolled."""


def chromium() -> str | None:
    """The program, None where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


class Browser:
    """One tab."""

    def __init__(self) -> None:
        program = chromium()
        if program is None:
            raise FileNotFoundError("no Chromium on the path")
        self._profile = tempfile.TemporaryDirectory(prefix="bottomlock-chromium-", ignore_cleanup_errors=True)
        theirs_in, self._to = os.pipe()
        self._from, theirs_out = os.pipe()
        command = (
            f'exec "$0" --headless --no-sandbox --disable-gpu --disable-dev-shm-usage --hide-scrollbars '
            f'--no-first-run --remote-debugging-pipe --user-data-dir="$1" about:blank 3<&{theirs_in} 4>&{theirs_out}'
        )
        self._process = subprocess.Popen(
            ["bash", "-c", command, program, self._profile.name],
            pass_fds=(theirs_in, theirs_out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs_in)
        os.close(theirs_out)
        self._unread, self._sent, self._session = b"", 0, ""
        self._events: list[str] = []
        self._asked: list[str] = []
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self._call("Page.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._session = ""
            self._call("Browser.close")
        except (OSError, EOFError):
            self._process.kill()
        self._process.wait(timeout=20)
        os.close(self._to)
        os.close(self._from)
        self._profile.cleanup()

    def open(self, page: Path | str) -> None:
        """Loads a file or an address, and waits until it is there."""
        self._events.clear()
        self._call("Page.navigate", url=page if isinstance(page, str) else page.resolve(strict=True).as_uri())
        while "Page.loadEventFired" not in self._events:
            self._events.append(str(self._receive().get("method")))

    def size(self, width: int, height: int = 900) -> None:
        """The window, in CSS pixels."""
        settings = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self._call("Emulation.setDeviceMetricsOverride", **settings)

    def media(self, *, dark: bool = False) -> None:
        """The reader's colours."""
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self._call("Emulation.setEmulatedMedia", media="screen", features=features)

    def value(self, script: str) -> Any:  # noqa: ANN401 - any JSON value
        """What an expression of JavaScript is on the page."""
        done = self._call("Runtime.evaluate", expression=script, returnByValue=True)
        if "exceptionDetails" in done:
            raise ValueError(done["exceptionDetails"])
        return done["result"].get("value")

    def picture(self) -> bytes:
        """The window as a PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])

    def wait(self, script: str) -> None:
        """Returns once an expression of JavaScript is true.

        Raises:
            TimeoutError: after 30 s.
        """
        for _ in range(600):
            if self.value(script):
                return
            time.sleep(0.05)
        raise TimeoutError(script)

    def mouse(self, *places: tuple[float, float]) -> None:
        """Moves the pointer through places of the window, CSS pixels."""
        for x, y in places:
            self._call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def scripts(self, *, allowed: bool) -> None:
        """Whether the pages that are opened from now on may run scripts."""
        self._call("Emulation.setScriptExecutionDisabled", value=not allowed)

    def requests(self) -> list[str]:
        """Begins to keep the addresses that pages ask for; the list grows."""
        self._call("Network.enable")
        return self._asked

    def press(self, key: str) -> None:
        """Presses and releases a key that writes nothing, such as Tab or Enter."""
        code = {"Tab": 9, "Enter": 13, "ArrowLeft": 37, "ArrowRight": 39}[key]
        for kind in ("keyDown", "keyUp"):
            text = {"text": "\r"} if key == "Enter" and kind == "keyDown" else {}
            self._call(
                "Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code, **text
            )

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON value
        self._sent += 1
        message: dict[str, Any] = {"id": self._sent, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._sent:
                if "error" in answer:
                    raise ValueError(f"{method}: {answer['error']}")
                result: dict[str, Any] = answer["result"]
                return result
            self._events.append(str(answer.get("method")))

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._unread:
            part = os.read(self._from, 1 << 20)
            if not part:
                raise EOFError("Chromium ended")
            self._unread += part
        message, self._unread = self._unread.split(b"\0", 1)
        answer: dict[str, Any] = json.loads(message)
        if answer.get("method") == "Network.requestWillBeSent":
            self._asked.append(answer["params"]["request"]["url"])
        return answer
