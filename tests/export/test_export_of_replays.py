"""Exports of a replay, read back by the standard library and by the libraries of other programs."""

import csv
import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import polars as pl
import pytest
from mcap.reader import make_reader

from bottomlock.errors import DataError, OutputError, ScenarioError
from bottomlock.export.formats import FORMATS, check_formats, files_of
from bottomlock.export.replay import export_of_replay, export_replay
from bottomlock.files.overwriting import Files
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import has_origin
from bottomlock.replay.report import read_replay
from bottomlock.replay.run import replay_case, write_replay
from tests.cli.calls import command, succeeded
from tests.oracle.rotations import matrix_from_quaternion
from tests.replay import synthetic_dive
from tests.replay.dive_tables import dive_tables

ASKED = """
[replay]
methods = ["tc", "ins"]
[[what_if]]
name = "outage"
outages = [{ beams = [1, 2, 3, 4], from_s = 20.0, to_s = 50.0 }]
"""
KML = {"kml": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
TRACKS = ["recorded_tc", "recorded_tc_smoothed", "outage_tc", "outage_tc_smoothed", "reference"]
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dive of known truth whose clock is not UTC, replayed and exported."""
    work = tmp_path_factory.mktemp("export")
    write_replay(replay_case(load_case(synthetic_dive.write(work, ASKED))), work / "out")
    export_replay(work / "out", FORMATS)
    return work / "out"


def export_files(tables: ReplayTables, formats: Sequence[str], methods: Sequence[str] | None = None) -> Files:
    """The contents of the files, as `export_replay` names them."""
    export = export_of_replay(tables, methods)
    return {f"export/{name}": content for kind in formats for name, content in files_of(export, kind).items()}


def utc_dive(**manifest: object) -> ReplayTables:
    tables = dive_tables()
    configuration = {"origin": {"earth": "ellipsoid", "latitude_deg": 54.0}}
    return replace(tables, manifest=tables.manifest | {"configuration": configuration} | manifest)


def rows_of(folder: Path, track: str) -> dict[str, np.ndarray[Any, Any]]:
    """The numbers of an exported CSV file, by column, as the csv module reads it."""
    with (folder / f"export/{track}.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name.endswith(("_m", "_deg", "_ns"))]
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in names}


def test_csv_has_the_bits_of_the_tables_in_degrees_and_the_beams_of_the_last_ping(folder: Path) -> None:
    tables = read_replay(folder)
    samples = tables.samples.filter(
        (pl.col("what_if") == "outage") & (pl.col("method") == "tc") & (pl.col("pass") == "forward")
    )
    with (folder / "export/outage_tc.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name, dtype in samples.schema.items():
        if dtype == pl.Float64:
            values = samples[name].degrees() if name.endswith("_rad") else samples[name]
            column = name.replace("_rad", "_deg")
            assert [float(row[column]) for row in rows] == values.to_list(), name
    assert any(name.endswith("_rad") for name in samples.columns)
    assert not any(name.endswith("_rad") for name in rows[0])
    assert [int(row["time_ns"]) for row in rows] == samples["time_ns"].to_list()
    assert {row["utc"] for row in rows} == {""}  # the clock of this case starts at zero
    beams = [row["beams_valid"] for row in rows]
    assert (beams[0], beams[19], beams[30], beams[55]) == ("", "4", "0", "4")


def test_tum_is_east_north_up_with_the_attitude_of_the_vehicle(folder: Path) -> None:
    """Forward and up of the platform, from the truth by the oracle's rotations."""
    table = np.loadtxt(folder / "export/recorded_tc.tum")
    csv_rows = rows_of(folder, "recorded_tc")
    enu = np.stack([csv_rows["east_m"], csv_rows["north_m"], -csv_rows["down_m"]], axis=1)
    np.testing.assert_array_equal(table[:, 1:4], enu)
    true = synthetic_dive.motion()
    at = np.searchsorted(true["time_ns"], csv_rows["time_ns"])
    R = np.array([ENU_FROM_NED @ matrix_from_quaternion(q) for q in true["attitude_t_p"][at]])
    mine = np.array([matrix_from_quaternion(np.roll(q, 1)) for q in table[:, 4:]])
    np.testing.assert_allclose(mine[:, :, 0], R[:, :, 0], atol=1e-3)
    np.testing.assert_allclose(mine[:, :, 2], -R[:, :, 2], atol=1e-3)
    assert np.ptp(mine[:, 0, 0]) > 0.1  # the vehicle turns
    np.testing.assert_array_equal(np.loadtxt(folder / "export/reference.tum")[:, 4:], [[0, 0, 0, 1]] * 61)


def test_kml_and_geojson_without_utc_are_lines_to_the_last_bit(folder: Path) -> None:
    root = ET.parse(folder / "export/tracks.kml").getroot()
    marks = root.findall("kml:Document/kml:Placemark", KML)
    assert [mark.findtext("kml:name", namespaces=KML) for mark in marks] == TRACKS
    for mark, name in zip(marks, TRACKS, strict=True):
        text = mark.findtext("kml:LineString/kml:coordinates", namespaces=KML)
        assert text is not None
        _equal_places(np.array([[float(x) for x in one.split(",")] for one in text.split()]), folder, name)
    assert root.find(".//gx:Track", KML) is None
    content = json.loads((folder / "export/tracks.geojson").read_text(encoding="utf-8"))
    assert [one["properties"]["name"] for one in content["features"]] == TRACKS
    for feature in content["features"]:
        assert feature["geometry"]["type"] == "LineString"
        _equal_places(np.array(feature["geometry"]["coordinates"]), folder, feature["properties"]["name"])
        assert "coordinateProperties" not in feature["properties"]


def _equal_places(found: np.ndarray[Any, Any], folder: Path, track: str) -> None:
    """Longitude, latitude, height against the tables of the replay, bit by bit; of the reference without height."""
    rows = rows_of(folder, track)
    np.testing.assert_array_equal(found[:, 0], rows["longitude_deg"])
    np.testing.assert_array_equal(found[:, 1], rows["latitude_deg"])
    if "height_m" in rows:
        np.testing.assert_array_equal(found[:, 2], rows["height_m"])


def test_times_are_utc_to_the_nanosecond() -> None:
    tables = utc_dive()
    times = tables.samples.filter(pl.col("method") == "tc")["time_ns"].to_numpy()
    files = export_files(tables, FORMATS)

    def read(texts: list[str | None]) -> None:
        assert [
            np.datetime64(str(text).rstrip("Z"), "ns").astype(np.int64) for text in texts
        ] == times.tolist()

    kml = ET.fromstring(str(files["export/tracks.kml"]))
    read([one.text for one in kml.findall(".//gx:Track/kml:when", KML)])
    assert len(kml.findall(".//gx:Track/gx:coord", KML)) == len(times)
    (feature,) = json.loads(str(files["export/tracks.geojson"]))["features"]
    read(feature["properties"]["coordinateProperties"]["times"])
    read([row["utc"] for row in csv.DictReader(str(files["export/recorded_tc.csv"]).splitlines())])
    frames, first, second = str(files["export/recorded_tc.tum"]).splitlines()[:3]
    assert frames.startswith("# east north up from the origin, orientation of forward left up; ")
    assert (first.split()[0], second.split()[0]) == ("1767225610.000000000", "1767225610.200000000")


def test_a_reference_without_heights_has_none(tmp_path: Path) -> None:
    """No number stands for them on the Earth, and the description says so; estimates keep theirs."""
    case = synthetic_dive.write(tmp_path, ASKED)
    text = case.read_text("utf-8")
    assert text.count('height = "height"\n') == 1
    case.write_text(text.replace('height = "height"\n', ""), encoding="utf-8")
    write_replay(replay_case(load_case(case)), tmp_path / "out")
    export_replay(tmp_path / "out", ("kml", "geojson", "tum"))
    folder = tmp_path / "out" / "export"
    features = json.loads((folder / "tracks.geojson").read_text("utf-8"))["features"]
    sizes = {one["properties"]["name"]: len(one["geometry"]["coordinates"][0]) for one in features}
    assert (sizes["reference"], sizes["recorded_tc"]) == (2, 3)
    assert "heights were not recorded" in (folder / "reference.tum").read_text("utf-8").splitlines()[0]
    placed = ET.fromstring((folder / "tracks.kml").read_text("utf-8")).findall(".//kml:LineString", KML)
    commas = {line.findtext("kml:coordinates", "", KML).split()[0].count(",") for line in placed}
    assert commas == {1, 2}


def test_mcap_holds_poses_places_estimates_beams_and_fixes(folder: Path) -> None:
    with (folder / "export/tracks.mcap").open("rb") as file:
        messages = [
            (schema.name, channel.topic, message.log_time, json.loads(message.data))
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages()
            if schema is not None
        ]
    by_topic: dict[str, list[Any]] = {}
    for name, topic, time_ns, content in messages:
        by_topic.setdefault(f"{topic} {name}", []).append((time_ns, content))
    rows, table = rows_of(folder, "outage_tc"), np.loadtxt(folder / "export/outage_tc.tum")
    poses = by_topic["/outage_tc/pose foxglove.PoseInFrame"]
    assert [one[0] for one in poses] == rows["time_ns"].tolist()
    found = [[*one["pose"]["position"].values(), *one["pose"]["orientation"].values()] for _, one in poses]
    np.testing.assert_array_equal(found, table[:, 1:])
    places = [one for _, one in by_topic["/outage_tc/location foxglove.LocationFix"]]
    np.testing.assert_array_equal([one["latitude"] for one in places], rows["latitude_deg"])
    np.testing.assert_array_equal(
        [one["position_covariance"][0] for one in places], rows["sd_position_east_m"] ** 2
    )
    tables = read_replay(folder)
    estimates = by_topic["/outage_tc/estimate bottomlock.Estimate"]
    np.testing.assert_array_equal(
        [one["sd_position_down_m"] for _, one in estimates], rows["sd_position_down_m"]
    )
    pings = tables.pings.filter(pl.col("what_if") == "outage")
    beams = [one for _, one in by_topic["/outage/beams bottomlock.Beams"]]
    assert [one["beam2_valid"] for one in beams] == pings["beam2_valid"].to_list()
    fixes = [one for _, one in by_topic["/outage_tc/fix bottomlock.Fix"]]
    mine = tables.innovations.filter((pl.col("what_if") == "outage") & (pl.col("method") == "tc"))
    assert [one.get("nis") for one in fixes] == mine["nis"].to_list()
    assert "/reference/pose foxglove.PoseInFrame" not in by_topic  # it has no attitude


def test_methods_are_chosen_and_unknown_ones_named(folder: Path) -> None:
    files = export_files(read_replay(folder), ["tum"], ["ins"])
    names = [track.replace("tc", "ins") for track in TRACKS]
    assert list(files) == [f"export/{name}.tum" for name in names]
    with pytest.raises(ScenarioError, match="'vb': is not in the replay, expected of tc, ins"):
        export_files(read_replay(folder), ["tum"], ["vb"])


def test_without_a_place_on_the_earth_two_formats_are_refused_and_three_written() -> None:
    for name in ("kml", "geojson"):
        with pytest.raises(DataError, match=r"origin\.longitude_deg"):
            check_formats([name], has_origin=False)
    files = export_files(utc_dive(origin=None), ["csv", "tum", "mcap"])
    assert set(files) == {f"export/{name}" for name in ("recorded_tc.csv", "recorded_tc.tum", "tracks.mcap")}
    assert b"LocationFix" not in bytes(files["export/tracks.mcap"])  # type: ignore[arg-type]


def test_without_the_extra_mcap_is_refused_and_said_how_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    check_formats(["csv", "tum"])
    with pytest.raises(DataError, match=r"MCAP files need mcap: `pip install '\.\[live\]'`"):
        check_formats(["csv", "mcap"])


def test_origin_is_known_before_the_replay(tmp_path: Path) -> None:
    path = synthetic_dive.write(tmp_path, ASKED)
    assert has_origin(load_case(path))
    case = load_case(path)
    bare = case.model_copy(
        update={
            "origin": case.origin.model_copy(update={"longitude_deg": None}),
            "reference": None,
            "gps": None,
        }
    )
    assert not has_origin(bare)


def test_an_export_takes_the_place_of_the_same_format_but_not_of_a_users_file(
    folder: Path, tmp_path: Path
) -> None:
    """Those of other formats stay; another choice of methods replaces the files of the one before."""
    out = tmp_path / "out"
    shutil.copytree(folder, out)
    before = {path.name for path in (out / "export").iterdir()}
    export_replay(out, ["tum"], methods=["ins"])
    now = {path.name for path in (out / "export").iterdir()}
    assert {name for name in now if not name.endswith(".tum")} == {
        name for name in before if not name.endswith(".tum")
    }
    assert {name for name in now if name.endswith(".tum")} == {
        f"{track.replace('tc', 'ins')}.tum" for track in TRACKS
    }
    (out / "export/recorded_ins.tum").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="has changed since it was written"):
        export_replay(out, ["tum"])
    export_replay(out, ["tum"], force=True)
    assert (out / "export/recorded_tc.tum").exists()
    (out / "export_kml.record.json").unlink()
    with pytest.raises(OutputError, match="not of ours"):
        export_replay(out, ["kml"], force=True)


def test_the_command_exports_a_folder_and_names_mistakes(folder: Path, tmp_path: Path, root: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(folder, out)
    succeeded("replay", str(out), "--export", "kml,tum", cwd=root)
    assert (out / "export/tracks.kml").read_bytes() == (folder / "export/tracks.kml").read_bytes()
    for words, told in (
        ((str(out),), "--export"),
        (
            (str(folder.parent / "case.toml"), "--out", str(tmp_path / "new"), "--export", "shp"),
            "'shp' is no format",
        ),
        ((str(tmp_path), "--export", "kml"), "holds no replay"),
        ((str(tmp_path / "none"), "--export", "kml"), "no such file or folder, expected a case"),
        (
            (str(out), "--export", "kml", "--write-calibration", str(tmp_path / "dvl.toml")),
            "--write-calibration: nothing is run in",
        ),
    ):
        done = command("replay", *words, cwd=root)
        assert done.returncode != 0
        assert told in " ".join(done.stderr.split())
    assert not (tmp_path / "new").exists()  # it is known before the replay
