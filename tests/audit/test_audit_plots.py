"""A log to look into: the curves are those of the audit, and a log whose times go back keeps its figures alone."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bottomlock.audit.page import audit_files, closure_table, plots_of
from bottomlock.audit.run import audit_log
from tests.audit.synthetic import make_log
from tests.browser import CUT_OFF, Browser, chromium
from tests.pages.test_plots import unpacked

OUTLIER = 600


def test_curves_are_those_of_the_audit() -> None:
    """Closure, readings and validity of a log with an outlier and a lost beam."""
    log = make_log(3)
    log.velocity_mps[OUTLIER, 1] += 2.0
    log.valid[100:200, 2] = False
    audit = audit_log(log)
    plots = plots_of(audit)
    assert plots is not None
    assert not plots.has_map
    content = json.loads(plots.data)
    assert content["utc"] is False
    panels = content["views"][""]["panels"]
    (closure,) = panels[0]["curves"]
    np.testing.assert_allclose(
        unpacked(content, closure["v"]), 1e3 * closure_table(audit)["closure_mps"].to_numpy(), atol=0.01
    )
    reading = panels[1]["curves"][1]
    np.testing.assert_allclose(unpacked(content, reading["v"]), log.velocity_mps[:, 1], atol=1e-4)
    assert np.isnan(unpacked(content, panels[1]["curves"][2]["v"])[100:200]).all()
    off = panels[3]["curves"][0]
    worst = int(np.argmax(unpacked(content, off["v"])))
    assert unpacked(content, off["t"])[worst] == pytest.approx(OUTLIER * 0.2)
    times = unpacked(content, panels[-1]["curves"][2]["t"])
    np.testing.assert_allclose(times[1:3], [20.0, 40.0])


@pytest.mark.usefixtures("undrawn")
def test_times_that_go_back_have_no_curves() -> None:
    log = make_log(4)
    back = log.time_ns.copy()
    back[500:] -= 10**12
    audit = audit_log(replace(log, time_ns=back))
    assert plots_of(audit) is None
    text = audit_files(audit)["audit.html"]
    assert isinstance(text, str)
    assert "<script" not in text


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
@pytest.mark.skipif(chromium() is None, reason="no Chromium")
def test_page_without_a_map_in_a_browser(tmp_path: Path) -> None:
    text = audit_files(audit_log(make_log(3)))["audit.html"]
    assert isinstance(text, str)
    page = tmp_path / "audit.html"
    page.write_text(text, encoding="utf-8")
    with Browser() as browser:
        browser.size(390)
        browser.open(page)
        browser.wait("document.getElementById('plots').dataset.ready === 'yes'")
        browser.value("document.querySelector('.canvas').focus()")
        browser.press("ArrowRight")
        told = str(browser.value("document.querySelector('.at').textContent"))
        assert told.endswith(" s")
        # The middle of 1200 pings at 5 Hz, and a two-hundredth of them on.
        assert float(told.removesuffix(" s")) == pytest.approx(119.9 + 239.8 / 200.0, abs=0.2)
        assert "beam 4\nvalid" in str(
            browser.value("[...document.querySelectorAll('.column .panel')].at(-1).innerText")
        ).replace(" valid", "\nvalid")
        assert browser.value("document.querySelector('.map')") is None
        assert browser.value(CUT_OFF) == []
