"""What `bottomlock fly --sensors` writes is what `audit`, `fix` and `replay` read."""

import re
from pathlib import Path

import polars as pl
import pytest

from bottomlock.config.packaged import copy_packaged
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.io.beams import read_geometry
from bottomlock.simulation.build import geometry_of
from tests.cli.calls import succeeded

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def dive(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example of docs/replay.md, of half a minute."""
    folder = tmp_path_factory.mktemp("dive")
    path = copy_packaged("scenarios", "survey", folder / "survey.toml")
    text = re.sub(r"(?m)^duration_s = \S+", "duration_s = 30.0", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    succeeded("fly", path, "--sensors", "0", "--out", folder / "out")
    page = (root / "docs" / "replay.md").read_text(encoding="utf-8")
    (case,) = (block for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "simulated" in block)
    (folder / "out" / "case.toml").write_text(case, encoding="utf-8")
    return folder / "out"


def test_a_replay_ends_where_the_vehicle_did(dive: Path, tmp_path: Path) -> None:
    """Half a minute with a navigation-grade IMU and a compass of two degrees: metres, not tens of metres."""
    succeeded("replay", dive / "case.toml", "--out", tmp_path / "r")
    runs = pl.read_parquet(tmp_path / "r" / "runs.parquet").filter(method="tc")
    assert runs["position_final_m"].max() < 3.0  # type: ignore[operator]
    assert runs["velocity_rms_over_time_mps"].max() < 0.2  # type: ignore[operator]


@pytest.mark.parametrize(
    "dvl",
    [
        {"configuration": "+", "tilt_deg": 25.0, "mounting_yaw_deg": 45.0},
        {"configuration": "angles", "tilts_deg": [25.0, 25.0, 0.0], "azimuths_deg": [0.0, 120.0, 0.0]},
        {"configuration": "directions", "directions": [[0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]]},
    ],
)
def test_the_geometry_that_is_written_is_the_scenarios(dvl: dict[str, object], tmp_path: Path) -> None:
    from bottomlock.cli.simulate import geometry_file

    content = load_scenario("straight").model_dump(exclude_unset=True)
    content["dvl"] = {key: content["dvl"][key] for key in ("beam_noise_mps",)} | dvl
    scenario = Scenario.model_validate(content)
    (tmp_path / "dvl.toml").write_text(geometry_file(scenario.dvl), encoding="utf-8")
    assert (
        read_geometry(tmp_path / "dvl.toml").geometry.directions_p == geometry_of(scenario).directions_p
    ).all()
