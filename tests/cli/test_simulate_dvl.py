"""The command `bottomlock simulate-dvl`: files, sockets and terminals, faults and their record, mistakes of users."""

import time
from pathlib import Path

import polars as pl
import pytest

from bottomlock.io.formats import read_recording
from tests.cli.calls import command as bottomlock
from tests.cli.calls import shortened, succeeded

RUN = ("simulate-dvl", "straight.toml", "--duration-s", "20")
FAULTS = "drops=0.1,duplicates=0.1,stale=0.1,half_lines=0.1,clock_steps=0.1,reconnects=0.1"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with short scenarios."""
    monkeypatch.chdir(tmp_path)
    for name in ("straight", "survey"):
        shortened(name, Path(f"{name}.toml"), 25.0)


def test_a_file_has_the_same_bytes_each_time_and_its_record(tmp_path: Path) -> None:
    """At any speed; the record of what was sent has a row a ping, with its faults."""
    for name, speed in (("one", "max"), ("two", "40")):
        start = time.monotonic()
        done = bottomlock(
            *RUN, "--dvl", f"file:{tmp_path / name}", "--faults", FAULTS, "--speed", speed, "--seed", "9",
            "--truth", tmp_path / f"{name}.parquet",
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert f"dvl: waterlinked-json on file:{tmp_path / name}" in done.stdout
        assert "20 pings, " in done.stdout
    # 19 s from the first ping to the last, at 40 times the pace.
    assert time.monotonic() - start > 19 / 40
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    said = pl.read_parquet(tmp_path / "one.parquet")
    assert said.equals(pl.read_parquet(tmp_path / "two.parquet"))
    assert said.height == 20
    assert said["bytes"].sum() == (tmp_path / "one").stat().st_size
    assert {"drops", "stale"} <= set("+".join(said["faults"]).split("+"))
    assert said["beam1_valid"].all()
    assert not said["beam3_valid"].any()


def test_a_whole_vehicle_on_one_clock(tmp_path: Path) -> None:
    """DVL, IMU and depth of a run: the times of all begin together, at the time that was asked."""
    succeeded(
        "simulate-dvl", "survey.toml", "--duration-s", "3", "--speed", "max", "--clock", "2026-02-03T04:05:06",
        "--dvl", f"file:{tmp_path / 'dvl'}", "--imu", f"file:{tmp_path / 'imu'}",
        "--depth", f"file:{tmp_path / 'depth'}",
    )  # fmt: skip
    base_s = 1_770_091_506
    imu = [line.split(",") for line in (tmp_path / "imu").read_text().splitlines()]
    depth = [line.split(",") for line in (tmp_path / "depth").read_text().splitlines()]
    pings = read_recording(tmp_path / "dvl").table
    assert {len(line) for line in imu} == {7}
    assert {len(line) for line in depth} == {2}
    # Around -g: forward, right, down.
    assert float(imu[0][6]) == pytest.approx(-9.8, abs=0.3)
    for time_ns in (int(imu[0][0]), int(depth[0][0]), int(pings.time_ns[0])):
        assert 0 <= time_ns - base_s * 10**9 <= 10**9
