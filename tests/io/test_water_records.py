"""Readers of what the water returned: layouts by hand, signs and literal readings of recordings, live and recorded."""

import struct
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.encoders.framing import nortek_frame, waterlinked_sentence
from bottomlock.errors import DataError
from bottomlock.io import nortek_ad2cp, nortek_dvl, nucleus, pd0, waterlinked_json, waterlinked_serial
from bottomlock.io.beam_table import (
    Recording,
    WaterTable,
    read_account,
    read_water_table,
    water_file,
    write_recording,
)
from bottomlock.io.formats import read_recording
from bottomlock.io.rows import Options
from bottomlock.live.readings import PingReader
from tools import reader_seeds as seeds


def water_of(recording: Recording) -> WaterTable:
    assert recording.water is not None
    return recording.water


def test_pd0_profile() -> None:
    """Cells of 2 m from 3.5 m below, along beams of 20 degrees; the signs of the bottom; a mark for none."""
    log = seeds.pd0_ensemble(1, cells=[(100, -200, 300, -400), (50, 60, -32768, 80)])
    log += seeds.pd0_ensemble(2, cells=[(1, 2, 3, 4)])
    recording = pd0.FORMAT.read(log, "log")
    water = water_of(recording)
    assert water.time_ns.tolist() == np.repeat(recording.table.time_ns, [2, 1]).tolist()
    assert water.cell.tolist() == [1, 2, 1]
    np.testing.assert_allclose(water.range_m * np.cos(np.radians(20.0)), [3.5, 5.5, 3.5])
    np.testing.assert_allclose(water.velocity_mps[0], [0.1, -0.2, 0.3, -0.4])
    np.testing.assert_allclose(water.velocity_mps[1], [0.05, 0.06, np.nan, 0.08])
    assert water.valid.tolist() == [[True] * 4, [True, True, False, True], [True] * 4]
    assert water.quality[:2].tolist() == [[100, 101, 102, 103], [104, 105, 106, 107]]
    turned = water_of(pd0.FORMAT.read(log, "log", Options(negate_beams=True)))
    np.testing.assert_array_equal(turned.velocity_mps, -water.velocity_mps)


def test_pd0_water_mass_layer() -> None:
    """The layer from 8 m to 16 m is cell 1 where there is no profile; a profile stands in its place."""
    layer = seeds.pd0_ensemble(1, layer=(10, -32768, -30, 40))
    water = water_of(pd0.FORMAT.read(layer + seeds.pd0_ensemble(2), "log"))
    assert water.cell.tolist() == [1]
    np.testing.assert_allclose(water.range_m * np.cos(np.radians(20.0)), [12.0])
    np.testing.assert_allclose(water.velocity_mps, [[0.01, np.nan, -0.03, 0.04]])
    assert water.quality.tolist() == [[90, 91, 92, 93]]
    both = seeds.pd0_ensemble(1, layer=(10, 20, 30, 40), cells=[(1, 2, 3, 4)])
    np.testing.assert_allclose(
        water_of(pd0.FORMAT.read(both, "log")).velocity_mps, [[0.001, 0.002, 0.003, 0.004]]
    )


def test_pd0_without_water() -> None:
    """None without a profile, and in other coordinates than those of the beams."""
    assert pd0.FORMAT.read(seeds.pd0_ensemble(1), "log").water is None
    earth = seeds.pd0_ensemble(1, frame=3, cells=[(1, 2, 3, 4)])
    assert pd0.FORMAT.read(earth, "log", Options(instrument_only=True)).water is None


def test_df21_water_track() -> None:
    """Layout of the bottom track; distances are vertical; without one the water is taken at the instrument."""
    log = nortek_frame(0x1D, seeds.df21(1)) + nortek_frame(0x1B, seeds.df21())
    log += nortek_frame(0x1D, seeds.df21(2, status=0xFFFFF & ~0b1111_0100))
    recording = nortek_dvl.FORMAT.read(log, "log")
    water = water_of(recording)
    assert recording.table.rows == 1
    assert (water.time_ns - recording.table.time_ns[0]).tolist() == [10**9, 2 * 10**9]
    np.testing.assert_allclose(water.velocity_mps[0], [0.1, 0.2, 0.3, 0.4], rtol=1e-6)
    np.testing.assert_allclose(water.range_m, [10.15 / np.cos(np.radians(25.0)), 0.0], rtol=1e-6)
    np.testing.assert_allclose(water.sd_mps[0], [0.01, 0.02, 0.03, 0.04], rtol=1e-6)
    assert water.valid.tolist() == [[True] * 4, [True, True, False, True]]
    assert any("without a distance" in note for note in recording.notes)
    with pytest.raises(DataError, match="no bottom-track record"):
        nortek_dvl.FORMAT.read(nortek_frame(0x1D, seeds.df21()), "log")


def test_nucleus_water_track() -> None:
    """The same of three beams, whose distances are kept."""
    log = nortek_frame(0xBE, seeds.nucleus(), 0x20) + nortek_frame(0xB4, seeds.nucleus(1), 0x20)
    recording = nucleus.FORMAT.read(log, "log")
    water = water_of(recording)
    assert (recording.table.time_ns - water.time_ns).tolist() == [10**9]
    np.testing.assert_allclose(water.velocity_mps, [[0.1, 0.2, 0.3]], rtol=1e-6)
    np.testing.assert_allclose(water.range_m, [5.1], rtol=1e-6)
    np.testing.assert_allclose(water.sd_mps, [[0.01, 0.02, 0.03]], rtol=1e-6)


def test_ad2cp_profile() -> None:
    """By beam and cell, scaled; the first cell one cell beyond the blanking; correlations in per cent."""
    log = nortek_frame(0x15, seeds.df3(), 0x10) + nortek_frame(0x17, seeds.df20(1), 0x10)
    recording = nortek_ad2cp.FORMAT.read(log, "log")
    water = water_of(recording)
    assert (recording.table.time_ns[0] - water.time_ns).tolist() == [750_000_000] * 2
    np.testing.assert_allclose(water.velocity_mps, [[0.1, -0.1, 0.05, -0.05], [0.2, 0.05, 0.0, 0.007]])
    np.testing.assert_allclose(water.range_m * np.cos(np.radians(25.0)), [1.5, 2.5])
    np.testing.assert_allclose(water.quality, 204.0)
    averages = log.replace(nortek_frame(0x15, seeds.df3(), 0x10), nortek_frame(0x16, seeds.df3(), 0x10))
    np.testing.assert_array_equal(
        water_of(nortek_ad2cp.FORMAT.read(averages, "log")).velocity_mps, water.velocity_mps
    )


def test_ad2cp_recording(recordings: Path) -> None:
    """A Signature's bursts, read one by one with `struct`: 30 cells of 1 m, blanking 0.1 m."""
    path = recordings / "pd0_nortek_mhkit" / "VelEchoBT01.ad2cp"
    if not path.exists():
        pytest.skip("the recording is not there")
    data, at, expected = path.read_bytes(), 0, []
    while at + 10 <= len(data):
        sync, header, kind, _, size = struct.unpack_from("<4BH", data, at)
        assert sync == 0xA5
        start = at + header
        if kind == 0x15 and start + size <= len(data):
            velocities = struct.unpack_from("<120h", data, start + data[start + 1])
            expected += [[velocities[beam * 30 + cell] * 1e-3 for beam in range(4)] for cell in range(30)]
        at = start + size
    water = water_of(read_recording(path))
    assert water.rows == len(expected) == 4800
    np.testing.assert_allclose(water.velocity_mps, expected, atol=1e-12)
    np.testing.assert_allclose(water.range_m[:2] * np.cos(np.radians(25.0)), [1.1, 2.1])


def test_ship_and_water_go_the_same_way(recordings: Path) -> None:
    """A ship's PD0 in beam coordinates: on the beams along its way bottom and water agree in sign and size."""
    path = recordings / "pd0_nortek_mhkit" / "vmdas02_os.ENR"
    if not path.exists():
        pytest.skip("the recording is not there")
    recording = read_recording(path)
    water, bottom = water_of(recording), recording.table
    for cell in (1, 2, 3):
        chosen = water.cell == cell
        assert chosen.sum() == bottom.rows
        for beam in (2, 3):
            both = water.valid[chosen, beam] & bottom.valid[:, beam]
            over_ground, through = bottom.velocity_mps[both, beam], water.velocity_mps[chosen, beam][both]
            assert np.corrcoef(over_ground, through)[0, 1] > 0.98
            assert np.polyfit(over_ground, through, 1)[0] == pytest.approx(1.03, abs=0.05)


def test_waterlinked_json_water() -> None:
    """A report of the water is a ping without the bottom, and cell 1, 3 m below; the instrument's velocity is not."""
    log = seeds.a50_report(0, version="json_v3.2", tracking_mode="bottom")
    log += seeds.a50_report(5, version="json_v3.2", type="velocity_water", tracking_mode="water", lost=[1])
    recording = waterlinked_json.FORMAT.read(log, "log")
    water, table = water_of(recording), recording.table
    assert water.time_ns.tolist() == [table.time_ns[1]]
    np.testing.assert_allclose(water.velocity_mps[0, [0, 2, 3]], [0.005, 0.205, 0.305])
    assert water.valid.tolist() == [[True, False, True, True]]
    np.testing.assert_allclose(water.range_m * np.cos(np.radians(22.5)), 3.0)
    assert table.beams_valid.tolist() == [4, 0]
    assert np.isnan(table.velocity_mps[1]).all()
    assert np.isnan(table.instrument_mps[1]).all()
    assert table.instrument_valid.tolist() == [1, 0]
    flagged = recording.account.flagged["velocity through the water: no beam has the bottom"]
    assert (flagged.count, flagged.first) == (1, 2)


def test_waterlinked_serial_water() -> None:
    """`wrs` with its four `wru`; the maker's own example of it; a `wrs` with other fields is none."""
    recording = waterlinked_serial.FORMAT.read(seeds.water_report(1, lost=[3]) + seeds.water_report(2), "log")
    water = water_of(recording)
    assert water.time_ns.tolist() == recording.table.time_ns.tolist() == [501_000_000, 1_001_000_000]
    np.testing.assert_allclose(water.velocity_mps[0], [-0.199, -0.099, 0.001, 0.0], atol=1e-12)
    assert water.valid.tolist() == [[True, True, True, False], [True] * 4]
    assert not recording.table.valid.any()
    assert np.isnan(recording.table.instrument_mps).all()
    documented = b"wrs,0.120,-0.400,2.000,y,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1"
    other = waterlinked_sentence(b"wrs,1,2,3") + waterlinked_sentence(documented)
    recording = waterlinked_serial.FORMAT.read(other + seeds.water_report(1), "log")
    assert recording.account.other["wrs (no velocity through the water)"].count == 1
    assert recording.account.skipped == {}
    assert recording.table.time_ns.tolist() == [7000, 501_000_000]
    assert water_of(recording).valid.any(axis=1).tolist() == [False, True]


def write(folder: Path, log: bytes) -> Path:
    source, out = folder / "log.bin", folder / "beams.parquet"
    source.write_bytes(log)
    write_recording(read_recording(source), out, source=source)
    return out


def test_written_beside_the_beams(tmp_path: Path) -> None:
    """And held against the account, which is that of both; an account without water knows nothing of the user's own."""
    layers = nortek_frame(0x1B, seeds.df21()) + nortek_frame(0x1D, seeds.df21(1, status=0xFFFFF & ~2))
    for form, log in (
        (nortek_dvl.FORMAT, layers),
        (pd0.FORMAT, seeds.pd0_ensemble(1, cells=[(1, 2, 3, 4), (5, -32768, 7, 8)])),
    ):
        out = write(tmp_path, log)
        water = water_file(out)
        for name, values in vars(water_of(form.read(log, "log"))).items():
            np.testing.assert_array_equal(getattr(read_water_table(water), name), values, err_msg=name)
    assert set(read_account(out)["digests"]) == {"beams.parquet", "beams_water.parquet"}
    frame = pl.read_parquet(water)
    frame.with_columns(beam1_mps=pl.lit(9.0)).write_parquet(water)
    with pytest.raises(
        DataError, match=r"beams_water.parquet: has changed since `bottomlock convert` wrote it"
    ):
        read_water_table(water)
    # Converted anew from a log without water: the table of the other conversion would be taken for its own.
    write(tmp_path, seeds.pd0_ensemble(1))
    assert not water.exists()
    frame.write_parquet(water)
    assert read_water_table(water).rows == 2
    write(tmp_path, seeds.pd0_ensemble(2))
    assert water.exists()


def live(name: str, beams: int, log: bytes) -> list[tuple[int, list[float]]]:
    """Of each ping: how many beams are valid, and the times of its water relative to it, s."""
    found = []
    for ping in PingReader(name, beams).feed(log):
        water = [] if ping.water is None else ((ping.water.time_ns - ping.time_ns) * 1e-9).tolist()
        found.append((int(ping.valid.sum()), [round(one, 6) for one in water]))
    return found


def test_live_water_in_the_record_of_the_bottom() -> None:
    pings = live("pd0", 4, seeds.pd0_ensemble(1, cells=[(1, 2, 3, 4), (5, 6, 7, 8)]) + seeds.pd0_ensemble(2))
    assert pings == [(4, [0.0, 0.0]), (4, [])]
    json = seeds.a50_report(0, version="json_v3.2", type="velocity_water")
    assert live("waterlinked-json", 4, json) == [(0, [0.0])]
    serial = live("waterlinked-serial", 4, seeds.water_report(1) + seeds.water_report(2))
    assert serial == [(0, [0.0]), (0, [0.0])]


def test_live_water_in_a_record_of_its_own() -> None:
    """It comes with the next ping of the bottom, at its own time."""
    log = nortek_frame(0x1B, seeds.df21()) + nortek_frame(0x1D, seeds.df21(1))
    log += (
        nortek_frame(0x1D, seeds.df21(2))
        + nortek_frame(0x1B, seeds.df21(3))
        + nortek_frame(0x1B, seeds.df21(4))
    )
    assert live("nortek-dvl", 4, log) == [(4, []), (4, [-2.0, -1.0]), (4, [])]
    log = nortek_frame(0xBE, seeds.nucleus(), 0x20) + nortek_frame(0xB4, seeds.nucleus(1), 0x20)
    assert live("nucleus", 3, log) == [(3, [-1.0])]
    log = nortek_frame(0x15, seeds.df3(), 0x10) + nortek_frame(0x17, seeds.df20(1), 0x10)
    assert live("nortek-ad2cp", 4, log) == [(4, [-0.75, -0.75])]


def test_live_water_is_held_for_a_while_only() -> None:
    """Of many records without a ping of the bottom the last sixteen."""
    log = b"".join(nortek_frame(0x1D, seeds.df21(k)) for k in range(40)) + nortek_frame(0x1B, seeds.df21(41))
    ((_, water),) = live("nortek-dvl", 4, log)
    assert len(water) == 16
    assert water[-1] == pytest.approx(-2.0)
