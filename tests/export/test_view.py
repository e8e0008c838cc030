"""A replay in Rerun: its own reader finds every pose, ellipsoid, beam and curve of the tables, to the last digit."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import Note, OutputError, ScenarioError
from bottomlock.export.view import BEAM_M, check_view, open_view, save_view
from bottomlock.replay.case import load_case
from bottomlock.replay.report import ReplayTables, read_replay
from bottomlock.replay.run_and_report import run_and_report
from tests.cli.calls import command
from tests.oracle.rotations import matrix_from_euler, matrix_from_quaternion
from tests.replay.dive_tables import START_NS, dive_tables

CASE = Path(__file__).parents[2] / "data" / "logs" / "survey_dive" / "case.toml"
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])


def test_without_rerun_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Before anything is replayed."""
    monkeypatch.setitem(sys.modules, "rerun", None)
    refused = command("replay", CASE, "--out", tmp_path / "out", "--view-file", tmp_path / "a.rrd")
    assert refused.returncode != 0
    assert "viewed by Rerun, which is not installed: `pip install '.[view]'`" in refused.stderr
    assert not (tmp_path / "out").exists()


def test_a_case_that_is_written_is_not_viewed(tmp_path: Path) -> None:
    refused = command(
        "replay", "--init", CASE.with_name("dvl.pd0"), "--out", tmp_path / "case.toml", "--view"
    )
    assert refused.returncode != 0
    assert "there is nothing to view yet" in refused.stderr
    assert not (tmp_path / "case.toml").exists()


class Read:
    """A file as Rerun's own reader gives it: the columns of every entity, static ones apart."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(path)
        assert len(reader.recordings()) == len(reader.blueprints()) == 1
        self.moving: dict[str, dict[str, Any]] = {}
        self.static: dict[str, dict[str, Any]] = {}
        for chunk in reader.stream():
            batch = chunk.to_record_batch()
            columns = dict(zip(batch.schema.names, batch.columns, strict=True))
            found = self.static if chunk.is_static else self.moving
            kept = found.setdefault(chunk.entity_path, {})
            for name, column in columns.items():
                kept.setdefault(name, []).extend(
                    column.cast("int64") if name in ("utc", "since_start") else column
                )

    def times(self, path: str) -> tuple[list[int], list[int]]:
        """UTC and the time since the start, ns."""
        columns: Mapping[str, Any] = self.moving[path]
        return [one.as_py() for one in columns["utc"]], [one.as_py() for one in columns["since_start"]]

    def rows(self, path: str, name: str) -> np.ndarray[Any, Any]:
        """The value of each row, of rows that hold one, or several, values."""
        return np.array([one.as_py() for one in self.moving[path][name]])

    def whole(self, path: str, name: str) -> Any:  # noqa: ANN401
        """The value of an entity that is there at every time."""
        (only,) = self.static[path][name]
        return only.as_py()


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> ReplayTables:
    folder = tmp_path_factory.mktemp("view") / "dive"
    run_and_report(load_case(CASE).with_overrides(methods=["tc", "sway_current", "lc"]), folder)
    return read_replay(folder)


@pytest.fixture(scope="module")
def read(tables: ReplayTables, tmp_path_factory: pytest.TempPathFactory) -> Read:
    pytest.importorskip("rerun")
    path = tmp_path_factory.mktemp("view") / "dive.rrd"
    save_view(tables, path)
    return Read(path)


def of(tables: ReplayTables, what_if: str, method: str, which: str = "forward") -> pl.DataFrame:
    return tables.samples.filter(
        (pl.col("what_if") == what_if) & (pl.col("method") == method) & (pl.col("pass") == which)
    )


@pytest.mark.parametrize("what_if", ["recorded", "lost_34"])
def test_the_vehicle_is_where_the_table_has_it(tables: ReplayTables, read: Read, what_if: str) -> None:
    """East, north, up and the attitude by an own matrix; the quaternion is scalar last there."""
    rows = of(tables, what_if, "tc")
    ned = rows.select("north_m", "east_m", "down_m").to_numpy()
    place = read.rows(f"/{what_if}/vehicle", "Transform3D:translation")[:, 0]
    np.testing.assert_array_equal(place, (ned @ ENU_FROM_NED.T).astype(np.float32))
    time_ns = rows["time_ns"].to_list()
    utc, seconds = read.times(f"/{what_if}/vehicle")
    assert utc == time_ns
    assert seconds == [one - time_ns[0] for one in time_ns]
    shown = read.rows(f"/{what_if}/vehicle", "Transform3D:quaternion")[:, 0]
    for row in (0, 700, -1):
        angles = np.deg2rad(rows.select("roll_deg", "pitch_deg", "yaw_deg").row(row))
        expected = ENU_FROM_NED @ matrix_from_euler(*angles) @ FLU_FROM_FRD
        # Level and north of the place are turned from those of the origin by less than 1e-4 rad.
        np.testing.assert_allclose(matrix_from_quaternion(np.roll(shown[row], 1)), expected, atol=1e-4)


def test_the_ellipsoid_is_two_sigma(tables: ReplayTables, read: Read) -> None:
    sd = of(tables, "lost_34", "tc").select("sd_position_east_m", "sd_position_north_m", "sd_position_down_m")
    half = read.rows("/lost_34/position_2_sigma", "Ellipsoids3D:half_sizes")[:, 0]
    np.testing.assert_array_equal(half, (2.0 * sd.to_numpy()).astype(np.float32))


def test_beams_are_green_where_they_are_valid_and_red_where_not(tables: ReplayTables, read: Read) -> None:
    """Their directions by hand: 30 degrees from down, forward or aft, starboard or port."""
    pings = tables.pings.filter(pl.col("what_if") == "lost_34")
    colours = read.rows("/lost_34/vehicle/beams", "LineStrips3D:colors")
    assert read.times("/lost_34/vehicle/beams")[0] == pings["time_ns"].to_list()
    valid = pings.select(f"beam{k}_valid" for k in (1, 2, 3, 4)).to_numpy()
    assert 0 < valid.sum() < valid.size
    green, red = colours >> 16 & 255, colours >> 24
    np.testing.assert_array_equal(green > red, valid)
    strips = np.array(read.whole("/lost_34/vehicle/beams", "LineStrips3D:strips"))
    ends = strips[:, 1] - strips[:, 0]
    np.testing.assert_allclose(ends[:, 2], -BEAM_M * np.cos(np.deg2rad(30.0)), rtol=1e-6)
    np.testing.assert_allclose(np.hypot(ends[:, 0], ends[:, 1]), BEAM_M * 0.5, rtol=1e-6)


@pytest.mark.parametrize("method", ["tc", "sway_current", "dead_reckoning"])
def test_curves_are_columns_of_the_tables(tables: ReplayTables, read: Read, method: str) -> None:
    """All digits: curves are in double precision; a value that is missing is NaN."""
    rows = of(tables, "one_beam_for_5_min", method)
    for path, column in {
        "velocity/sway": "sway_mps",
        "velocity_sd/surge": "sd_velocity_surge_mps",
        "position_sd/north": "sd_position_north_m",
        "depth": "down_m",
    }.items():
        shown = read.rows(f"/one_beam_for_5_min/curves/{path}/{method}", "Scalars:scalars")[:, 0]
        np.testing.assert_array_equal(shown, rows[column].fill_null(np.nan).to_numpy())


def test_nis_is_that_of_every_fix(tables: ReplayTables, read: Read) -> None:
    fixes = tables.innovations.filter(
        (pl.col("what_if") == "recorded") & (pl.col("method") == "tc") & pl.col("nis").is_not_null()
    )
    shown = read.rows("/recorded/curves/nis/tc", "Scalars:scalars")[:, 0]
    np.testing.assert_array_equal(shown, (fixes["nis"] / fixes["degrees"]).to_numpy())
    assert read.times("/recorded/curves/nis/tc")[0] == fixes["time_ns"].to_list()


def test_tracks_are_whole_and_the_reference_is_among_them(tables: ReplayTables, read: Read) -> None:
    assert tables.path is not None
    (strip,) = read.whole("/lost_34/tracks/reference", "LineStrips3D:strips")
    ned = tables.path.select("north_m", "east_m", "down_m").to_numpy()
    np.testing.assert_array_equal(strip, (ned @ ENU_FROM_NED.T).astype(np.float32))
    (strip,) = read.whole("/lost_34/tracks/tc_smoothed", "LineStrips3D:strips")
    assert len(strip) == of(tables, "lost_34", "tc", "smoothed").height
    names = {path.rsplit("/", 1)[1] for path in read.static if path.startswith("/recorded/tracks/")}
    assert {"tc", "sway_current", "dead_reckoning", "reference"} <= names


def test_methods_may_be_chosen_and_the_first_is_followed(tables: ReplayTables, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    save_view(tables, tmp_path / "lc.rrd", ["lc"])
    read = Read(tmp_path / "lc.rrd")
    assert {path for path in read.static if "/recorded/tracks/" in path} == {
        "/recorded/tracks/lc", "/recorded/tracks/lc_smoothed", "/recorded/tracks/reference"
    }  # fmt: skip
    down = of(tables, "recorded", "lc")["down_m"].to_numpy()
    place = read.rows("/recorded/vehicle", "Transform3D:translation")[:, 0, 2]
    np.testing.assert_array_equal(place, (-down).astype(np.float32))
    with pytest.raises(ScenarioError, match="'vb': is not in the replay"):
        save_view(tables, tmp_path / "vb.rrd", ["vb"])
    assert not (tmp_path / "vb.rrd").exists()


def test_a_geometry_that_is_gone_leaves_out_the_beams_with_a_note(tmp_path: Path) -> None:
    """And a clock that is not Unix time leaves out UTC."""
    pytest.importorskip("rerun")
    tables = dive_tables()
    tables.manifest["configuration"]["dvl"] = {"geometry": "gone.toml"}
    tables.manifest["configuration"]["origin"] = {"latitude_deg": 54.0, "earth": "ellipsoid"}
    counted = {
        name: getattr(tables, name).with_columns(pl.col("time_ns") - START_NS)
        for name in ("samples", "pings", "innovations")
    }
    tables = replace(tables, **counted)
    with pytest.warns(Note, match=r"the beams are not drawn: .*gone\.toml"):
        save_view(tables, tmp_path / "a.rrd")
    read = Read(tmp_path / "a.rrd")
    assert "/recorded/vehicle" in read.moving
    assert "/recorded/vehicle/beams" not in read.moving
    assert "utc" not in read.moving["/recorded/vehicle"]


def test_what_cannot_be_shown_is_said_beforehand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rerun")
    with pytest.raises(OutputError, match=r"dive\.rr: expected a name that ends in \.rrd"):
        check_view(tmp_path / "dive.rr", window=False)
    (tmp_path / "there.rrd").touch()
    with pytest.raises(OutputError, match="is there already"):
        check_view(tmp_path / "there.rrd", window=False)
    check_view(tmp_path / "there.rrd", window=False, force=True)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(OutputError, match="there is no display for --view; write a file with --view-file"):
        check_view(None, window=True)
    monkeypatch.setenv("DISPLAY", ":0")
    check_view(None, window=True)


def test_a_viewer_that_is_not_there_is_named(
    tables: ReplayTables, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rerun")
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OutputError, match=r"Rerun's viewer does not start .*; write a file with --view-file"):
        open_view(tables)


def test_the_command_writes_a_file_of_a_folder(tables: ReplayTables, tmp_path: Path) -> None:
    """Of a replay that is there nothing else is done."""
    pytest.importorskip("rerun")
    run_and_report(load_case(CASE).with_overrides(methods=["tc"]), tmp_path / "dive")
    before = sorted((path, path.stat().st_mtime_ns) for path in (tmp_path / "dive").rglob("*"))
    written = command("replay", tmp_path / "dive", "--view-file", tmp_path / "dive.rrd")
    assert written.returncode == 0
    assert written.stdout.split() == ["wrote", str(tmp_path / "dive.rrd")]
    assert sorted((path, path.stat().st_mtime_ns) for path in (tmp_path / "dive").rglob("*")) == before
    place = Read(tmp_path / "dive.rrd").rows("/recorded/vehicle", "Transform3D:translation")
    assert len(place) == of(tables, "recorded", "tc").height
