"""Recordings that may not be republished: read whole, counted as described, signs as found there."""

from pathlib import Path

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.io.beams import read_geometry
from bottomlock.io.formats import detect, read_recording
from bottomlock.io.rows import Options
from bottomlock.kernel import solve_velocity

pytestmark = pytest.mark.recordings
KEEP = Options(keep_stale=True)


def file(recordings: Path, folder: str, name: str) -> Path:
    """A recording; skips where this one is absent."""
    path = recordings / folder / name
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    return path


@pytest.mark.parametrize(
    ("name", "reports", "beams", "valid", "stale"),
    [
        ("out20210528.txt", 250, [0, 0, 0, 1, 249], 0.996, 16),
        ("out20210528_circle.txt", 662, [7, 0, 1, 9, 645], 0.914, 59),
        ("out20210528_straight+turn360.txt", 342, [0, 0, 0, 0, 342], 0.971, 22),
        ("out_still_60s.txt", 674, [0, 0, 0, 0, 674], 1.0, 621),
    ],
)
def test_a50_counts(
    recordings: Path, name: str, reports: int, beams: list[int], valid: float, stale: int
) -> None:
    """Reports, valid beams, the instrument's verdict and stale repeats; nothing is lost."""
    path = file(recordings, "a50_waterlinked_json", name)
    assert detect(path) == "waterlinked-json"
    recording = read_recording(path, options=KEEP)
    table = recording.table
    assert table.rows == recording.account.read == reports
    assert recording.account.lost == 0
    assert np.bincount(table.beams_valid, minlength=5).tolist() == beams
    assert (table.instrument_valid == 1).mean() == pytest.approx(valid, abs=5e-4)
    assert recording.account.flagged["stale repeat"].count == stale
    without = read_recording(path).table
    assert without.stale is not None
    assert without.stale.sum() == stale
    assert not without.valid[without.stale].any()


def test_a50_signs(recordings: Path) -> None:
    """The packaged geometry gives the instrument's own velocity from its beams: 2 cm/s in the 95th percentile.

    The firmware filters and weights, so the agreement is no better than a few mm/s in the middle. A wrong sign or order
    of beams is off by the speed itself.
    """
    path = file(recordings, "a50_waterlinked_json", "out20210528_circle.txt")
    recording = read_recording(path)
    table = recording.table
    instrument = read_geometry(recording.geometry)
    asked = table.valid.all(axis=1) & (table.instrument_valid == 1)
    fixes = solve_velocity(
        instrument.geometry, table.velocity_mps, table.valid, method="lc", beam_sd_mps=instrument.beam_sd_mps
    )
    away = np.linalg.norm(fixes.velocity_p_mps - table.instrument_mps, axis=1)[asked]
    speed = np.linalg.norm(table.instrument_mps[asked], axis=1)
    assert np.median(away) < 0.005
    assert np.quantile(away, 0.95) < 0.02
    assert np.quantile(speed, 0.95) > 0.1


def test_caves_counts(recordings: Path) -> None:
    """The first half of the caves: 2,782 pings on 977 s, and the shares of the whole."""
    path = file(recordings, "caves_girona_linkquest", "dvl_linkquest.csv")
    assert detect(path) == "linkquest-csv"
    recording = read_recording(path)
    table = recording.table
    assert table.rows == recording.account.read == path.read_bytes().count(b"\n") - 1
    assert recording.account.lost == 0
    counts = np.bincount(table.beams_valid, minlength=5)
    assert counts[:2].sum() == 0
    assert counts[4] / table.rows == pytest.approx(0.862, abs=0.03)
    lost = ~table.valid
    assert (table.velocity_mps[lost] == 0.0).all(), "a lost beam reads exactly 0, and is kept so"
    assert np.isnan(table.range_m[lost]).mean() == pytest.approx(0.78, abs=0.1)


def test_pd0_in_beam_coordinates(recordings: Path) -> None:
    """Pings by the number of beams, and nothing skipped."""
    recording = read_recording(file(recordings, "pd0_nortek_mhkit", "vmdas02_os.ENR"))
    assert np.bincount(recording.table.beams_valid, minlength=5).tolist() == [0, 0, 1, 0, 689]
    assert recording.account.lost == 0
    assert not recording.account.other


@pytest.mark.parametrize(
    ("folder", "name", "frame", "solutions"),
    [
        ("pd0_nortek_mhkit", "winriver02_transect.PD0", "ship", (563, 47, 221)),
        ("pd0_nortek_mhkit", "RDI_withBT.000", "earth", (898, 3, 820)),
        ("pd0_ooi_glider", "LA101636.PD0", "earth", (51, 7, 1)),
    ],
)
def test_pd0_in_other_coordinates(
    recordings: Path, folder: str, name: str, frame: str, solutions: tuple[int, int, int]
) -> None:
    """Rejected with the number of pings and what to set; the instrument's velocity of four, three and no beams."""
    path = file(recordings, folder, name)
    with pytest.raises(DataError, match=rf"{sum(solutions)} pings in {frame} coordinates .*EX00000"):
        read_recording(path)
    recording = read_recording(path, options=Options(instrument_only=True))
    known = recording.table.instrument_valid == 1
    four = known & np.isfinite(recording.table.extra["error_velocity_mps"])
    assert (four.sum(), (known & ~four).sum(), (~known).sum()) == solutions


def test_ad2cp_without_bottom(recordings: Path) -> None:
    """159 bottom-track records, invalid throughout; other records counted, the cut end told."""
    recording = read_recording(file(recordings, "pd0_nortek_mhkit", "VelEchoBT01.ad2cp"))
    assert recording.format == "nortek-ad2cp"
    assert (recording.table.rows, recording.table.valid.sum()) == (159, 0)
    assert recording.account.skipped["truncated"].count == 1
    assert {name: one.count for name, one in recording.account.other.items()} == {
        "text": 1,
        "interleaved burst": 160,
        "burst profile": 160,
        "echo sounder": 159,
    }
