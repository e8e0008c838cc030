"""Exports of the raw logs of `bottomlock live`: against what the ports sent at that time, and by other programs."""

import csv
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from bottomlock.errors import DataError, ScenarioError
from bottomlock.export.formats import FORMATS
from bottomlock.export.live import export_live
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.raw_log import RawLog
from tests.cli.calls import command, process, refused
from tests.live import world
from tests.live.world import Sent, World, probe_registered

ORIGIN = "origin = { latitude_deg = 32.8, longitude_deg = -17.5, height_m = 4.0 }"


@pytest.fixture(autouse=True)
def _probe() -> Iterator[None]:
    with probe_registered():
        yield


def text_of(mode: str, form: str = "waterlinked-json", port: str = "probe") -> str:
    """A configuration that sends every estimate to a port, with a place on the Earth."""
    text = world.text_of(mode, format=form)
    text = text.replace("origin.latitude_deg = 32.8", ORIGIN).replace('port = "probe"', f'port = "{port}"')
    return text.removesuffix("rate_hz = 10\n") if mode == "navigation" else text


def write_log(folder: Path, text: str, run: World) -> tuple[LiveConfig, Path, list[Sent]]:
    """The log of a run, as `bottomlock live` writes it, and what its probe sent."""
    config = parse_config(text, place="test")
    sources, ports = [one.name for one in config.source], [one.port for one in config.port]
    log = RawLog(folder, sources=sources, ports=ports, start={"config": text.encode()})
    engine, sent = Engine(config), []
    for arrival_ns, source, data in run.arrivals(imu=config.mode == "navigation"):
        log.write("in", source, arrival_ns, data)
        for message in engine.arrive(source, arrival_ns, data):
            log.write("out", message.port, arrival_ns, message.data)
            sent.append(message.data)
    log.close()
    probed = [Sent.parse(data) for data in sent] if ports == ["probe"] else []
    return config, log.path, probed


def exported(log: Path, name: str) -> Path:
    return log.with_name(f"{log.stem}_export") / name


def rows_of(log: Path) -> list[dict[str, str]]:
    with exported(log, "live.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def numbers(row: dict[str, str], names: list[str]) -> list[float]:
    return [float(row[name] or "nan") for name in names]


BODY = ("surge", "sway", "heave")
VELOCITY = [f"{axis}_mps" for axis in BODY]
SIGMA = [f"sd_velocity_{axis}_mps" for axis in BODY]


def lost(t: float) -> tuple[int, ...]:
    """Two beams for a second, and all for one."""
    return (0, 1) if 4.0 <= t < 5.0 else (0, 1, 2, 3) if 6.0 <= t < 7.0 else ()


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Sent]]:
    """A dive in mode navigation that loses beams, in every format."""
    with probe_registered():
        config, log, sent = write_log(
            tmp_path_factory.mktemp("live"), text_of("navigation"), World(9.0, lost=lost)
        )
        replayed, files = export_live(config, log, FORMATS)
    assert replayed.text().endswith("the same bits")
    assert {path.name for path in files} == {
        "tracks.kml", "tracks.geojson", "live.csv", "live.tum", "tracks.mcap",
    }  # fmt: skip
    return log, sent


def test_csv_has_the_bits_that_a_port_sent(dive: tuple[Path, list[Sent]]) -> None:
    """Every estimate that was sent, its time, state, velocity and 1 sigma."""
    log, sent = dive
    rows = rows_of(log)
    assert len(rows) == len(sent) > 100
    for row, one in zip(rows, sent, strict=True):
        assert (int(row["time_ns"]), row["state"], int(row["rank"])) == (one.time_ns, one.state, one.rank)
        assert numbers(row, VELOCITY) == one.velocity.tolist()
        assert numbers(row, SIGMA) == one.sd.tolist()
    assert {row["state"] for row in rows} >= {"OK", "PARTIAL", "COASTING"}
    assert {row["beams_valid"] for row in rows if row["state"] == "PARTIAL"} >= {"2"}
    last = rows[-1]
    assert np.datetime64(last["utc"].rstrip("Z"), "ns").astype(np.int64) == sent[-1].time_ns


def test_mcap_has_estimates_and_beams(dive: tuple[Path, list[Sent]]) -> None:
    log, sent = dive
    path = exported(log, "tracks.mcap")
    topics: dict[str, list[dict[str, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert schema.encoding == "jsonschema"
            content = json.loads(message.data)
            fields = json.loads(schema.data)["properties"]
            assert set(content) <= set(fields), channel.topic
            topics.setdefault(channel.topic, []).append(content | {"log_time": message.log_time})
    assert [one["log_time"] for one in topics["/live/pose"]] == [one.time_ns for one in sent]
    assert [[one[name] for name in SIGMA] for one in topics["/live/estimate"]] == [
        one.sd.tolist() for one in sent
    ]
    variance = [one["position_covariance"][0] for one in topics["/live/location"]]
    rows = rows_of(log)
    assert variance == [float(row["sd_position_east_m"]) ** 2 for row in rows]
    assert {one["beams_valid"] for one in topics["/live/beams"]} == {0, 2, 4}
    assert 60 < len(topics["/live/beams"]) < len(sent)  # a ping is there once
    half = next(one for one in topics["/live/beams"] if one["beams_valid"] == 2)
    assert "beam1_mps" not in half
    assert (half["beam1_valid"], half["beam3_valid"]) == (False, True)


def test_mode_velocity_has_velocities_and_no_positions(tmp_path: Path) -> None:
    """A component that the beams do not determine is empty."""
    world = World(6.0, lost=lambda t: (0, 1, 2) if t >= 4.0 else (), form="pd0")
    config, log, sent = write_log(tmp_path, text_of("velocity", "pd0"), world)
    export_live(config, log, ["csv", "mcap"])
    rows = rows_of(log)
    assert [int(row["time_ns"]) for row in rows[: len(sent)]] == [one.time_ns for one in sent]
    for row, one in zip(rows, sent, strict=False):
        for name, value in zip(VELOCITY, one.velocity.tolist(), strict=True):
            assert row[name] == "" if math.isnan(value) else float(row[name]) == value
    assert {row["surge_mps"] == "" for row in rows} == {True, False}
    assert "north_m" not in rows[0]
    for name in ("kml", "geojson", "tum"):
        with pytest.raises(DataError, match=rf'{name} needs positions, and mode = "velocity" estimates none'):
            export_live(config, log, ["csv", name])


def test_the_replay_sends_the_same_with_and_without_an_export(tmp_path: Path) -> None:
    """The listener is a port of its own: where no port is configured there are estimates, too."""
    text = text_of("navigation")
    config, log, sent = write_log(tmp_path, text, World(5.0))
    without = parse_config(text[: text.index("[[port]]")], place="test")
    replayed, _ = export_live(without, log, ["csv"])
    assert "were not sent" not in replayed.first_difference
    assert [int(row["time_ns"]) for row in rows_of(log)] == [one.time_ns for one in sent]
    again, _ = export_live(config, log, ["csv"])
    assert again.first_difference == ""


def test_without_an_estimate_a_place_or_the_right_configuration_nothing_is_written(tmp_path: Path) -> None:
    config, log, _ = write_log(tmp_path, text_of("navigation"), World(0.5))
    with pytest.raises(
        DataError, match=r"gives no estimate to export; its last state is INITIALISING, waiting for"
    ):
        export_live(config, log, ["csv"])
    nowhere = parse_config(text_of("navigation").replace(ORIGIN, "origin.latitude_deg = 32.8"), place="test")
    with pytest.raises(
        DataError, match=r"need a place on the Earth, and there is none; give origin\.latitude_deg"
    ):
        export_live(nowhere, log, ["kml"])
    with pytest.raises(DataError, match="has bytes of source 2, and the configuration has 1 sources"):
        export_live(parse_config(text_of("velocity"), place="test"), log, ["csv", "mcap"])
    with pytest.raises(ScenarioError, match="'shp' is no format"):
        export_live(config, log, ["shp"])
    with pytest.raises(DataError, match=r"nothing\.mcap: cannot be read"):
        export_live(config, tmp_path / "nothing.mcap", ["csv"])
    assert not exported(log, "").exists()


def test_the_command_exports_a_log_and_names_mistakes(tmp_path: Path) -> None:
    text = text_of("velocity", port="sentence")
    _, log, _ = write_log(tmp_path, text, World(2.0))
    (tmp_path / "live.toml").write_text(text, encoding="utf-8")
    words = ("live", "live.toml", "--replay", log.name)
    done = command(*words, "--export", "csv,mcap", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert rows_of(log)
    assert done.stdout.rstrip().endswith("the same bits")
    for more, told in (
        (("live", "live.toml", "--export", "csv"), "--export is given without --replay LOG"),
        ((*words, "--export", ","), "--export names no format"),
    ):
        said = refused(*more, cwd=tmp_path)
        assert told in " ".join(said.split())
    # Another noise of the beams gives other bits: the track is written, and the exit code says so.
    (tmp_path / "live.toml").write_text(
        text.replace("noise_mps = 0.01", "noise_mps = 0.02"), encoding="utf-8"
    )
    done = command(*words, "--export", "csv", cwd=tmp_path)
    assert done.returncode == 1
    assert "message 1 (port 0" in done.stdout


def test_an_install_for_a_vehicle_says_what_it_lacks(tmp_path: Path) -> None:
    text = text_of("velocity", port="sentence")
    _, log, _ = write_log(tmp_path, text, World(2.0))
    (tmp_path / "live.toml").write_text(text, encoding="utf-8")
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\nsys.modules.update({'polars': None, 'scipy': None, 'matplotlib': None})\n",
        encoding="utf-8",
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{tmp_path}{':'.join(['', *filter(None, sys.path)])}")
        done = process("live", "live.toml", "--replay", log.name, "--export", "csv", cwd=tmp_path)
        assert done.returncode == 2, done.stderr
        assert "which an install for a vehicle leaves out" in " ".join(done.stderr.split())
