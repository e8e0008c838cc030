"""A name that is not known gets the nearest one proposed, wherever a name is given."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.campaign.engine import check_engine
from bottomlock.config.instrument_grades import grade_of
from bottomlock.config.packaged import copy_packaged
from bottomlock.encoders.registry import format_named
from bottomlock.errors import BottomlockError
from bottomlock.plant import load_vehicle
from bottomlock.studies.cases import aided_by
from bottomlock.support.nearest import did_you_mean, nearest

PACKAGE = Path(bottomlock.__file__).parent


@pytest.mark.parametrize(
    ("name", "known", "found"),
    [
        ("TC", ["tc", "vb"], "tc"),
        ("tcc", ["tc", "vb"], "tc"),
        ("weak-sway", ["weak_sway", "nsv"], "weak_sway"),
        ("Survey", ["Survey_2", "survey"], "survey"),
        ("qqq", ["tc", "vb"], None),
        ("", ["tc"], None),
        ("tc", [], None),
    ],
)
def test_the_nearest_name(name: str, known: list[str], found: str | None) -> None:
    """Letters of any case are alike; nothing is proposed for what is like no name."""
    assert nearest(name, known) == found
    assert did_you_mean(name, known, "!") == ("!" if found is None else f", did you mean '{found}'?")


def _navigator(method: Any) -> object:  # noqa: ANN401 - a wrong one
    scenario = bottomlock.load_scenario("straight")
    start = bottomlock.InitialState(
        time_ns=0, position_t_m=[0, 0, 0], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[0, 0, 0]
    )
    model, options = scenario.kernel_model(9.8), scenario.kernel_options()
    return bottomlock.Navigator(bottomlock.BeamGeometry.janus(0.35), model, options, start, method=method)


@pytest.mark.parametrize(
    ("call", "proposed"),
    [
        (lambda: bottomlock.load_scenario("Strait"), "straight"),
        (lambda: copy_packaged("scenarios", "strait", Path("x.toml")), "straight"),
        (lambda: bottomlock.read_geometry("waterlinked_a5"), "waterlinked_a50"),
        (lambda: load_vehicle("remus_100"), "remus100"),
        (lambda: grade_of("imu", "autopilt"), "autopilot"),
        (lambda: bottomlock.load_scenario("straight").with_overrides(methods=["TC"]), "tc"),
        (lambda: _navigator("weak-sway"), "weak_sway"),
        (lambda: bottomlock.solve_velocity(
            bottomlock.BeamGeometry.janus(0.35), np.zeros((1, 4)), np.ones((1, 4), bool),
            method="nullified", beam_sd_mps=0.1,  # type: ignore[arg-type] # the mistake
        ), "nullified_sway"),
        (lambda: check_engine("Dask"), "dask"),
        (lambda: format_named("nucleos"), "nucleus"),
        (lambda: bottomlock.read_recording("x", format="pd-0"), "pd0"),
        (lambda: aided_by(bottomlock.load_scenario("straight"), ("dept",)), "depth"),
    ],
)  # fmt: skip
def test_every_kind_of_name(call: Callable[[], object], proposed: str) -> None:
    """Scenarios, geometries, vehicles, grades, methods, formats, engines, sensors, keys."""
    with pytest.raises(BottomlockError, match=f"did you mean '{re.escape(proposed)}'"):
        call()


def test_one_place_decides() -> None:
    """The rule stands in one file, which the compiled kernel asks, too."""
    found = [path.name for path in PACKAGE.rglob("*.py") if "difflib" in path.read_text(encoding="utf-8")]
    assert found == ["nearest.py"]
