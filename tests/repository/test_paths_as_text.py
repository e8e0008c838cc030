"""Paths may be given as text, wherever Python takes one; scenarios and DVLs by name or file, too."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock import kernel
from bottomlock.campaign.build import scenarios_of
from bottomlock.errors import ScenarioError
from tests.analytic import batch_along
from tests.campaign.small_campaign import same_bits, short


def test_a_scenario_by_name_and_by_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One or several, loaded or named, in folders named by text or by path: the same campaign."""
    monkeypatch.chdir(tmp_path)
    loaded, file = short(2), tmp_path / "short.toml"
    text = (Path(bottomlock.__file__).parent / "config" / "scenarios" / "straight.toml").read_text("utf-8")
    file.write_text(
        text.replace("duration_s = 250.0", f"duration_s = {loaded.trajectory.duration_s}"), "utf-8"
    )
    ours = bottomlock.load_scenario(file).with_overrides(runs=2, methods=["tc"])
    assert bottomlock.load_scenario(ours) is ours
    given = (ours, [ours], (ours,), iter([ours]))
    assert [scenarios_of(one) for one in given] == [[ours]] * 4
    names = [one.name for one in scenarios_of(["slope", file, str(file)])]
    assert names == ["slope", "straight", "straight"]
    bottomlock.run_campaign(loaded, "one", threads=1)
    bottomlock.run_campaign([loaded], tmp_path / "list", threads=1)
    same_bits(tmp_path / "one", tmp_path / "list")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([3], "the scenario is 3, expected a Scenario, a packaged name or a path"),
        (7, "scenarios is 7, expected a list such as"),
        ([], "expected scenarios of different names"),
    ],
)
def test_what_is_no_scenario(given: Any, message: str, tmp_path: Path) -> None:  # noqa: ANN401 - a wrong one
    """Nothing is written."""
    with pytest.raises(ScenarioError, match=message):
        bottomlock.run_campaign(given, tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_a_dvl_by_name_and_by_file(root: Path, tmp_path: Path) -> None:
    """`solve_velocity` and its like take name, file, what was read, or the beams; `read_beams` all but the last."""
    own = tmp_path / "own.toml"
    packaged = root / "python" / "bottomlock" / "config" / "geometries" / "waterlinked_a50.toml"
    own.write_text(packaged.read_text("utf-8"), "utf-8")
    read = bottomlock.read_geometry("waterlinked_a50")
    beams = read.geometry.beam_velocities([[1.0, 0.2, 0.0]])
    given = ("waterlinked_a50", str(own), own, read, read.geometry)
    for geometry in given:
        fixes = bottomlock.solve_velocity(
            geometry, beams, np.ones((1, 4), dtype=bool), method="lc", beam_sd_mps=0.02
        )
        np.testing.assert_allclose(fixes.velocity_p_mps, [[1.0, 0.2, 0.0]], atol=1e-9)
    batch = batch_along(2.0)
    theirs = kernel.run_batch(**(batch | {"geometry": read.geometry}), methods=["tc"], runs=1, threads=1)
    ours = bottomlock.run_batch(**(batch | {"geometry": own}), methods=["tc"], runs=1, threads=1)
    assert np.array_equal(ours["error"], theirs["error"])
    aiding = {"beams": np.ones(4, dtype=bool), "depth": True}
    analysed = [
        kernel.covariance_history(dvl, batch["truth"], batch["assumed"], aiding)
        for dvl in (own, read.geometry)
    ]
    assert np.array_equal(analysed[0]["covariance"], analysed[1]["covariance"])
    log = tmp_path / "log.csv"
    log.write_text("t,beam1_mps,beam2_mps,beam3_mps,beam4_mps\n1,0.1,0.2,0.3,\n2,0.1,0.2,0.3,0.4\n", "utf-8")
    mapped = tmp_path / "mapped.toml"
    columns = '[columns]\ntime = "t"\ntime_unit = "s"\nlost_when_empty = true\n'
    mapped.write_text(f"{own.read_text('utf-8')}\n{columns}", "utf-8")
    for dvl in (mapped, str(mapped), bottomlock.read_geometry(mapped)):
        assert bottomlock.read_beams(log, geometry=dvl).valid.sum(axis=1).tolist() == [3, 4]
    both: dict[str, Any] = {"beams": 4, "geometry": mapped}
    for wrong in ({}, both):
        with pytest.raises(TypeError, match=r"either the geometry of the DVL, .* or the number of beams"):
            bottomlock.read_beams(log, **wrong)
