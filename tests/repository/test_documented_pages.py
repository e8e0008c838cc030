"""The Python of the pages runs as it stands."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("page", "printed"),
    [
        (
            "notebooks.md",
            [
                "<Scenario straight: straight at 2 m/s for 20 s, ",
                "<Results: 4 runs of straight; ins, tc",
                "\nTrue\n",
                "<Replay of robosub_night2: trusted partly; tc, dead_reckoning; recorded, lost_34, outage>",
            ],
        ),
        ("compare.md", ["30.0 0.01"]),
        # Their own assertions are the test.
        ("event_loop.md", []),
        ("own_trajectory.md", []),
    ],
)
def test_the_page_runs(
    root: Path,
    page: str,
    printed: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From the root of the repository, where its paths begin; and prints what its comments say."""
    monkeypatch.chdir(root)
    plt.switch_backend("agg")
    text = (root / "docs" / page).read_text(encoding="utf-8")
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(code, page, "exec"), {"__name__": page})
    plt.close("all")
    shown = capsys.readouterr().out
    for words in printed:
        assert words in shown
