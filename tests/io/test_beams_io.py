"""Ping logs and instrument files: what is read, and how a fault is named."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError, ScenarioError
from bottomlock.io.beams import Columns, read_beams, read_geometry

HEADER = "time_ns,beam1_mps,beam2_mps,beam1_valid,beam2_valid\n"


def log(tmp_path: Path, *lines: str, header: str = HEADER) -> Path:
    """A CSV log."""
    path = tmp_path / "log.csv"
    path.write_text(header + "".join(f"{line}\n" for line in lines), encoding="utf-8")
    return path


def test_reads_csv_and_parquet_alike(tmp_path: Path) -> None:
    """The same pings in both forms; a lost beam may be empty or NaN."""
    path = log(tmp_path, "1,0.5,,1,0", "2,0.5,nan,true,FALSE")
    pings = read_beams(path, beams=2)
    assert pings.time_ns.tolist() == [1, 2]
    assert pings.valid.tolist() == [[True, False], [True, False]]
    frame = pl.DataFrame(
        {"time_ns": [1, 2], "beam1_mps": [0.5, 0.5], "beam2_mps": [None, None], "beam1_valid": [True, True]},
        schema_overrides={"beam2_mps": pl.Float64},
    ).with_columns(pl.lit(value=False).alias("beam2_valid"))
    frame.write_parquet(tmp_path / "log.parquet")
    other = read_beams(tmp_path / "log.parquet", beams=2)
    assert np.array_equal(other.velocity_mps, pings.velocity_mps, equal_nan=True)
    assert np.array_equal(other.valid, pings.valid)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("1,0.5,0.1,1,1", "1,0.5,0.1,1,1"), "row 1: column 'time_ns' is 1 ns and repeats the time of row 0"),
        (
            ("5,0.5,0.1,1,1", "1,0.5,0.1,1,1"),
            "row 1: column 'time_ns' is 1 ns and goes back in time from that of row 0",
        ),
        (("1,0.5,nan,1,1",), "row 0: column 'beam2_mps' is not finite, but beam 2 is flagged valid"),
        (("1,0.5,inf,1,1",), "row 0: column 'beam2_mps' is not finite"),
        (("1,0.5,fast,1,1",), "row 0: column 'beam2_mps' is 'fast', expected a number"),
        (("1,0.5,0.1,1,2",), "row 0: column 'beam2_valid' is 2.0, expected 0, 1, true or false"),
        (("1.5,0.5,0.1,1,1",), "row 0: column 'time_ns' is '1.5', expected a number"),
        ((",0.5,0.1,1,1",), "row 0: column 'time_ns' has no time"),
        ((), "has no rows"),
    ],
)
def test_faults_name_row_and_column(tmp_path: Path, lines: tuple[str, ...], message: str) -> None:
    """Nothing is repaired silently."""
    with pytest.raises(DataError) as caught:
        read_beams(log(tmp_path, *lines), beams=2)
    assert message in str(caught.value)
    assert "log.csv" in str(caught.value)


def test_time_units(tmp_path: Path) -> None:
    """Seconds become integer nanoseconds."""
    path = log(tmp_path, "1.5,0.5,0.1,1,1", header=HEADER.replace("time_ns", "t"))
    assert read_beams(path, beams=2, columns=Columns(time="t", time_unit="s")).time_ns.tolist() == [
        1_500_000_000
    ]


def test_geometry_files(tmp_path: Path) -> None:
    """Every configuration loads, and a direction that is none is named."""
    path = tmp_path / "g.toml"

    def write(text: str) -> Path:
        path.write_text(text, encoding="utf-8")
        return path

    assert read_geometry("x_janus_20").geometry.beams == 4
    three = "configuration = 'angles'\ntilts_deg = [25, 25, 25]\nazimuths_deg = [0, 120, 240]\nbeam_noise_mps = 0.01\n"
    assert read_geometry(write(three)).beam_sd_mps.tolist() == [0.01] * 3
    given = (
        "configuration = 'directions'\ndirections = [[0, 0, 1], [1, 0, 0]]\nbeam_noise_mps = [0.01, 0.02]\n"
    )
    assert read_geometry(write(given)).beam_sd_mps.tolist() == [0.01, 0.02]
    with pytest.raises(ScenarioError, match="beam 1"):
        read_geometry(write(given.replace("[0, 0, 1]", "[0, 0, 2]")))
