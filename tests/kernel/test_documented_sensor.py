"""The sensor that docs/sensors.md shows whole is the one of the kernel."""

import re
from pathlib import Path


def test_the_page_shows_the_smallest_sensor(root: Path) -> None:
    """Code and registry line, letter for letter."""
    page = (root / "docs" / "sensors.md").read_text(encoding="utf-8")
    shown, line = re.findall(r"```rust\n(.*?)```", page, re.DOTALL)
    aiding = root / "crates" / "bottomlock" / "src" / "aiding"
    assert (aiding / "velocity.rs").read_text(encoding="utf-8").endswith(shown)
    assert line in (aiding / "registry.rs").read_text(encoding="utf-8")
