"""The command `bottomlock audit`: what it writes, what it says, and how it rejects."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.io.beams import read_geometry
from tests.audit.synthetic import channels, janus, make_log, stale, table
from tests.cli.calls import command as bottomlock
from tests.cli.calls import refused, succeeded


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """Beams 1 and 2 swapped, and sixteen stale pings."""
    path = tmp_path / "dive.parquet"
    table(stale(channels(make_log(1), [1, 0, 2, 3]), list(range(300, 348, 3)))).write_parquet(path)
    return path


def test_what_is_written_and_said(planted: Path, tmp_path: Path) -> None:
    out, toml = tmp_path / "out", tmp_path / "found.toml"
    done = bottomlock("audit", planted, "--geometry", "x_janus_20", "--out", out, "--write", toml)
    assert done.returncode == 0, done.stderr
    assert "channel 1 is beam 2, channel 2 is beam 1" in " ".join(done.stdout.split())
    assert "16 pings" in done.stdout
    found = json.loads((out / "audit.json").read_text())
    kinds = [one["kind"] for one in found["findings"]]
    # Stated 20°, found 22°; the order is wrong as well.
    assert kinds == ["swapped_beams", "mistilted_beam", "stale_pings"]
    np.testing.assert_allclose(np.rad2deg(found["matrix"]["tilt_rad"]), 22.0, atol=0.02)
    assert pl.read_parquet(out / "findings.parquet").height == len(kinds)
    assert found["match"]["beam"] == [2, 1, 3, 4]
    names = ("closure", "curves")
    for name in names:
        assert (out / f"{name}.png").stat().st_size > 5000
        assert (out / f"{name}.svg").read_text().startswith("<?xml")
    page = (out / "audit.html").read_text()
    links = set(re.findall(r'<a href="([\w.]+)">', page))
    assert links == {f"{name}.{end}" for name in names for end in ("png", "svg")}
    assert all((out / link).is_file() for link in links)
    assert page.count('<svg role="img"') == 2
    assert "http://" not in page.replace("http://www.w3.org", "")


@pytest.mark.usefixtures("undrawn")
def test_the_geometry_that_is_written_is_read(planted: Path, tmp_path: Path) -> None:
    """`bottomlock fix` takes it, and solves what the instrument solved."""
    toml = tmp_path / "found.toml"
    succeeded("audit", planted, "--out", tmp_path / "out", "--write", toml)
    instrument = read_geometry(toml)
    np.testing.assert_allclose(instrument.geometry.directions_p, janus()[[1, 0, 2, 3]], atol=3e-4)
    assert instrument.beam_sd_mps == pytest.approx(0.01, rel=0.15)
    fixes = tmp_path / "fixes.parquet"
    succeeded("fix", planted, "--geometry", toml, "--method", "lc", "--out", fixes)
    own = pl.read_parquet(planted)["instrument_x_mps"].to_numpy()
    assert np.abs(pl.read_parquet(fixes)["surge_mps"].to_numpy() - own).max() < 2e-3


@pytest.mark.usefixtures("undrawn")
def test_columns_of_a_geometry_file_are_used_and_handed_on(tmp_path: Path) -> None:
    log = make_log(2)
    names = {f"beam{k + 1}_mps": f"radial{k}" for k in range(4)}
    table(log).rename(names).with_columns(time_ns=pl.col("time_ns") * 1e-9).rename(
        {"time_ns": "t"}
    ).write_csv(tmp_path / "log.csv")
    (tmp_path / "mine.toml").write_text(
        'configuration = "x"\ntilt_deg = 22.0\nbeam_noise_mps = 0.02\n[columns]\ntime = "t"\ntime_unit = "s"\n'
        'velocity = ["radial0", "radial1", "radial2", "radial3"]\n'
        'valid = ["beam1_valid", "beam2_valid", "beam3_valid", "beam4_valid"]\n'
    )
    found = tmp_path / "found.toml"
    words = ["audit", "log.csv", "--geometry", "mine.toml", "--out", "out", "--write", "found.toml"]
    done = bottomlock(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "No finding." in done.stdout
    assert tomllib.loads(found.read_text())["columns"]["velocity"] == [f"radial{k}" for k in range(4)]


def test_refusals(planted: Path, tmp_path: Path) -> None:
    """One line that names the place, exit code 2, nothing written."""
    alone = tmp_path / "alone.parquet"
    pl.read_parquet(planted).drop("instrument_x_mps", "instrument_y_mps", "instrument_z_mps").write_parquet(
        alone
    )
    out, toml = tmp_path / "none", tmp_path / "g.toml"
    for arguments, words in (
        ((planted, "--write", tmp_path / "g.txt", "--out", out), "ends in .toml"),
        ((alone, "--write", toml, "--out", out), "9 of 12 entries free"),
        (
            (alone, "--geometry", "x_janus_20", "--write", toml, "--out", out),
            "closure cannot distinguish the orders",
        ),
        ((planted, "--attitude", planted, "--out", out), "column 'roll_rad' is missing"),
    ):
        said = refused("audit", *arguments)
        assert words in " ".join(said.split())
        assert "Traceback" not in said
    assert not out.exists()
    assert not toml.exists()
