"""What docs/settings.md shows whole is the code whose types are checked, and it runs."""

import re
import runpy
from pathlib import Path

import numpy as np

EXAMPLE = Path(__file__).with_name("documented_navigator.py")


def test_the_page_shows_what_is_checked(root: Path) -> None:
    page = (root / "docs" / "settings.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    checked = EXAMPLE.read_text(encoding="utf-8").split("# The documented example begins.\n")[1]
    assert shown == checked


def test_the_example_navigates() -> None:
    """Two beams, ten pings: surge as it was."""
    names = runpy.run_path(str(EXAMPLE))
    np.testing.assert_allclose(names["velocity_p_mps"], [2.0, 0.0, 0.0], atol=0.1)
