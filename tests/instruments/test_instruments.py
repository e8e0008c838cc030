"""Simulated instruments: readings of a run, times of a ping, faults, and what arrives through sockets and terminals."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.encoders.registry import encoder
from bottomlock.errors import ScenarioError
from bottomlock.instruments.faults import KINDS, NONE, FaultDraws, Faults
from bottomlock.instruments.readings import SOUND_SPEED_MPS, Readings, pings
from bottomlock.instruments.schedule import Record, imu_lines, records, sent_table
from bottomlock.instruments.sources import readings_of_log, readings_of_scenario, with_geometry
from bottomlock.io import waterlinked_json
from bottomlock.io.rows import Options
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams

BASE_NS = 1_767_225_600_000_000_000
EVERY = Faults(drops=0.1, duplicates=0.1, stale=0.1, half_lines=0.1, clock_steps=0.1, reconnects=0.1)


def short(seconds: float = 12.0, **dvl: object) -> Scenario:
    """The packaged straight line, for some seconds, with changes of its DVL."""
    scenario = load_scenario("straight").with_trajectory(duration_s=seconds)
    return scenario.model_copy(update={"dvl": scenario.dvl.model_copy(update=dvl)})


@pytest.fixture(scope="module")
def readings() -> Readings:
    """Five pings a second, of which beam 2 is missing for a while."""
    one = readings_of_scenario(short(rate_hz=5.0, beams_lost=()), run=3)
    beam_mps = one.beam_mps.copy()
    beam_mps[10:20, 1] = np.nan
    beam_mps[12:14, 2] = np.nan
    return replace(one, beam_mps=beam_mps, range_m=np.where(np.isfinite(beam_mps), one.range_m, np.nan))


def sent_of(
    readings: Readings, faults: Faults = NONE, *, seed: int = 1, name: str = "waterlinked-json"
) -> list[Record]:
    """The records of a run."""
    writer = encoder(name, readings.geometry, start_ns=BASE_NS)
    return list(records(readings, writer, faults, seed=seed, offset_ns=BASE_NS))


def test_readings_are_those_of_the_run_in_a_campaign() -> None:
    """Run 3's drawn errors, and its beams 3 and 4 lost as the scenario says."""
    scenario = short()
    simulation = build_simulation(scenario)
    table = sensor_streams(simulation, simulation.truth(), run=3)["beams"]
    found = readings_of_scenario(scenario, run=3)
    assert np.array_equal(np.isfinite(found.beam_mps).all(axis=0), [True, True, False, False])
    assert np.array_equal(found.beam_mps[:, 0], table["beam1_mps"].to_numpy())
    assert not np.array_equal(found.beam_mps, readings_of_scenario(scenario, run=4).beam_mps)


def test_a_ping_without_an_echo_listens_as_long_as_the_one_before(readings: Readings) -> None:
    """Else the clock of a record that states the trigger would seem to be set where the bottom is lost."""
    lost = readings.range_m.copy()
    lost[5:8] = np.nan
    found = list(pings(replace(readings, range_m=lost), latency_ns=0, offset_ns=BASE_NS))
    delays = {one.time_ns - one.sent_ns for one in found[4:8]}
    assert len(delays) == 1
    assert delays.pop() > 0


def test_times_of_a_ping_are_an_echo_apart(readings: Readings) -> None:
    """Sent from the transducer R/c before the reflection; its record R/c and the latency after: 2R/c in all."""
    for ping in pings(readings, latency_ns=7_000_000, offset_ns=BASE_NS):
        half_ns = float(np.nanmax(ping.range_m)) / SOUND_SPEED_MPS * 1e9
        assert ping.time_ns - ping.sent_ns == pytest.approx(half_ns, abs=1)
        assert ping.transmission_ns - ping.time_ns == pytest.approx(half_ns + 7e6, abs=1)


def test_records_keep_their_order(readings: Readings) -> None:
    """A far ping is on its way for 4 s, and the near ones after it wait: an instrument sends one after the other."""
    far = readings.range_m.copy()
    far[3] = 3000.0
    due = [
        one.due_ns
        for one in sent_of(replace(readings, range_m=np.where(np.isfinite(readings.beam_mps), far, np.nan)))
    ]
    assert due == sorted(due)
    assert due[4] == due[3]


def test_the_instrument_states_a_velocity_from_three_beams(readings: Readings) -> None:
    """Near the truth with three or four beams, none with two; ranges fit the altitude."""
    found = list(pings(readings, latency_ns=0))
    assert readings.truth is not None
    for k, ping in enumerate(found):
        if ping.valid.sum() < 3:
            assert ping.velocity_p_mps is None
            continue
        assert ping.velocity_p_mps is not None
        assert ping.covariance_m2ps2 is not None
        error = ping.velocity_p_mps - readings.truth.velocity_p_mps[k]
        assert np.all(np.abs(error) < 5.0 * np.sqrt(np.diag(ping.covariance_m2ps2)) + 0.05)
        assert ping.altitude_m == pytest.approx(20.0)
    assert sum(ping.velocity_p_mps is None for ping in found) == 2


def test_what_is_read_back_is_what_the_table_says(readings: Readings) -> None:
    """Without faults, the reader's beams, validity and times are those in the record of what was sent."""
    sent = sent_of(readings)
    table = waterlinked_json.FORMAT.read(b"".join(one.data for one in sent), "bytes", Options()).table
    said = sent_table(readings, sent)
    assert np.array_equal(table.time_ns, np.round(said["time_ns"].to_numpy(), -3))
    for k in range(4):
        valid = said[f"beam{k + 1}_valid"].to_numpy()
        assert np.array_equal(table.valid[:, k], valid)
        assert np.array_equal(table.velocity_mps[valid, k], said[f"beam{k + 1}_mps"].to_numpy()[valid])
    assert np.array_equal(table.instrument_valid == 1, said["velocity_valid"].to_numpy())
    assert said["faults"].unique().to_list() == [""]
    assert said["true_surge_mps"].null_count() == 0


@pytest.mark.parametrize("kind", KINDS)
def test_each_fault_does_what_it_says(readings: Readings, kind: str) -> None:
    """Against the same run without faults, ping by ping."""
    clean = sent_of(readings)
    faulty = sent_of(readings, Faults(**{kind: 0.3}), seed=5)
    assert 5 < sum(bool(one.faults) for one in faulty) < 40
    step_ns, ways = 0, set()
    for k, (good, bad) in enumerate(zip(clean, faulty, strict=True)):
        hit = kind in bad.faults
        assert bad.faults <= {kind}
        assert bad.due_ns == good.due_ns
        assert bad.closes == (hit and kind == "reconnects")
        assert good.stated is not None
        assert bad.stated is not None
        if kind == "clock_steps":
            before, step_ns = step_ns, bad.stated.time_ns - good.stated.time_ns
            assert abs(step_ns - before) == (10**9 if hit else 0)
            ways.add(np.sign(step_ns - before))
        elif not hit or kind == "reconnects":
            assert bad.data == good.data
        elif kind == "drops":
            assert bad.data == b""
        elif kind == "duplicates":
            assert bad.data == good.data * 2
        elif kind == "half_lines":
            assert good.data.startswith(bad.data)
            assert 0 < len(bad.data) < len(good.data)
        else:
            assert json.loads(bad.data)["transducers"] == json.loads(faulty[k - 1].data)["transducers"]
            assert json.loads(bad.data)["time_of_validity"] == json.loads(good.data)["time_of_validity"]
    assert ways == ({-1, 0, 1} if kind == "clock_steps" else set())


def test_a_velocity_that_the_recorded_instrument_called_invalid_stays_so(readings: Readings) -> None:
    """Four beams, and the instrument refused the ping: what is sent says invalid too."""
    refused = replace(readings, stated=np.arange(len(readings.time_ns)) != 1)
    known = [ping.velocity_p_mps is not None for ping in pings(refused, latency_ns=0)]
    assert known[:3] == [True, False, True]


def test_the_reader_knows_stale_records(readings: Readings) -> None:
    """A stale record is what an A50 does: the reader flags each one, and no other."""
    sent = sent_of(readings, Faults(stale=0.2), seed=2)
    recording = waterlinked_json.FORMAT.read(b"".join(one.data for one in sent), "bytes", Options())
    assert recording.table.stale is not None
    assert np.array_equal(recording.table.stale, ["stale" in one.faults for one in sent])


def test_faults_come_as_often_as_asked_and_do_not_shift_each_other() -> None:
    """Of 4000 pings each kind within five sigma of its fraction, independent, and the same ones without the others."""
    together, alone = FaultDraws(EVERY, 7), FaultDraws(Faults(stale=0.1), 7)
    counts, both = dict.fromkeys(KINDS, 0), 0
    for _ in range(4000):
        kinds = together.next()
        assert ("stale" in kinds) == ("stale" in alone.next())
        both += {"drops", "stale"} <= kinds
        for kind in kinds:
            counts[kind] += 1
    assert all(abs(count - 400) < 5 * np.sqrt(4000 * 0.1 * 0.9) for count in counts.values())
    assert abs(both - 40) < 5 * np.sqrt(4000 * 0.01 * 0.99)


@pytest.mark.parametrize("name", ["waterlinked-json", "waterlinked-serial", "pd0", "nortek-dvl"])
def test_the_same_seed_gives_the_same_bytes(readings: Readings, name: str) -> None:
    first, again, other = (
        b"".join(one.data for one in sent_of(readings, EVERY, seed=seed, name=name)) for seed in (1, 1, 2)
    )
    assert first == again != other


def test_imu_lines_keep_every_bit(readings: Readings) -> None:
    imu = readings.imu
    assert imu is not None
    rows = [line.data.decode().split(",") for line in imu_lines(imu, offset_ns=BASE_NS)]
    assert [int(row[0]) - BASE_NS for row in rows] == imu.time_ns.tolist()
    values = np.array([[float(word) for word in row[1:]] for row in rows])
    assert np.array_equal(values, np.hstack([imu.omega_p_radps, imu.force_p_mps2]))


def test_a_log_is_sent_again_as_it_was(tmp_path: Path, readings: Readings) -> None:
    """Recorded and sent again on its own clock: every beam, range and time is the same."""
    sent = sent_of(readings)
    log = tmp_path / "dive.json"
    log.write_bytes(b"".join(one.data for one in sent))
    again = readings_of_log(log, geometry=None)
    assert np.array_equal(again.beam_mps, readings.beam_mps, equal_nan=True)
    np.testing.assert_allclose(again.range_m, readings.range_m, rtol=1e-12)
    assert np.array_equal(
        again.stated, [one.ping is not None and one.ping.velocity_p_mps is not None for one in sent]
    )
    assert again.truth is None
    assert sent_table(again, sent_of(again))["true_surge_mps"].null_count() == len(sent)


def test_a_scenario_takes_other_beams(tmp_path: Path) -> None:
    """Three beams for a Nucleus; rules of loss that name a fourth are an error."""
    three = tmp_path / "three.toml"
    three.write_text(
        'configuration = "angles"\ntilts_deg = [20, 20, 20]\nazimuths_deg = [0, 120, -120]\nbeam_noise_mps = 0.01\n'
    )
    found = readings_of_scenario(with_geometry(short(beams_lost=(1,)), str(three)))
    assert np.isfinite(found.beam_mps).all(axis=0).tolist() == [False, True, True]
    with pytest.raises(ScenarioError, match="lost beam 4 does not exist, expected 1 to 3"):
        with_geometry(short(), str(three))
