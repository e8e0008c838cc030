"""The examples run as they are shown, and draw what their pages show."""

import runpy
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
# Seconds of a core each; a page that fails at all fails the build of the site, too.
LONG = {"replay_in_a_notebook", "my_a50_log", "audit_mis_mounted", "lost_bottom", "why_vb_is_overconfident"}


@pytest.mark.parametrize(
    "script",
    [pytest.param(one, marks=pytest.mark.long if one.stem in LONG else (), id=one.stem) for one in SCRIPTS],
)
def test_an_example_runs_and_draws(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []

    def show() -> None:
        drawn.extend(plt.get_fignums())
        plt.close("all")

    monkeypatch.setattr(plt, "show", show)
    runpy.run_path(str(script))
    assert drawn
