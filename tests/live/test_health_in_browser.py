"""The health page in a real browser while the demonstration runs: what a person would read there."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.live.browser import CHROMIUM, Browser

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or chrome on the path")

WATCH = """
window.seen = [];
const see = () => {
  const words = ["state", "why", "ping", "beams"].map(id => document.getElementById(id).textContent);
  if (!seen.length || seen.at(-1)[0] !== words[0]) seen.push(words);
};
see();
new MutationObserver(see).observe(document.getElementById("state"), {childList: true});
0
"""


@contextlib.contextmanager
def demonstration() -> Iterator[subprocess.Popen[str]]:
    """`bottomlock live-demo`, killed at the end."""
    command = [sys.executable, "-m", "bottomlock", "live-demo", "--seconds", "20", "--speed", "2"]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        yield running
    finally:
        running.kill()
        running.wait()


def test_the_page_shows_the_states_as_they_come(tmp_path: Path) -> None:
    """OK, PARTIAL, COASTING, OK, then that there is no contact once the program has ended."""
    # The browser first: it takes seconds to start where the machine is busy, and the states do not wait.
    with Browser(tmp_path) as browser, demonstration() as running:
        assert running.stdout is not None
        url = ""
        while not url:
            found = re.search(r"health page (http://\S+)", running.stdout.readline())
            url = found[1] if found else ""
        browser.open(url)
        browser.value(WATCH)
        running.communicate(timeout=60)
        seen = json.loads(browser.value("JSON.stringify(seen)"))
        states = [words[0] for words in seen if words[0] not in {"…", "INITIALISING"}]
        assert states == ["OK", "PARTIAL", "COASTING", "OK"]
        whys = {words[0]: words[1] for words in seen}
        assert whys["PARTIAL"] == "beams determine 2 of 3 directions"
        assert whys["COASTING"].startswith("no usable beam for ")
        ends = "new Promise(done => setInterval(() => { if (seen.at(-1)[0] === 'NO CONTACT') done(1); }, 50))"
        browser.call("Runtime.evaluate", expression=ends, awaitPromise=True)
        assert browser.value("document.getElementById('link').textContent").startswith("no contact")
        assert browser.value("document.documentElement.scrollWidth <= window.innerWidth")
