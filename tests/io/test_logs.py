"""The logs that ship with the project: unchanged, read whole, and their signs against GPS."""

import hashlib
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.io.beams import read_geometry
from bottomlock.io.formats import detect, read_recording
from bottomlock.io.rows import Options
from bottomlock.kernel import solve_velocity
from tests.oracle.pd0 import Literal, literal_ensembles


@pytest.fixture(scope="module")
def logs(root: Path) -> Path:
    """Folder of the logs that ship."""
    return root / "data" / "logs"


def test_logs_are_as_published(logs: Path) -> None:
    """Every file stands in its SHA256SUMS, beside where it comes from and its licence."""
    folders = sorted(path for path in logs.iterdir() if path.is_dir())
    assert len(folders) >= 3
    for folder in folders:
        assert (folder / "PROVENANCE.md").is_file()
        assert list(folder.glob("LICENSE*"))
        sums = dict(line.split()[::-1] for line in (folder / "SHA256SUMS").read_text().splitlines())
        there = {path.name for path in folder.iterdir()} - {"PROVENANCE.md", "SHA256SUMS"}
        assert set(sums) == there
        for name, digest in sums.items():
            assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name


def test_riverpro_against_a_literal_reader(logs: Path) -> None:
    """273 pings in beam coordinates, 270 with four beams: every number as the byte-by-byte reader has it."""
    path = logs / "pd0_riverpro" / "RiverPro_test01.PD0"
    assert detect(path) == "pd0"
    table = read_recording(path).table
    literal = literal_ensembles(path.read_bytes())
    assert table.rows == len(literal) == 273
    assert np.bincount(table.beams_valid, minlength=5).tolist() == [0, 0, 0, 3, 270]
    velocity = np.array([e.velocity_mmps for e in literal], dtype=float)
    np.testing.assert_allclose(
        table.velocity_mps, np.where(velocity == -32768, np.nan, velocity * 1e-3), rtol=1e-12
    )
    ranges = np.array([e.range_cm for e in literal], dtype=float)
    np.testing.assert_allclose(table.range_m, np.where(ranges == 0, np.nan, ranges * 1e-2), rtol=1e-12)


def _gps(ensemble: Literal) -> tuple[float, float] | None:
    """Course (deg) and speed (m/s) of the last VTG in data type 0x2022, as WinRiver packs it."""
    found = None
    for kind, data in ensemble.types:
        if kind == 0x2022 and struct.unpack_from("<H", data, 2)[0] == 105:
            # Fourteen bytes before the sentence: its name, then course, T, course, M, knots, N, km/h, K, mode.
            start = len(data) - 21
            course, kph = (
                struct.unpack_from("<f", data, start)[0],
                struct.unpack_from("<f", data, start + 15)[0],
            )
            if 0.0 <= course <= 360.0 and 0.0 <= kph < 100.0:
                found = (course, kph / 3.6)
    return found


def test_signs_of_pd0_beams_against_gps(logs: Path) -> None:
    """Velocity from the beams by the packaged geometry is that of GPS: sign, beam order and heading.

    A swapped pair of beams mirrors the velocity, a wrong sign turns it by 180°.
    """
    path = logs / "pd0_riverpro" / "RiverPro_test01.PD0"
    recording = read_recording(path)
    table = recording.table
    instrument = read_geometry(recording.geometry)
    fixes = solve_velocity(
        instrument.geometry, table.velocity_mps, table.valid, method="lc", beam_sd_mps=instrument.beam_sd_mps
    )
    heading = table.extra["heading_rad"]
    ours, theirs = [], []
    for k, ensemble in enumerate(literal_ensembles(path.read_bytes())):
        gps = _gps(ensemble)
        if gps is not None and table.valid[k].all():
            ours.append(complex(*fixes.velocity_p_mps[k, :2]) * np.exp(1j * heading[k]))
            theirs.append(gps[1] * np.exp(1j * math.radians(gps[0])))
    assert len(ours) > 150
    v, g = np.array(ours), np.array(theirs)
    gain = np.vdot(g, v) / np.vdot(g, g)
    assert abs(gain) == pytest.approx(1.0, abs=0.03)
    assert abs(np.angle(gain)) < math.radians(10.0), "declination and compass, no more"
    coherence = abs(np.vdot(g, v)) / (np.linalg.norm(g) * np.linalg.norm(v))
    assert coherence > 0.95


def test_glider_in_earth_coordinates(logs: Path) -> None:
    """52 of 107 ensembles have bottom track, none has beams; the instrument's velocity is there for the asking."""
    path = logs / "pd0_glider" / "LA100204.PD0"
    with pytest.raises(DataError, match=r"52 pings in earth coordinates \(EX11xxx\).*EX00000"):
        read_recording(path)
    recording = read_recording(path, options=Options(instrument_only=True))
    literal = [e for e in literal_ensembles(path.read_bytes()) if e.velocity_mmps is not None]
    assert recording.table.rows == len(literal) == 52
    assert recording.account.other["ensemble without bottom track"].count == 55
    known = recording.table.instrument_valid == 1
    four = known & np.isfinite(recording.table.extra["error_velocity_mps"])
    assert (four.sum(), (known & ~four).sum(), (~known).sum()) == (49, 2, 1)
    east, north, up, _ = np.array([e.velocity_mmps for e in literal], dtype=float).T * 1e-3
    expected = np.column_stack([-north, -east, up])
    np.testing.assert_allclose(recording.table.instrument_mps[known], expected[known], atol=1e-12)


def test_glider_with_a_bad_checksum(logs: Path) -> None:
    """The damaged ensemble is told with its place, in the refusal too."""
    with pytest.raises(
        DataError,
        match=r"none of 2 ensembles has bottom track.*skipped: 1 bad checksum \(first at byte 446\)",
    ):
        read_recording(logs / "pd0_glider" / "LB180210_3_corrupted.PD0")


def test_robosub_has_no_beams(logs: Path) -> None:
    """A table of velocities alone: rejected, then converted with a column map."""
    path, columns = logs / "robosub" / "night2_dvl.csv", logs / "robosub" / "columns.toml"
    with pytest.raises(DataError, match=r"'Time,velocityA,velocityB,velocityC', names no documented columns"):
        read_recording(path)
    with pytest.raises(DataError, match=r"no beam velocities.*--instrument-only"):
        read_recording(path, options=Options(columns=str(columns)))
    table = read_recording(path, options=Options(columns=str(columns), instrument_only=True)).table
    assert (table.rows, table.beams) == (436, 0)
    assert np.isfinite(table.instrument_mps).all()
