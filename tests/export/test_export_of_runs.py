"""Exports of a campaign's run: the truth and the estimates, against the campaign's own tables and by other programs."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import polars as pl
import pytest
from mcap.reader import make_reader

from bottomlock.campaign.build import BuiltScenario, build_simulations
from bottomlock.campaign.chunk import ChunkResult, run_chunk
from bottomlock.campaign.manifest import identity_of
from bottomlock.campaign.partition import Chunk
from bottomlock.campaign.run import run_campaign
from bottomlock.campaign.run_again import scenario_of
from bottomlock.config.scenario import load_scenario, packaged_scenarios
from bottomlock.errors import DataError, ScenarioError
from bottomlock.export.campaign import export_campaign
from bottomlock.export.formats import FORMATS
from tests.campaign.small_campaign import short
from tests.cli.calls import command
from tests.export.evo_command import ape
from tests.export.plotjuggler import curves, series
from tests.oracle.rotations import log_rotation, matrix_from_quaternion

RUN = 3
KML = {"kml": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
GPX = {"gpx": "http://www.topografix.com/GPX/1/1"}
AXES = ("north", "east", "down")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run 3 of a campaign of five, in every format."""
    out = tmp_path_factory.mktemp("runs") / "out"
    run_campaign([short()], out)
    export_campaign(out, FORMATS, run=RUN)
    return out


def recorded(folder: Path, method: str, trajectory: str = "straight") -> pl.DataFrame:
    """The samples of the run in the campaign's own files."""
    samples = pl.concat(
        pl.read_parquet(path) for path in sorted(folder.glob(f"chunks/{trajectory}/samples-*.parquet"))
    )
    return samples.filter((pl.col("run") == RUN) & (pl.col("method") == method))


def errors(folder: Path, true: str, mine: str) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """(n, 3) position errors north, east, down, m, and misalignments, rad, true minus estimate, of two TUM files."""
    tables = [np.loadtxt(folder / f"export/{name}.tum") for name in (true, mine)]
    np.testing.assert_array_equal(tables[0][:, 0], tables[1][:, 0])
    enu = tables[0][:, 1:4] - tables[1][:, 1:4]
    R, Q = (np.array([matrix_from_quaternion(np.roll(q, 1)) for q in table[:, 4:]]) for table in tables)
    vector = np.array([log_rotation(one) for one in R @ Q.transpose(0, 2, 1)])
    return enu[:, [1, 0, 2]] * [1, 1, -1], vector[:, [1, 0, 2]] * [1, 1, -1]


@pytest.mark.parametrize("method", ["ins", "lc", "tc"])
def test_truth_less_estimate_is_the_error_of_the_tables(folder: Path, method: str) -> None:
    samples = recorded(folder, method)
    position, misalignment = errors(folder, "straight_run3_truth", f"straight_run3_{method}")
    expected = samples.select(f"err_position_{axis}_m" for axis in AXES).to_numpy().astype(np.float64)
    np.testing.assert_allclose(position, expected, rtol=0, atol=1e-12)
    expected = samples.select(f"err_misalignment_{axis}_rad" for axis in AXES).to_numpy().astype(np.float64)
    np.testing.assert_allclose(misalignment, expected, rtol=0, atol=1e-12)
    assert np.linalg.norm(misalignment, axis=1).max() > 1e-3


def test_the_truth_is_that_of_the_campaign_at_the_times_of_the_samples(folder: Path) -> None:
    table = np.loadtxt(folder / "export/straight_run3_truth.tum")
    path = pl.read_parquet(folder / "truth.parquet").filter(pl.col("time_ns") > 0)
    np.testing.assert_array_equal(table[:, 0] * 1e9, path["time_ns"].to_numpy())
    np.testing.assert_array_equal(
        table[:, 1:4], path.select("east_m", "north_m", -pl.col("depth_m")).to_numpy()
    )


def test_evo_finds_the_errors_of_the_tables(folder: Path, tmp_path: Path) -> None:
    """Positions and attitudes of the TUM files by somebody else's program."""
    true, mine = (folder / f"export/straight_run3_{name}.tum" for name in ("truth", "tc"))
    samples = recorded(folder, "tc").with_columns(pl.col(pl.Float32).cast(pl.Float64))
    for relation, quantity, unit in (("trans_part", "position", "m"), ("angle_rad", "misalignment", "rad")):
        squares = sum(samples[f"err_{quantity}_{axis}_{unit}"] ** 2 for axis in AXES)
        expected = np.sqrt(np.mean(np.asarray(squares)))
        np.testing.assert_allclose(ape(true, mine, tmp_path, relation), expected, rtol=1e-8)


def test_csv_has_the_bits_of_the_tables_and_the_beams(folder: Path) -> None:
    with (folder / "export/straight_run3_tc.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    samples = recorded(folder, "tc")
    for name in samples.columns[3:]:
        expected = samples[name].to_list()
        read = [
            np.float32(row[name]) if samples[name].dtype == pl.Float32 else int(row[name]) for row in rows
        ]
        assert read == expected, name
    assert {row["utc"] for row in rows} == {""}  # a simulation has no date
    assert {tuple(row[f"beam{k + 1}_valid"] for k in range(4)) for row in rows} == {
        ("true", "true", "false", "false")
    }
    assert {row["beams_valid"] for row in rows} == {"2"}


def test_places_start_from_the_origin_of_the_scenario_and_have_no_date(folder: Path) -> None:
    """A degree of latitude at 32.8° is 110 907 m, one of longitude 93 658 m (WGS 84, by its radii of curvature)."""
    environment = load_scenario("straight").environment
    root = ET.parse(folder / "export/tracks.gpx").getroot()
    names = [f"straight_run3_{name}" for name in ("ins", "lc", "tc", "truth")]
    assert [one.text for one in root.findall("gpx:trk/gpx:name", GPX)] == names
    assert root.find(".//gpx:time", GPX) is None
    table = np.loadtxt(folder / "export/straight_run3_tc.tum")
    track = root.findall("gpx:trk", GPX)[2]
    points = np.array(
        [[float(one.get("lat", "")), float(one.get("lon", "")), float(one.findtext("gpx:ele", "", GPX))]
         for one in track.findall(".//gpx:trkpt", GPX)]
    )  # fmt: skip
    north_m = (points[:, 0] - environment.latitude_deg) * 110_907.0
    east_m = (points[:, 1] - environment.longitude_deg) * 93_658.0
    np.testing.assert_allclose(north_m, table[:, 2], atol=2e-3)
    np.testing.assert_allclose(east_m, table[:, 1], atol=2e-3)
    np.testing.assert_allclose(points[:, 2], table[:, 3], atol=1e-4)
    kml = ET.parse(folder / "export/tracks.kml").getroot()
    assert kml.find(".//gx:Track", KML) is None
    words = kml.findtext(".//kml:description", "", KML)
    assert f"origin latitude {environment.latitude_deg:g}°, longitude {environment.longitude_deg:g}°" in words
    assert "no date" in words


def test_gpxpy_and_fastkml_read_the_tracks(folder: Path) -> None:
    gpxpy = pytest.importorskip("gpxpy", reason="gpxpy is not installed: pip install gpxpy")
    kml = pytest.importorskip("fastkml", reason="fastkml is not installed: pip install fastkml")
    features = json.loads((folder / "export/tracks.geojson").read_text("utf-8"))["features"]
    expected = [one["geometry"]["coordinates"] for one in features]
    tracks = gpxpy.parse((folder / "export/tracks.gpx").read_text("utf-8")).tracks
    assert [
        [[p.longitude, p.latitude, p.elevation] for p in one.segments[0].points] for one in tracks
    ] == expected
    marks = list(kml.utils.find_all(kml.KML.parse(folder / "export/tracks.kml"), of_type=kml.Placemark))
    assert [[list(place) for place in mark.geometry.coords] for mark in marks] == expected


def test_mcap_has_truth_estimates_and_beams_and_both_layouts_name_them(folder: Path) -> None:
    path = folder / "export/tracks.mcap"
    with path.open("rb") as file:
        messages = [
            (schema.name, channel.topic, json.loads(message.data))
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages()
            if schema is not None
        ]
    topics = {topic: name for name, topic, _ in messages}
    assert topics["/straight_run3_truth/estimate"] == "bottomlock.Reference"
    assert topics["/straight_run3_tc/estimate"] == "bottomlock.Estimate"
    sigma = [
        one["sd_position_north_m"] for _, topic, one in messages if topic == "/straight_run3_tc/estimate"
    ]
    assert sigma == recorded(folder, "tc")["sd_position_north_m"].to_list()
    beams = [one for _, topic, one in messages if topic == "/straight_run3/beams"]
    assert len(beams) == 10  # one a second
    assert {one["beams_valid"] for one in beams} == {2}
    names = series(path)
    shown = curves(folder / "export/plotjuggler_layout.xml")
    assert len(shown) > 12
    assert [name for name in shown if name not in names] == []
    panels = json.loads((folder / "export/foxglove_layout.json").read_text("utf-8"))["configById"]
    paths = [one["value"].replace(".", "/") for panel in panels.values() for one in panel.get("paths", [])]
    assert len(paths) > 8
    assert [name for name in paths if name not in names] == []
    assert set(panels["map!tracks"]["topicColors"]) <= set(topics)


@pytest.mark.parametrize("pilot", ["own", "tc"])
def test_vehicles_that_an_estimate_steers_have_their_own_truth(tmp_path: Path, pilot: str) -> None:
    """With pilot "own" a vehicle a method, otherwise one; errors are those of the tables."""
    scenario = load_scenario("survey").with_overrides(runs=4, methods=["tc", "nsv"])
    run_campaign(
        [scenario.with_trajectory(duration_s=30.0, feedback="estimate", pilot=pilot)], tmp_path / "out"
    )
    export_campaign(tmp_path / "out", ["tum", "mcap"], run=RUN)
    names = {path.stem for path in (tmp_path / "out/export").glob("*.tum")}
    ends = {"truth_tc", "truth_nsv"} if pilot == "own" else {"truth"}
    assert names == {f"survey_run3_{end}" for end in ends | {"tc", "nsv"}}
    for method in ("tc", "nsv"):
        true = f"survey_run3_truth_{method}" if pilot == "own" else "survey_run3_truth"
        position, _ = errors(tmp_path / "out", true, f"survey_run3_{method}")
        samples = recorded(tmp_path / "out", method, "survey")
        expected = samples.select(f"err_position_{axis}_m" for axis in AXES).to_numpy()
        np.testing.assert_allclose(position, expected, rtol=0, atol=1e-12)
    beams = {name.split("/")[1] for name in series(tmp_path / "out/export/tracks.mcap") if "/beams/" in name}
    own = {"survey_run3_vehicle_of_tc", "survey_run3_vehicle_of_nsv"}
    assert beams == (own if pilot == "own" else {"survey_run3"})
    if pilot == "own":
        tables = [np.loadtxt(tmp_path / f"out/export/survey_run3_{end}.tum") for end in sorted(ends)]
        assert np.abs(tables[0] - tables[1]).max() > 1e-3


def test_dead_reckoning_and_several_trajectories(tmp_path: Path) -> None:
    """A method that claims no NEES, and a method that one trajectory alone has run."""
    one, two = short(name="lawn_mower"), load_scenario("survey").with_overrides(runs=5)
    two = two.with_overrides(methods=["tc", "dead_reckoning"]).with_trajectory(duration_s=10.0)
    run_campaign([one, two], tmp_path / "out")
    export_campaign(tmp_path / "out", ["csv", "mcap", "tum"], run=RUN, methods=["dead_reckoning"])
    names = {path.stem for path in (tmp_path / "out/export").glob("*.csv")}
    assert names == {"survey_run3_dead_reckoning", "survey_run3_truth"}
    position, misalignment = errors(tmp_path / "out", "survey_run3_truth", "survey_run3_dead_reckoning")
    samples = recorded(tmp_path / "out", "dead_reckoning", "survey")
    np.testing.assert_allclose(
        misalignment, samples.select(f"err_misalignment_{axis}_rad" for axis in AXES).to_numpy(), atol=1e-12
    )
    assert np.abs(position).max() > 0.0
    with pytest.raises(
        ScenarioError, match="'vb': is not in the campaign, expected of ins, lc, tc, dead_reckoning"
    ):
        export_campaign(tmp_path / "out", ["csv"], methods=["vb"])


def test_a_run_that_comes_out_otherwise_is_not_exported(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(folder, tmp_path / "out")

    def other(built: BuiltScenario, chunk: Chunk, **settings: Any) -> ChunkResult:  # noqa: ANN401
        result = run_chunk(built, chunk, **settings)
        return replace(result, samples=result.samples.with_columns(pl.col("err_position_north_m") + 1e-3))

    monkeypatch.setattr("bottomlock.campaign.run_again.run_chunk", other)
    with pytest.raises(DataError, match="run 3 of straight comes out otherwise than in its tables"):
        export_campaign(tmp_path / "out", ["kml"], run=RUN)


@pytest.mark.parametrize("name", sorted(packaged_scenarios()))
def test_a_manifest_states_the_scenario_whole(name: str) -> None:
    """What a manifest holds of a packaged scenario is a scenario of the same hash."""
    scenario = load_scenario(name)
    again = scenario_of(json.loads(json.dumps(scenario.model_dump(mode="json"))), Path("manifest.json"))
    assert identity_of(build_simulations([again])) == identity_of(build_simulations([scenario]))


def test_a_path_that_has_changed_since_is_named(tmp_path: Path, root: Path) -> None:
    """A trajectory from a file has the place of its file, and must be that of the campaign."""
    shutil.copytree(root / "examples/own_trajectory", tmp_path / "path")
    scenario = str(tmp_path / "path/scenario.toml")
    out = tmp_path / "out"
    done = command("run", scenario, "-n", "1", "-m", "tc", "-o", str(out), "--export", "csv", cwd=root)
    assert done.returncode == 0, done.stderr
    assert "origin latitude 59.451°, longitude 24.7035°" in " ".join(done.stdout.split())
    table = tmp_path / "path/nav.csv"
    text = table.read_text("utf-8")
    last = text.rstrip("\n").rsplit("\n", 1)[0] + "\n"
    table.write_text(last, encoding="utf-8")
    done = command("run", str(out), "--export", "csv", cwd=root)
    assert done.returncode == 2
    assert "has changed since" in " ".join(done.stderr.split())


def test_the_command_exports_what_it_has_run_or_finds_and_names_mistakes(tmp_path: Path, root: Path) -> None:
    out = tmp_path / "out"
    done = command(
        "run", "straight", "-n", "2", "-m", "tc", "-o", str(out), "--export", "kml", "--run", "1", cwd=root
    )
    assert done.returncode == 0, done.stderr
    assert "straight: origin latitude 32.8°, longitude 35° of the scenario's [environment]" in done.stdout
    assert "straight_run1_truth" in (out / "export/tracks.kml").read_text("utf-8")
    done = command("run", str(out), "--export", "gpx", cwd=root)
    assert done.returncode == 0, done.stderr
    assert "straight_run0_tc" in (out / "export/tracks.gpx").read_text("utf-8")
    assert (out / "export/tracks.kml").exists()
    new = str(tmp_path / "new")
    for words, told in (
        ((str(out), "--export", "shp"), "'shp' is no format, expected of kml, geojson, gpx, csv, tum, mcap"),
        ((str(out), "--export", "kml", "--run", "2"), "--run is 2, and straight has 2 runs in"),
        ((str(out), "--export", "kml", "--run", "-1"), "--run is -1, expected a run number, 0 or more"),
        ((str(out), "--export", "kml", "-o", new), "leave --out out"),
        ((str(out), "--export", "kml", "-n", "5"), "--runs (--run is the one to export): nothing is run in"),
        ((str(out), "--export", "kml", "-s", "0", "--json"), "--seed, --json: nothing is run in"),
        ((str(tmp_path / "none"), "--export", "kml"), "is neither a file nor a packaged scenario"),
        ((str(out),), "is a folder, expected a scenario; of a campaign's folder --export"),
        ((str(tmp_path), "--export", "kml"), "holds no campaign"),
        ((str(out), "straight", "-o", new), "is a folder, expected a scenario, or one folder alone"),
        (("straight", "-o", new, "--run", "1"), "--run is 1 without --export"),
        (
            ("straight", "-o", new, "-n", "3", "--export", "kml", "--run", "3"),
            "straight has 3 runs, expected 0 to 2",
        ),
        (("straight", "-o", new, "--export", "shp"), "'shp' is no format"),
        (("straight", "-o", new, "--export", "kml", "--shard", "1/2"), "--export and --shard are both given"),
        (
            ("straight", "-o", new, "--export", "kml", "--set", "dvl.rate_hz=1,2"),
            "--export and --set are both given",
        ),
        (("straight", "--export", "kml"), "--out is missing"),
    ):
        done = command("run", *words, cwd=root)
        assert done.returncode == 2, words
        assert told in " ".join(done.stderr.split()), (words, done.stderr)
    assert not Path(new).exists()
    # Another campaign in its place takes the exports of the first along.
    done = command("run", "straight", "-n", "2", "-m", "tc", "-s", "5", "-o", str(out), "--force", cwd=root)
    assert done.returncode == 0, done.stderr
    assert not (out / "export").exists()
