"""The page of the Python API: every public name is on it, and its signatures have the types of the sources."""

import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import bottomlock
from tools.site_signatures import signature_of, stub, type_of_property

NAVIGATOR, GEOMETRY = bottomlock.Navigator, bottomlock.BeamGeometry


def test_every_public_name_is_on_the_page(root: Path) -> None:
    page = (root / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"^\.\. \S+:: bottomlock\.(\w+)$", page, re.MULTILINE))
    assert shown == set(bottomlock.__all__)


@pytest.mark.parametrize(
    ("what", "documented", "parameters", "returned"),
    [
        (
            "method",
            NAVIGATOR.push_imu,
            "(time_ns: int, *, omega_p_radps: ArrayLike, force_p_mps2: ArrayLike)",
            "list[Report]",
        ),
        ("method", bottomlock.Scenario.replace, "(changes: Mapping[str, Any])", "Self"),
        ("class", bottomlock.Scenario, "", ""),
        (
            "class",
            bottomlock.Results,
            (
                "(manifest: dict[str, Any], runs: pl.DataFrame, ensemble: pl.DataFrame, consistency: pl.DataFrame, "
                "choices: pl.DataFrame | None, paths: pl.DataFrame | None, folder: Path | None, "
                "samples_in_memory: pl.DataFrame | None = None)"
            ),
            "",
        ),
    ],
)
def test_signatures_have_types(what: str, documented: object, parameters: str, returned: str) -> None:
    """Of the compiled kernel's parts, of classes of fields, inherited ones too, and of functions in Python."""
    assert signature_of(what, documented) == (parameters, returned)


@pytest.mark.parametrize("owner", [NAVIGATOR, GEOMETRY])
def test_no_part_of_the_kernel_is_without_types(owner: Any) -> None:  # noqa: ANN401 - a class of the kernel
    """Each public method and property has its line in the stub, as the page needs it."""
    for name, part in vars(owner).items():
        if name.startswith("_"):
            continue
        if inspect.isgetsetdescriptor(part):
            assert type_of_property(part) in {"int", "float", "NDArray[np.float64]"}
        else:
            found = signature_of("method", getattr(owner, name))
            assert found is not None
            assert found[1], name
    assert f"{owner.__name__}.__new__" in stub()
