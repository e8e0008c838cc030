"""The page of the Python API: every public name is on it, and its signatures have the types of the sources."""

import re
from pathlib import Path

import pytest

import bottomlock
from tools.site_signatures import signature_of


def test_every_public_name_is_on_the_page(root: Path) -> None:
    page = (root / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"^\.\. \S+:: bottomlock\.(\w+)$", page, re.MULTILINE))
    assert shown == set(bottomlock.__all__)


@pytest.mark.parametrize(
    ("what", "documented", "parameters", "returned"),
    [
        (
            "method",
            bottomlock.Navigator.push_imu,
            "(time_ns: int, *, omega_p_radps: ArrayLike, force_p_mps2: ArrayLike)",
            "list[Report]",
        ),
        ("method", bottomlock.Scenario.replace, "(changes: Mapping[str, Any])", "Self"),
        ("class", bottomlock.Scenario, "", ""),
    ],
)
def test_signatures_have_types(what: str, documented: object, parameters: str, returned: str) -> None:
    """Of the compiled kernel's parts, of classes of fields, inherited ones too, and of functions in Python."""
    assert signature_of(what, documented) == (parameters, returned)
