"""Readers of binary records: layouts by hand, checksums, damaged files, signs."""

import datetime as dt
import math

import numpy as np
import pytest

from bottomlock.encoders import framing
from bottomlock.errors import DataError
from bottomlock.io import nortek_ad2cp, nortek_dvl, nucleus, pd0, wayfinder
from bottomlock.io.account import Account
from bottomlock.io.binary_records import Binary
from bottomlock.io.nortek_frames import FRAMING
from bottomlock.io.rows import Options
from tools import reader_seeds as seeds


def test_pd0_beams() -> None:
    """Beam coordinates: mm/s as they stand, range 0 is none, attitude and clock from the variable leader."""
    recording = pd0.FORMAT.read(
        seeds.pd0_ensemble(1) + seeds.pd0_ensemble(2, velocity=(100, -32768, 250, -250)), "log"
    )
    table = recording.table
    np.testing.assert_allclose(table.velocity_mps[0], [0.1, -0.1, 0.25, -0.25])
    assert table.valid.tolist() == [[True] * 4, [True, False, True, True]]
    np.testing.assert_allclose(table.range_m[0], [10.0, 10.1, 10.2, np.nan])
    assert table.quality[0].tolist() == [200.0, 201.0, 202.0, 203.0]
    np.testing.assert_allclose(np.degrees(table.extra["heading_rad"]), 90.0)
    np.testing.assert_allclose(np.degrees(table.extra["roll_rad"]), -2.5)
    # 7 April 2021 13:13:00.5 and 13:13:01.
    assert table.time_ns.tolist() == [1_617_801_180_500_000_000, 1_617_801_181_000_000_000]
    assert recording.geometry == "teledyne_20"


def test_pd0_high_resolution() -> None:
    """0x5803 refines 0x0600 in 0.01 mm/s, and does not bring back a beam that 0x0600 calls bad."""
    fine = (10_012, -10_034, 25_056, -3_276_800)
    table = pd0.FORMAT.read(seeds.pd0_ensemble(1, velocity=(100, -32768, 250, -250), fine=fine), "log").table
    np.testing.assert_allclose(table.velocity_mps[0], [0.10012, np.nan, 0.25056, np.nan])
    assert table.valid.tolist() == [[True, False, True, False]]


@pytest.mark.parametrize(("frame", "code"), [(1, "EX01"), (2, "EX10"), (3, "EX11")])
def test_pd0_without_beams(frame: int, code: str) -> None:
    """Other coordinates are rejected with advice, or give the vehicle's velocity on request."""
    data = seeds.pd0_ensemble(1, frame=frame, velocity=(100, -200, 50, 7))
    data += seeds.pd0_ensemble(2, frame=frame, velocity=(100, -200, 50, -32768))
    with pytest.raises(
        DataError, match=rf"{code}xxx\) hold no beam velocities; set the instrument to beam coordinates"
    ):
        pd0.FORMAT.read(data, "log")
    recording = pd0.FORMAT.read(data, "log", Options(instrument_only=True))
    assert recording.table.beams == 0
    # The bottom goes 0.1 to starboard or east, 0.2 aft or south, 0.05 up: the vehicle the other way.
    np.testing.assert_allclose(recording.table.instrument_mps, [[0.2, -0.1, 0.05]] * 2)
    np.testing.assert_allclose(recording.table.extra["error_velocity_mps"], [0.007, np.nan])
    assert recording.frame == ("ned" if frame == 3 else "frd")


def test_pd0_damage_is_counted() -> None:
    """A flipped bit, bytes between, a lost piece and a cut end: each with its place; the others are read."""
    one = seeds.pd0_ensemble(1)
    flipped = bytearray(seeds.pd0_ensemble(2))
    flipped[100] ^= 1
    short = seeds.pd0_ensemble(3)[:-40]
    data = one + bytes(flipped) + b"$GPGGA" + short + seeds.pd0_ensemble(4) + seeds.pd0_ensemble(5)[:70]
    recording = pd0.FORMAT.read(data, "log")
    size = len(one)
    assert recording.table.rows == 2
    skipped = {name: (r.count, r.first) for name, r in recording.account.skipped.items()}
    assert skipped == {
        "bad checksum": (2, size),
        "bytes that belong to no ensemble": (1, 2 * size),
        "truncated": (1, 2 * size + 6 + len(short) + size),
    }
    assert recording.account.read == 5


def test_pd0_without_bottom_track() -> None:
    """Ensembles of water profiles alone: what to switch on; among others they are counted."""
    water = seeds.pd0_ensemble(1, bottom=False)
    with pytest.raises(DataError, match=r"none of 1 ensembles has bottom track.*\(BP1\)"):
        pd0.FORMAT.read(water, "log")
    account = pd0.FORMAT.read(water + seeds.pd0_ensemble(2), "log").account
    assert account.other["ensemble without bottom track"].count == 1


def test_df21() -> None:
    """Beams, axes and their figures of merit; distances are vertical; a lost beam by its status bit."""
    data = framing.nortek_frame(0x1B, seeds.df21()) + framing.nortek_frame(
        0x1B, seeds.df21(1, status=0xFFFFF & ~0b10_0010)
    )
    recording = nortek_dvl.FORMAT.read(data, "log")
    table = recording.table
    # 1 May 2021 00:00:10.25: months count from 0, years from 1900.
    assert table.time_ns.tolist() == [1_619_827_210_250_000_000, 1_619_827_211_250_000_000]
    np.testing.assert_allclose(table.velocity_mps[0], [0.1, 0.2, 0.3, 0.4], rtol=1e-6)
    np.testing.assert_allclose(
        table.range_m[0] * math.cos(math.radians(25)), [10, 10.1, 10.2, 10.3], rtol=1e-6
    )
    assert table.valid.tolist() == [[True] * 4, [True, False, True, True]]
    assert math.isnan(table.range_m[1, 1])
    np.testing.assert_allclose(table.instrument_mps[0], [1.0, -0.5, 0.25], rtol=1e-6)
    np.testing.assert_allclose(table.extra["beam1_delay_s"], 0.013, rtol=1e-6)
    invalid = framing.nortek_frame(0x1B, seeds.df21(velocity=(0.1, -32.768, 0.3, 0.4), status=0))
    table = nortek_dvl.FORMAT.read(invalid, "log").table
    assert not table.valid.any()
    assert math.isnan(table.velocity_mps[0, 1])
    assert table.instrument_valid.tolist() == [0]


def test_df21_beside_other_records() -> None:
    """Water track is counted, not mixed in; a damaged record and one of another layout too."""
    broken = bytearray(framing.nortek_frame(0x1B, seeds.df21(2)))
    broken[60] ^= 4
    data = framing.nortek_frame(0x1D, seeds.df21()) + bytes(broken) + b"\xa5\x0a"
    data += framing.nortek_frame(0x1B, bytes(20)) + framing.nortek_frame(0x1B, seeds.df21(3))
    account = nortek_dvl.FORMAT.read(data, "log").account
    assert account.other["water track"].count == 1
    assert {name: r.count for name, r in account.skipped.items()} == {
        "bad checksum": 1,
        "bytes that belong to no record": 1,
        "bottom track of another layout": 1,
    }


def test_a_sign_that_goes_against_the_instrument_is_told() -> None:
    """Beams whose mean goes against z, with z to the bottom: the note names the option that turns them."""
    falling = [
        framing.nortek_frame(0x1B, seeds.df21(k, velocity=[-0.1 * k] * 4, axes=(0, 0, 0.1 * k, 0.1 * k)))
        for k in range(25)
    ]
    notes = nortek_dvl.FORMAT.read(b"".join(falling), "log").notes
    assert any("opposite to the instrument's z" in note for note in notes)
    right = nortek_dvl.FORMAT.read(b"".join(falling), "log", Options(negate_beams=True)).notes
    assert not any("opposite to the instrument's z" in note for note in right)


def test_df20() -> None:
    """A profiler's bottom track: scaled integers; a ping without bottom is four lost beams."""
    data = framing.nortek_frame(0x17, seeds.df20(), 0x10)
    table = nortek_ad2cp.FORMAT.read(data, "log").table
    np.testing.assert_allclose(table.velocity_mps, [[0.1, -0.1, 0.05, -0.05]])
    np.testing.assert_allclose(table.range_m, [[2.0, 2.1, 2.2, 2.3]])
    lost = nortek_ad2cp.FORMAT.read(framing.nortek_frame(0x17, seeds.df20(valid=False), 0x10), "log").table
    assert not lost.valid.any()
    assert np.isnan(lost.velocity_mps).all()


def test_nucleus() -> None:
    """Three beams: two of three valid is partial already."""
    data = framing.nortek_frame(0xB4, seeds.nucleus(), 0x20) + framing.nortek_frame(
        0xB4, seeds.nucleus(1, status=0x7FFD), 0x20
    )
    recording = nucleus.FORMAT.read(data, "log")
    table = recording.table
    assert table.beams == 3
    assert table.time_ns.tolist() == [1_690_000_000_250_000_000, 1_690_000_001_250_000_000]
    assert table.valid.tolist() == [[True] * 3, [True, False, True]]
    np.testing.assert_allclose(table.instrument_mps[0], [1.0, -0.5, 0.25])
    np.testing.assert_allclose(table.sd_mps[0], [0.01, 0.02, 0.03], rtol=1e-6)
    assert "since 1970" in recording.clock


def test_pd0_ranges_beyond_655_m() -> None:
    """The third byte of each range counts 65 536 cm."""
    ensemble = bytearray(seeds.pd0_ensemble(1, ranges=(1000, 1010, 1020, 0)))
    body = bytes(ensemble[:-2])
    track = body.index(b"\x00\x06", 6 + 2 * 3 + 59 + 65)
    bottom = bytearray(body[track:])
    bottom[77:81] = bytes([1, 0, 2, 1])
    types = [body[6 + 2 * 3 : 6 + 2 * 3 + 59], body[6 + 2 * 3 + 59 : track], bytes(bottom)]
    table = pd0.FORMAT.read(framing.pd0_wrap(types), "log").table
    np.testing.assert_allclose(table.range_m[0], [10.0 + 655.36, 10.1, 10.2 + 1310.72, 655.36])


def test_a_record_within_a_record_is_its_data() -> None:
    """Bytes of a whole record are not searched again: a text that quotes a record is no ping."""
    inner = framing.nortek_frame(0x1B, seeds.df21(1))
    log = framing.nortek_frame(0xA0, inner, 0x10) + framing.nortek_frame(0x1B, seeds.df21(2))
    account = Account(unit="byte")
    found = Binary(FRAMING).records(log, account, last=True)
    assert [record[2] for _, record in found] == [0xA0, 0x1B]
    assert (account.read, account.lost) == (2, 0)
    # Where the outer record is damaged, the inner one is found.
    damaged = log[:8] + bytes([log[8] ^ 1]) + log[9:]
    found = Binary(FRAMING).records(damaged, account, last=True)
    assert [start for start, _ in found] == [10, len(inner) + 10]


def summed(data: bytes) -> bytes:
    """With the 16-bit sum of its bytes."""
    return data + (sum(data) & 0xFFFF).to_bytes(2, "little")


def test_what_a_record_states_ends_with_it() -> None:
    """An offset beyond an ensemble, a header that is cut off, a content without its fields: none reads what follows."""
    body = bytearray(seeds.pd0_ensemble(1)[:-2])
    body[10:12] = (len(body) + 6 + 2 * 3 + 59 + 65).to_bytes(2, "little")
    recording = pd0.FORMAT.read(summed(bytes(body)) + seeds.pd0_ensemble(2), "log")
    assert (recording.table.rows, recording.account.lost) == (1, 1)
    assert not FRAMING.of(b"\xa5\x0c" + bytes(9))
    whole = seeds.wayfinder()
    content = summed(whole[9:40])
    short = summed(whole[:3] + (len(content) + 11).to_bytes(2, "little") + whole[5:9] + content)
    recording = wayfinder.FORMAT.read(short + whole, "log")
    assert recording.account.skipped["data of another layout"].count == recording.table.rows == 1


def test_pd0_of_the_other_leaders() -> None:
    """Some instruments mark their leaders 0001h and 0081h."""
    body = bytearray(seeds.pd0_ensemble(1)[:-2])
    first = 6 + 2 * 3
    body[first], body[first + 59] = 1, 0x81
    table = pd0.FORMAT.read(summed(bytes(body)), "log").table
    np.testing.assert_allclose(table.velocity_mps, [[0.1, -0.1, 0.25, -0.25]])


def test_wayfinder() -> None:
    """The structure of the maker's driver: beams with a lost one, kinds passed by, other coordinates, both sums."""
    log = (
        seeds.wayfinder()
        + seeds.wayfinder(3, velocity=(0.1, math.nan, 0.3, 0.4))
        + seeds.wayfinder(4, kind=4)
    )
    recording = wayfinder.FORMAT.read(b"OK" + log, "log")
    table = recording.table
    assert recording.account.other["packet without data"].count == 1
    assert table.valid.tolist() == [[True] * 4, [True, False, True, True]]
    np.testing.assert_allclose(table.velocity_mps[0], [0.1, -0.2, 0.3, -0.4], rtol=1e-6)
    np.testing.assert_allclose(table.range_m[1], [10.0, 10.1, 10.2, 10.3], rtol=1e-6)
    assert np.diff(table.time_ns).tolist() == [300_000_000]
    assert dt.datetime.fromtimestamp(table.time_ns[0] / 1e9, dt.UTC) == dt.datetime(
        2021, 5, 1, 12, 30, 20, tzinfo=dt.UTC
    )
    axes = seeds.wayfinder(coordinates=1)
    with pytest.raises(DataError, match="no beam velocities"):
        wayfinder.FORMAT.read(axes, "log")
    own = wayfinder.FORMAT.read(axes, "log", Options(instrument_only=True))
    assert (own.table.beams, own.frame) == (0, "instrument")
    np.testing.assert_allclose(own.table.instrument_mps, [[0.1, -0.2, 0.3]], rtol=1e-6)
    damaged = bytearray(log)
    damaged[40] ^= 1
    assert wayfinder.FORMAT.read(bytes(damaged), "log").account.skipped["bad checksum"].count == 1
