"""A log to look into: the curves are those of the audit, and a log whose times go back keeps its figures alone."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bottomlock.audit.page import audit_files, plots_of
from bottomlock.audit.run import Audit
from tests.audit.synthetic import make_log
from tests.pages.test_plots import unpacked

OUTLIER = 600


def test_curves_are_those_of_the_audit() -> None:
    """Closure, readings and validity of a log with an outlier and a lost beam."""
    log = make_log(3)
    log.velocity_mps[OUTLIER, 1] += 2.0
    log.valid[100:200, 2] = False
    audit = Audit(log)
    plots = plots_of(audit)
    assert plots is not None
    assert not plots.has_map
    content = json.loads(plots.data)
    assert content["utc"] is False
    panels = content["views"][""]["panels"]
    (closure,) = panels[0]["curves"]
    np.testing.assert_allclose(unpacked(content, closure["v"]), 1e3 * audit.closures[0].values_mps, atol=0.01)
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
    audit = Audit(replace(log, time_ns=back))
    assert plots_of(audit) is None
    text = audit_files(audit)["audit.html"]
    assert isinstance(text, str)
    assert "<script" not in text
