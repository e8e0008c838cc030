"""The set-up page in a real browser: a mistake at its field, a saved form, live started, its state, stopped."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from typing import Any

import pytest

from tests.browser import Browser, chromium
from tests.live.processes import Instruments, free_port
from tests.setup.test_server import PATIENCE_S, health_port, served, shown

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")
pytest.importorskip("mcap", reason="needs mcap (extra live)")
pytestmark = pytest.mark.skipif(chromium() is None, reason="no chromium or chrome on the path")
__all__ = ["health_port"]


def until(browser: Browser, expression: str) -> Any:  # noqa: ANN401 - whatever the page has
    """The value of an expression once it is true."""
    end_s = time.monotonic() + PATIENCE_S
    while not (value := browser.value(expression)):
        assert time.monotonic() < end_s, f"{expression}: {browser.value('document.body.innerText')}"
        time.sleep(0.1)
    return value


def typed(browser: Browser, **values: str) -> None:
    """Fills fields as a person would, so that the page hears of it."""
    for name, value in values.items():
        browser.value(
            f"{{ const field = document.forms[0].elements.{name}; field.value = {value!r}; "
            "field.dispatchEvent(new Event('input', {bubbles: true})); }; 0"
        )


@pytest.mark.usefixtures("health_port")
def test_a_person_sets_it_up(tmp_path: Path) -> None:
    """Mistakes first; then OK with numbers; two widths and both colour schemes without a bar to scroll sideways."""
    with Browser() as browser, Instruments(200.0) as instruments, served(tmp_path / "vehicle") as port:
        browser.open(f"http://127.0.0.1:{port}/")
        until(browser, "document.getElementById('state').textContent === 'STOPPED'")
        typed(browser, mode="navigation", address="192.168.2.95", mounting_yaw_deg="−4,5")
        browser.value("document.getElementById('start').click(); 0")
        told = until(browser, "document.getElementById('fault-address')?.textContent")
        assert "cannot be a source" in told
        assert browser.value("document.activeElement.name") == "address"
        assert "missing" in browser.value("document.getElementById('fault-latitude_deg').textContent")
        assert browser.value("document.getElementById('fault-mounting_yaw_deg')") is None
        assert shown(port)["configuration"] is None
        typed(
            browser,
            mode="velocity",
            address=f"tcp:127.0.0.1:{instruments.dvl_port}",
            to=f"udpout:127.0.0.1:{free_port(socket.SOCK_DGRAM)}",
        )
        assert browser.value("document.getElementById('navigation').offsetParent === null")
        browser.value("document.getElementById('start').click(); 0")
        until(browser, "document.getElementById('state').textContent === 'OK'")
        until(
            browser,
            "/Beams 1 2 3 4.*forward \\d.*Sent: \\d+ messages/.test(document.getElementById('measured').textContent)",
        )
        assert shown(port)["form"]["mounting_yaw_deg"] == -4.5
        until(browser, "document.querySelector('#logs a')?.href.endsWith('.mcap')")
        for width in (390, 1280):
            browser.size(width)
            assert browser.value("document.documentElement.scrollWidth <= window.innerWidth"), width
        browser.value("document.getElementById('stop').click(); 0")
        until(browser, "document.getElementById('state').textContent === 'STOPPED'")
        assert browser.value("document.getElementById('measured').textContent") == ""
