"""Readers of text records: documented examples, what is lost is counted with its line, nothing is made up."""

import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest

from bottomlock.encoders import framing
from bottomlock.errors import DataError
from bottomlock.io import (
    cerulean,
    linkquest,
    nortek_ascii,
    nucleus,
    nucleus_csv,
    waterlinked_json,
    waterlinked_serial,
)
from bottomlock.io.formats import read_recording
from bottomlock.io.rows import Options
from tests.dive import drawn_dive, dvl_bytes, tables
from tools import reader_seeds as seeds


def test_json_v1_has_no_clock() -> None:
    """Time is the sum of the intervals; a lost beam has neither range nor validity."""
    recording = waterlinked_json.FORMAT.read(seeds.a50_report(0) + seeds.a50_report(1, lost=[2]), "log")
    table = recording.table
    assert table.time_ns.tolist() == [100_000_000, 200_000_000]
    assert table.valid.tolist() == [[True] * 4, [True, True, False, True]]
    np.testing.assert_allclose(table.velocity_mps[0], [0.0, 0.1, 0.2, 0.3])
    assert table.velocity_mps[1, 2] == 0.0, "as recorded: an instrument's zero is the audit's business"
    assert math.isnan(table.range_m[1, 2])
    assert table.range_m[0].tolist() == [2.0, 2.1, 2.2, 2.3]
    assert table.instrument_mps[0].tolist() == [0.5, -0.25, 0.125]
    assert table.instrument_valid.tolist() == [1, 1]
    assert table.extra["beam2_noise_dbm"].tolist() == [-90.0, -90.0]
    assert recording.time_of == "record"
    assert "no clock" in recording.notes[0]


def test_json_v3_has_the_time_of_validity() -> None:
    """Microseconds since 1970; dead reckoning is no ping, and a report of the water is one without the bottom."""
    log = (
        seeds.a50_report(0, version="json_v3.1")
        + b'{"ts":1.0,"x":2.0,"type":"position_local","format":"json_v3.1"}\n'
        + b'{"response_to":"reset_dead_reckoning","success":true,"type":"response"}\n'
        + seeds.a50_report(1, version="json_v3.2", tracking_mode="water")
        + seeds.a50_report(2, version="json_v3.1", type="velocity_water")
        + seeds.a50_report(3, version="json_v3.1")
    )
    recording = waterlinked_json.FORMAT.read(log, "log")
    first_ns = 1_638_191_471_563_017_000
    assert recording.table.time_ns.tolist() == [first_ns + step * 100_000_000 for step in range(4)]
    assert recording.table.beams_valid.tolist() == [4, 0, 0, 4]
    assert recording.time_of == "validity"
    other = {name: (one.count, one.first) for name, one in recording.account.other.items()}
    assert other == {"position_local": (1, 2), "response": (1, 3)}


def test_json_stale_repeat() -> None:
    """A block that repeats unchanged is no new measurement; the row stays, and the user may have its beams back."""
    log = seeds.a50_report(0) + seeds.a50_report(0) + seeds.a50_report(1)
    recording = waterlinked_json.FORMAT.read(log, "log")
    assert recording.table.stale is not None
    assert recording.table.stale.tolist() == [False, True, False]
    assert recording.table.beams_valid.tolist() == [4, 0, 4]
    assert recording.account.flagged["stale repeat"].first == 2
    kept = waterlinked_json.FORMAT.read(log, "log", Options(keep_stale=True))
    assert kept.table.beams_valid.tolist() == [4, 4, 4]
    # Beams that are all lost read alike from ping to ping without being a repeat.
    lost = seeds.a50_report(0, lost=range(4))
    assert "stale repeat" not in waterlinked_json.FORMAT.read(lost + lost, "log").account.flagged


def test_json_merged_and_cut_lines() -> None:
    """Two reports on a line are both read; after a report that is cut off, the next on its line is found."""
    one, two, three = (seeds.a50_report(k).strip() for k in range(3))
    recording = waterlinked_json.FORMAT.read(
        one + two + b"\n" + three[:90] + seeds.a50_report(3) + b'{"time":1', "log"
    )
    assert recording.table.velocity_mps[:, 0].tolist() == [0.0, 0.001, 0.003]
    account = recording.account
    assert account.flagged["merged line, all of it read"].first == 1
    assert (account.skipped["merged line"].count, account.skipped["merged line"].first) == (1, 2)
    assert account.skipped["truncated"].first == 3
    assert account.read == 5
    assert "missing from that sum" in recording.notes[1]


@pytest.mark.parametrize("damage", [b',"time":1}', b',"fom":tru}', b"}]"])
def test_json_damaged_objects(damage: bytes) -> None:
    """A key that is given twice, a broken word and what follows an object: the line is lost or told to be merged."""
    line = seeds.a50_report(1).strip()
    recording = waterlinked_json.FORMAT.read(seeds.a50_report(0) + line.removesuffix(b"}") + damage, "log")
    reason = "merged line" if damage == b"}]" else "truncated"
    assert recording.account.skipped[reason].first == 2
    assert recording.table.rows == (2 if reason == "merged line" else 1)


def test_serial_documented_examples() -> None:
    """The maker's examples: CRC-8 good, one measurement of four beams, time of validity 7 µs."""
    recording = waterlinked_serial.FORMAT.read(seeds.SERIAL, "log")
    table = recording.table
    assert table.time_ns.tolist() == [7000]
    assert table.velocity_mps.tolist() == [[0.07, -0.5, 2.2, 1.8]]
    assert table.range_m.tolist() == [[1.1, 1.25, 1.4, 1.35]]
    assert table.quality.tolist() == [[-40.0, -62.0, -56.0, -58.0]]
    assert table.instrument_mps.tolist() == [[0.12, -0.4, 2.0]]
    assert recording.account.lost == 0


def test_serial_lost_beams_and_bad_checksums() -> None:
    """Distance -1 is a lost beam; a changed character a bad checksum."""
    lost = seeds.SERIAL.replace(
        b"wru,2,2.200,1.40,-56,-98*18\r\n", framing.waterlinked_sentence(b"wru,2,0.000,-1.00,-56,-98")
    )
    assert waterlinked_serial.FORMAT.read(lost, "log").table.valid.tolist() == [[True, True, False, True]]
    bad = seeds.SERIAL.replace(b"2.200", b"2.300")
    recording = waterlinked_serial.FORMAT.read(bad, "log")
    assert recording.table.valid.tolist() == [[True, True, False, False]], (
        "what follows a lost line is unsure"
    )
    assert recording.account.skipped["bad checksum"].first == 4
    assert recording.account.skipped["transducer report after a lost line"].first == 5
    assert recording.account.flagged["transducer report missing"].count == 1


@pytest.mark.parametrize(
    ("sentence", "good"),
    [
        (b"wrx,125,0.05,0.01,0.001,0.5,0.1,y*6e", False),
        (b"wrx,112.83,0.007,0.017,0.006,0.000,0.93,y,0*d2", True),
    ],
)
def test_serial_deprecated(sentence: bytes, good: bool) -> None:
    """`wrx` alone has no beams: rejected with advice, or the instrument's velocity; one of seven fields is told."""
    if good:
        with pytest.raises(DataError, match=r"no beams.*firmware to 2\.1"):
            waterlinked_serial.FORMAT.read(sentence, "log")
        table = waterlinked_serial.FORMAT.read(sentence, "log", Options(instrument_only=True)).table
        assert table.beams == 0
        assert table.instrument_mps.tolist() == [[0.007, 0.017, 0.006]]
    else:
        with pytest.raises(DataError, match=r"velocity report with wrong fields \(first at line 1\)"):
            waterlinked_serial.FORMAT.read(sentence, "log")


def test_pnorbt_plain_and_tagged() -> None:
    """Both forms give the same ping; the recorded example is a beam without bottom."""
    plain = b"".join(seeds.pnorbt(k, tagged=False, velocity=0.1 * k) for k in range(1, 5))
    tagged = b"".join(seeds.pnorbt(k, tagged=True, velocity=0.1 * k) for k in range(1, 5))
    for log in (plain, tagged):
        table = nortek_ascii.FORMAT.read(log, "log").table
        # 7 April 2021 13:13:35.3341: the date is MMDDYY.
        assert table.time_ns.tolist() == [1_617_801_215_334_100_000]
        np.testing.assert_allclose(table.velocity_mps, [[0.1, 0.2, 0.3, 0.4]])
        np.testing.assert_allclose(table.range_m, 5.0 / math.cos(math.radians(25.0)))
        np.testing.assert_allclose(table.extra["beam3_delay_s"], 0.023961)
    table = nortek_ascii.FORMAT.read(seeds.PNORBT0, "log").table
    assert table.valid.tolist() == [[False]]
    assert np.isnan([table.velocity_mps, table.range_m, table.sd_mps]).all()


def test_pnorbt_missing_line() -> None:
    """A beam whose line is lost is lost; the ping says so."""
    lines = [seeds.pnorbt(k, tagged=False, second=s) for s in (1.0, 2.0) for k in range(1, 5)]
    lines[5] = lines[5].replace(b"0.25", b"0.35")
    recording = nortek_ascii.FORMAT.read(b"".join(lines), "log")
    assert recording.table.valid.tolist() == [[True] * 4, [True, False, True, True]]
    assert recording.account.skipped["bad checksum"].first == 6
    assert recording.account.flagged["beam line missing"].first == 5


# pynmea2's examples of `$PNORBT7` and `$PNORBT9`; the tagged `$PNORBT8` as okmr's driver reads it.
OF_AXES = (
    b"$PNORBT7,1452244916.7508,1.234,-1.234,0.1234,0.1234,0.1234,12.34,23.45,23.45,23.45,23.45*39\r\n",
    (
        b"$PNORBT9,1452244916.7508,1.234,-1.234,0.1234,0.1234,0.1234,12.34,23.45,23.45,23.45,23.45,23.4,1567.8,1.2,"
        b"12.3,0x000FFFFF*1E\r\n"
    ),
    seeds.nmea(
        b"PNORBT8,TIME=1452244917.25,DT1=1.0,DT2=-1.0,VX=0.5,VY=-0.25,VZ=0.125,FOM=0.01,D1=2.0,D2=3.0,D3=0.0,"
        b"D4=4.0,BATT=23.4,SS=1500.0,PRESS=1.2,TEMP=12.3,STAT=0x000FFFFF"
    ),
)


def test_pnorbt_velocities_without_beams() -> None:
    """Rejected with advice; asked for, they are velocities alone, and one with a figure of merit of 10 is invalid."""
    log = b"".join(OF_AXES)
    with pytest.raises(DataError, match=r"no beams.*DF350 or DF351"):
        nortek_ascii.FORMAT.read(log, "log")
    recording = nortek_ascii.FORMAT.read(log, "log", Options(instrument_only=True))
    table = recording.table
    assert (table.rows, table.beams, recording.frame) == (2, 0, "instrument")
    assert table.time_ns.tolist() == [1_452_244_916_750_800_000, 1_452_244_917_250_000_000]
    assert table.instrument_valid.tolist() == [0, 1]
    assert table.instrument_mps[1].tolist() == [0.5, -0.25, 0.125]
    assert table.extra["altitude_m"].tolist() == [23.45, 3.0]
    beams = b"".join(seeds.pnorbt(k, tagged=False) for k in range(1, 5))
    mixed = nortek_ascii.FORMAT.read(beams + log, "log")
    assert mixed.table.beams == 4
    assert mixed.account.other["velocity without beams"].count == 3


@pytest.mark.parametrize(
    "capture",
    [
        "2026-01-02 03:04:05.678 {}",
        "< {}",
        "[12:00:01] {}",
        "data: '{}'",
        'data: "{}"',
        "ws://192.168.194.95: {}",
    ],
)
def test_captures_of_json(capture: str) -> None:
    """What a WebSocket's log or an echo of `std_msgs/String` writes around a report is none of its damage."""
    reports = [seeds.a50_report(k, version="json_v3").strip().decode() for k in range(3)]
    quoted = capture.endswith('"')
    shown = [json.dumps(one)[1:-1] if quoted else one for one in reports]
    log = "\n---\n".join(capture.replace("{}", one) for one in shown).encode()
    assert waterlinked_json.FORMAT.sniff(log)
    plain = waterlinked_json.FORMAT.read("\n".join(reports).encode(), "log")
    recording = waterlinked_json.FORMAT.read(log, "log")
    assert not recording.account.skipped
    assert recording.account.other["end of a message"].count == 2
    np.testing.assert_array_equal(recording.table.velocity_mps, plain.table.velocity_mps)
    assert recording.table.time_ns.tolist() == plain.table.time_ns.tolist()


def test_dvext_recorded_example() -> None:
    """Sentences that a DVL-75 sent: without lock, and with one channel lost."""
    gps = seeds.nmea(b"GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W")
    recording = cerulean.DVL75.read(gps + seeds.DVEXT, "log")
    table = recording.table
    assert not recording.account.skipped
    assert recording.account.other.keys() == {"$GPRMC", "$DVPDL"}
    assert table.valid.tolist() == [[False] * 4, [True, True, False, True]]
    assert table.velocity_mps[1].tolist() == [-0.0086, -0.0169, 0.0, -0.0608]
    np.testing.assert_array_equal(table.range_m, [[math.nan] * 4, [0.371, 0.391, math.nan, 0.371]])
    assert table.time_ns.tolist() == [100_000_000, 150_000_000]
    assert table.instrument_valid.tolist() == [0, 1]
    assert table.instrument_mps[1].tolist() == [-0.144, 0.295, 0.067]
    assert recording.frame == "ned"
    assert table.extra["altitude_m"][1] == 0.35
    assert math.degrees(table.extra["heading_rad"][1]) == pytest.approx(290.9)


def test_nucleus_csv_is_the_binary_log() -> None:
    """Rows that Nortek's driver writes of packets read as the packets do."""
    binary = b"".join(framing.nortek_frame(kind, seeds.nucleus(k, status=status), 0x20)
                      for k, (kind, status) in enumerate([(0xB4, 0x7FFF), (0xB4, 0x7FFE), (0xBE, 0x7FFF)]))  # fmt: skip
    log = seeds.nucleus_csv([(0xB4, 0x7FFF), (0xB4, 0x7FFE), (0xBE, 0x7FFF), (0xD2, 0)])
    from_csv, plain = nucleus_csv.FORMAT.read(log, "log"), nucleus.FORMAT.read(binary, "log")
    assert from_csv.clock == plain.clock
    assert {name: one.count for name, one in from_csv.account.other.items()} == {"AHRS": 1, "water track": 1}
    assert plain.account.other["water track"].count == 1
    for name in (
        "time_ns",
        "valid",
        "range_m",
        "sd_mps",
        "instrument_valid",
        "instrument_mps",
        "velocity_mps",
    ):
        np.testing.assert_array_equal(getattr(from_csv.table, name), getattr(plain.table, name), err_msg=name)
    assert from_csv.table.extra.keys() == plain.table.extra.keys()
    assert from_csv.water is not None
    assert plain.water is not None
    np.testing.assert_allclose(from_csv.water.range_m, plain.water.range_m)
    np.testing.assert_array_equal(from_csv.water.velocity_mps, plain.water.velocity_mps)


def test_dvkfc_documented_example() -> None:
    """Three cones; range confidences under 25 are no detections, as the maker says."""
    recording = cerulean.FORMAT.read(seeds.DVKFC, "log")
    table = recording.table
    assert table.time_ns.tolist() == [3_801_552_000_000]
    assert table.beams == 3
    assert table.valid.tolist() == [[False] * 3]
    np.testing.assert_allclose(table.quality, 6.283185)
    better = seeds.DVKFC.replace(b"3.450820,0.000000", b"125.0000,-0.75000").strip()[1:-3]
    table = cerulean.FORMAT.read(seeds.nmea(better), "log").table
    assert table.valid.tolist() == [[False, True, False]]
    assert table.velocity_mps[0, 1] == -0.75
    with pytest.raises(DataError, match="1 bad checksum"):
        cerulean.FORMAT.read(seeds.DVKFC.replace(b"*2A", b"*2B"), "log")


def test_linkquest_signs() -> None:
    """Upward z as recorded: beams negated and (x, -y, -z), so that b . v holds with the packaged geometry."""
    recording = linkquest.FORMAT.read(seeds.linkquest_log(), "log")
    table = recording.table
    np.testing.assert_allclose(table.velocity_mps[0], [-0.1, 0.2, 0.3, -0.4])
    np.testing.assert_allclose(table.instrument_mps[0], [0.5, 0.6, -0.07])
    assert table.valid.tolist() == [[True] * 4, [False, True, True, True]]
    assert math.isnan(table.range_m[1, 0])
    assert table.arrival_ns is not None
    assert (table.arrival_ns - table.time_ns).tolist() == [800_000, 800_000]
    cut = seeds.linkquest_log(3).splitlines()
    log = b"\n".join([cut[0], cut[1], cut[2][:40], cut[3] + cut[3]])
    account = linkquest.FORMAT.read(log, "log").account
    assert (account.skipped["truncated"].first, account.skipped["merged line"].first) == (3, 4)


@pytest.mark.parametrize(
    ("name", "log", "instead"),
    [
        ("log.txt", seeds.PD6, "PD0"),
        ("log.csv", seeds.PD6_LOGGED, "PD0"),
        ("log.pd4", b"\x7d\x00\x2d\x00" + bytes(43), "PD0"),
        ("log.txt", seeds.DVEXT.split(b"\n")[0], "DVEXT"),
        ("log.json.gz", gzip.compress(seeds.a50_report(0)), "unpack"),
    ],
)
def test_what_holds_no_beams_is_refused_with_what_to_record(
    name: str, log: bytes, instead: str, tmp_path: Path
) -> None:
    """PD6, also in a logger's CSV, PD4, displacements of a Cerulean, and a compressed log."""
    path = tmp_path / name
    path.write_bytes(log)
    with pytest.raises(DataError) as error:
        read_recording(path)
    assert error.value.place == str(path)
    assert instead in str(error.value.hint)


def test_no_infinity_gets_into_a_table() -> None:
    """Numbers beyond a float are none; a beam whose velocity is one is not valid."""
    report = seeds.a50_report(0).replace(b'"distance":2.1', b'"distance":1e999')
    report = report.replace(b'"vx":0.5', b'"vx":1e999').replace(b'"rssi":-33.0', b'"rssi":-1e999')
    report = report.replace(b'"altitude":1.8', b'"altitude":1e999').replace(
        b'"velocity":0.2', b'"velocity":1e999'
    )
    table = waterlinked_json.FORMAT.read(report, "log").table
    assert np.isnan(
        [table.range_m[0, 1], table.instrument_mps[0, 0], table.quality[0, 3], table.velocity_mps[0, 2]]
    ).all()
    assert np.isnan(table.extra["altitude_m"][0])
    assert table.valid.tolist() == [[True, True, False, True]]
    for array in (table.velocity_mps, table.range_m, table.quality, table.sd_mps, table.instrument_mps):
        assert not np.isinf(array).any()


@pytest.mark.parametrize("data", [b"", b"\r\n \n"])
def test_an_empty_file_is_called_so(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "log.json").write_bytes(data)
    with pytest.raises(DataError, match=r"log\.json: is empty$"):
        read_recording(tmp_path / "log.json")


def test_a_format_that_is_not_the_files_names_the_one_that_it_looks_like(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    path.write_bytes(seeds.a50_report(0))
    with pytest.raises(
        DataError, match=r"^.*: no ensemble with bottom track could be read; skipped: "
    ) as error:
        read_recording(path, format="pd0")
    assert error.value.place == str(path)
    assert error.value.hint == "it looks like a log of format waterlinked-json: leave --format out"


@pytest.mark.parametrize("form", ["array", "UTF-16", "UTF-16 without a mark", "UTF-8"])
def test_an_array_of_json_and_utf16_hold_the_same_pings(form: str, tmp_path: Path) -> None:
    """As exports write them: one array with an object over many lines, and text with a byte order mark."""
    lines = dvl_bytes(tables(drawn_dive(3, seconds=20.0))["beams"], "waterlinked-json", "waterlinked_a50")
    records = [json.loads(one) for one in lines.splitlines()]
    marked = {"UTF-16": "utf-16", "UTF-16 without a mark": "utf-16-be", "UTF-8": "utf-8-sig"}.get(form)
    other = lines.decode().encode(marked) if marked else json.dumps(records, indent=1).encode()
    read = []
    for name, data in (("lines.json", lines), ("other.json", other)):
        (tmp_path / name).write_bytes(data)
        read.append(read_recording(tmp_path / name))
    assert read[0].format == read[1].format == "waterlinked-json"
    assert len(read[0].table.time_ns) > 50
    assert not read[1].account.skipped
    assert np.array_equal(read[0].table.time_ns, read[1].table.time_ns)
    assert np.array_equal(read[0].table.velocity_mps, read[1].table.velocity_mps, equal_nan=True)
