"""The encoders against what makers document: examples, layouts, marks; and what they reject."""

import json
import struct
from typing import Any

import numpy as np
import pytest

from bottomlock import BeamGeometry
from bottomlock.encoders import framing
from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import FORMATS, encoder
from bottomlock.io.formats import BYTES
from bottomlock.io.rows import PLAIN
from tests.oracle.pd0 import literal_ensembles
from tools import reader_seeds as seeds

NS_2026 = 1_767_225_600_000_000_000
FOUR = BeamGeometry.from_angles([np.deg2rad(20.0)] * 4, np.deg2rad([45.0, 135.0, -135.0, -45.0]))
THREE = BeamGeometry.from_angles([np.deg2rad(20.0)] * 3, np.deg2rad([0.0, 120.0, -120.0]))


def ping(**changed: Any) -> Ping:  # noqa: ANN401 - any field
    """Four beams, the third lost."""
    values: dict[str, Any] = {
        "time_ns": NS_2026,
        "transmission_ns": NS_2026 + 50_000_000,
        "interval_ns": 125_000_000,
        "number": 1,
        "beam_velocity_mps": np.array([0.1, -0.2, np.nan, 0.4]),
        "range_m": np.array([10.0, 11.0, np.nan, 13.0]),
    }
    return Ping(**(values | changed))


def test_water_linked_sentences_are_the_documented_examples() -> None:
    """Every documented line has the checksum that the framing gives its text."""
    for line in (seeds.SERIAL + seeds.SERIAL_OLD).splitlines(keepends=True):
        assert framing.waterlinked_sentence(line.partition(b"*")[0]) == line


def test_water_linked_fields_are_the_documented_examples() -> None:
    """The same numbers give the documented `wru` and, apart from its hot status, the documented `wrz`."""
    covariance = np.array([[1e-7, 0, 1.4], [0, 1.2, 0], [0.2, 0, 1e9]])
    sent = encoder("waterlinked-serial", FOUR).encode(
        ping(
            time_ns=7000,
            transmission_ns=14_000,
            interval_ns=123_000_000,
            number=16,
            beam_velocity_mps=np.array([0.07, -0.5, 2.2, 1.8]),
            range_m=np.array([1.1, 1.25, 1.4, 1.35]),
            velocity_p_mps=np.array([0.12, -0.4, 2.0]),
            covariance_m2ps2=covariance,
            fom_mps=1.855,
            altitude_m=1.3,
        )
    )
    velocity, first, *_ = sent.splitlines()
    documented = seeds.SERIAL.splitlines()
    assert velocity.rpartition(b",")[0] == documented[0].rpartition(b",")[0]
    assert first == documented[1]


def test_json_figure_of_merit_is_the_documented_one() -> None:
    """The maker's example: its fom is the root of the largest eigenvalue of its covariance."""
    covariance = [
        [2.4471841442164077e-08, -3.3937477272871774e-09, -1.6659699175747278e-09],
        [-3.3937477272871774e-09, 1.4654466085062268e-08, 4.0409570134514183e-10],
        [-1.6659699175747278e-09, 4.0409570134514183e-10, 1.5971971523143225e-09],
    ]
    example = ping(velocity_p_mps=np.zeros(3), covariance_m2ps2=np.array(covariance))
    report = json.loads(encoder("waterlinked-json", FOUR).encode(example))
    assert report["fom"] == pytest.approx(0.00016016385052353144, rel=1e-6)
    keys = "time vx vy vz fom covariance altitude transducers velocity_valid status tracking_mode format type"
    assert list(report) == [*keys.split(), "time_of_validity", "time_of_transmission"]
    assert list(report["transducers"][0]) == ["id", "velocity", "distance", "rssi", "nsd", "beam_valid"]
    assert report["time_of_validity"] == NS_2026 // 1000
    assert report["time_of_transmission"] == NS_2026 // 1000 + 50_000


def test_json_of_a_lost_beam_is_as_recorded() -> None:
    """An A50 writes 0 m/s and -1 m, and a large figure of merit where it has no velocity."""
    report = json.loads(encoder("waterlinked-json", FOUR).encode(ping()))
    lost = report["transducers"][2]
    assert (lost["velocity"], lost["distance"], lost["beam_valid"]) == (0, -1, False)
    assert (report["velocity_valid"], report["vx"], report["fom"]) == (False, 0.0, 10.0)


def test_pd0_is_what_the_manual_says() -> None:
    """The byte-by-byte reader of the manual finds number, clock, heading, velocities in mm/s and ranges in cm."""
    sent = encoder("pd0", FOUR).encode(
        ping(
            number=7,
            trigger_ns=NS_2026 - 10_000_000,
            range_m=np.array([10.0, 655.35, np.nan, 700.0]),
            attitude_rad=np.deg2rad([1.0, -2.0, 271.5]),
        )
    )
    (found,) = literal_ensembles(sent)
    assert (found.number, found.coordinates) == (7, 0)
    assert found.clock[:7] == (25, 12, 31, 23, 59, 59, 99)
    assert found.heading_deg == pytest.approx(271.5)
    assert found.velocity_mmps == (100, -200, -32768, 400)
    assert found.range_cm == (1000, 65535, 0, 70_000 & 0xFFFF)
    (track,) = (content for kind, content in found.types if kind == 0x0600)
    assert tuple(track[77:81]) == (0, 0, 0, 1)


def test_equal_pings_are_no_repeat() -> None:
    """A vehicle at rest without noise measures the same again: the reader must not call it stale."""
    writer = encoder("waterlinked-json", FOUR)
    later = ping(time_ns=NS_2026 + 10**8, transmission_ns=NS_2026 + 2 * 10**8, number=2)
    (reader,) = (found for found in BYTES if found.name == "waterlinked-json")
    table = reader.read(writer.encode(ping()) + writer.encode(later), "bytes", PLAIN).table
    assert np.array_equal(table.valid, [[True, True, False, True]] * 2)


def test_cerulean_sentence_is_the_documented_example() -> None:
    assert framing.cerulean_sentence(seeds.DVKFC[1:].partition(b"*")[0]) == seeds.DVKFC


def test_cerulean_counts_from_the_start_of_the_instrument() -> None:
    """Sequence from 0, clock from the switching on, lost cones below the documented confidence of 25."""
    sent = encoder("cerulean-dvkfc", THREE, start_ns=NS_2026 - 3_801_552_000_000).encode(
        ping(
            number=35_061,
            beam_velocity_mps=np.array([0.5, np.nan, 0.1]),
            range_m=np.array([5.0, np.nan, 6.0]),
        )
    )
    fields = sent.decode().split(",")
    assert fields[:5] == ["$DVKFC", "24577", "35060", "0.125000", "3801.552000"]
    assert [float(fields[k]) for k in (9, 16, 23)] == [80.0, 4.0, 80.0]


def test_df21_lies_at_the_documented_offsets() -> None:
    """Offsets of the manufacturer's structure: velocity at 46, distance 62, FOM 78, DT1 94, axes 142."""
    sent = encoder("nortek-dvl", FOUR).encode(
        ping(
            trigger_ns=NS_2026 - 10_000_000,
            velocity_p_mps=np.array([1, 2, 3.0]),
            covariance_m2ps2=np.eye(3) * 4,
        )
    )
    vertical = np.cos(np.deg2rad(25)) * np.array([10, 11, 0, 13])
    assert len(sent) == 222
    assert struct.unpack_from("<I", sent, 12)[0] > 0
    assert struct.unpack_from("<H", sent, 24)[0] == 4
    assert struct.unpack_from("<I", sent, 30)[0] & 0xFFFFF == 0b1111_1111_1011_1011_1011
    assert struct.unpack_from("<4f", sent, 46) == pytest.approx((0.1, -0.2, -32.768, 0.4), rel=1e-6)
    assert struct.unpack_from("<4f", sent, 62) == pytest.approx(vertical, rel=1e-6)
    assert struct.unpack_from("<4f", sent, 78) == pytest.approx((0.01, 0.01, 10.0, 0.01), rel=1e-6)
    assert struct.unpack_from("<4f", sent, 94) == pytest.approx(np.array([20, 22, 0, 26]) / 1500, rel=1e-6)
    assert struct.unpack_from("<4f", sent, 142) == (1.0, 2.0, 3.0, 3.0)
    assert struct.unpack_from("<4f", sent, 158) == (2.0, 2.0, 2.0, 2.0)


def test_nucleus_lies_at_the_documented_offsets() -> None:
    """Offsets of the manufacturer's driver, which count from the data: dt of the beams at 72, velocity x at 96."""
    sent = encoder("nucleus", THREE).encode(
        ping(
            beam_velocity_mps=np.array([0.5, np.nan, 0.1]),
            range_m=np.array([15.0, np.nan, 6.0]),
            velocity_p_mps=np.array([1, 2, 3.0]),
            covariance_m2ps2=np.eye(3) * 4,
        )
    )[10:]
    assert struct.unpack_from("<I", sent, 12)[0] == 0b111_111_101_101_101
    assert struct.unpack_from("<3f", sent, 72) == pytest.approx((0.02, 0.0, 0.008))
    assert struct.unpack_from("<6f", sent, 96) == (1.0, 2.0, 3.0, 2.0, 2.0, 2.0)
    assert struct.unpack_from("<I", sent, 4)[0] == NS_2026 // 10**9


def test_formats_are_those_of_the_readers() -> None:
    assert {one.name for one in FORMATS} < {one.name for one in BYTES}
