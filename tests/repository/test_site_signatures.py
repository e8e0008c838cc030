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
        ("method", NAVIGATOR.load, "(data: bytes)", "Navigator"),
        (
            "function",
            bottomlock.normal_gravity_mps2,
            "(latitude_rad: float, depth_m: float=0.0)",
            "float",
        ),
        (
            "class",
            bottomlock.GpsModel,
            "(*, position_sd_m: Vector, velocity_sd_mps: Vector)",
            "",
        ),
        ("class", bottomlock.Shard, "(k: int, n: int)", ""),
        (
            "function",
            bottomlock.measurement_schedule,
            "(simulation: Simulation, truth: Truth, *, trajectory_key: int=0, first_run: int=0, runs: int=1)",
            "dict[str, Any]",
        ),
        ("method", bottomlock.Scenario.replace, "(changes: Mapping[str, Any])", "Self"),
        ("class", bottomlock.Scenario, "", ""),
    ],
)
def test_signatures_have_types(what: str, documented: object, parameters: str, returned: str) -> None:
    """Of the compiled kernel's parts, of classes of fields and of functions in Python."""
    assert signature_of(what, documented) == (parameters, returned)


def test_a_static_method_keeps_its_first_parameter() -> None:
    """And what has no signature is left alone."""
    found = signature_of("method", GEOMETRY.janus)
    assert found is not None
    assert found[0].startswith("(tilt_rad: float, *, configuration: JanusConfiguration='x', ")
    assert signature_of("exception", bottomlock.DataError) is None
    found = signature_of("class", bottomlock.Options)
    assert found is not None
    assert f"gate_probability: float = {bottomlock.Options().gate_probability}, " in found[0]
    assert "robust: Robust | None = Robust())" in found[0]
    late = signature_of("function", bottomlock.replay_log)
    assert late is not None
    assert "log: LogDict, start: InitialState | StateDict, *, sample_time_ns: ArrayLike" in late[0], (
        "without quotes"
    )
    assert late[1] == "ReplayDict"


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
