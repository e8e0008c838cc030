"""Live is not OK where it must not be: every condition reached by bytes, under default settings."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bottomlock.io.sentences import xor_of
from bottomlock.live.engine import Engine
from tests.live import world
from tests.live.world import Sent, World, config, navigator_of

Arrivals = list[tuple[int, int, bytes]]


def fly(engine: Engine, arrivals: Arrivals) -> list[tuple[str, str]]:
    """The states with their reasons, without repeats, times left out."""
    found: list[tuple[str, str]] = []
    for arrival_ns, source, data in sorted(arrivals, key=lambda entry: entry[:2]):
        engine.arrive(source, arrival_ns, data)
        found.append((engine.state, engine.machine.why))
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("mode", ["velocity", "navigation"])
def test_understated_noise_is_unsafe(monkeypatch: pytest.MonkeyPatch, mode: str) -> None:
    """Beams of 42 mm/s where the configuration claims 4."""
    monkeypatch.setattr(world, "BEAM_SD", 0.042)
    sure = config(mode, extra="")
    sure = sure.model_copy(update={"dvl": sure.dvl.model_copy(update={"beam_noise_mps": 0.004})})
    made = World(8.0)
    found = fly(Engine(sure), [*made.dvl(), *(made.imu() if mode == "navigation" else ())])
    state, why = found[-1]
    assert state == "UNSAFE"
    assert why.startswith("beams disagree with one another by ")
    assert 5.0 < float(why.split(" by ")[1].split()[0]) < 20.0


OTHER = """configuration = "angles"
tilts_deg = [{0}, {0}, {0}, {0}]
azimuths_deg = [{1}, {2}, {3}, {4}]
mounting_yaw_deg = {5}
beam_noise_mps = 0.01
"""
AZIMUTHS_DEG = np.array([135.0, -135.0, -45.0, 45.0])


@pytest.mark.parametrize("mode", ["velocity", "navigation"])
@pytest.mark.parametrize(
    ("tilt_deg", "turned_deg", "mounting_deg", "state"),
    [
        (22.5, 0.0, 0.0, "OK"),
        (22.5, 0.0, 30.0, "OK"),
        (30.0, 0.0, 0.0, "UNSAFE"),
        (22.5, 30.0, 0.0, "UNSAFE"),
    ],
)
def test_beams_of_another_instrument_are_unsafe(
    tmp_path: Path, mode: str, tilt_deg: float, turned_deg: float, mounting_deg: float, state: str
) -> None:
    """They close as a Janus does; the instrument's own velocity tells after three pings, whatever the mounting."""
    file = tmp_path / "dvl.toml"
    file.write_text(OTHER.format(tilt_deg, *AZIMUTHS_DEG + turned_deg, mounting_deg), encoding="utf-8")
    made = World(8.0)
    engine, arrivals = Engine(config(mode, geometry=str(file))), made.arrivals(imu=mode == "navigation")
    sent = world.fly(engine, arrivals)
    assert engine.state == state
    if state == "UNSAFE":
        assert sum(one == "OK" for _, _, one in sent) <= 2
    assert engine.machine.why.startswith("beams differ from the instrument's own velocity by ") is (
        state == "UNSAFE"
    )


def test_pings_that_contradict_the_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beams jump by 3 m/s: coasting at the first rejection, unsafe at the fourth; the fifth opens the gate again.

    That may have been wrong: ten seconds of agreement later the state is OK.
    """
    before, imu = list(World(3.0).dvl()), list(World(15.0).imu())
    monkeypatch.setattr(world, "VELOCITY", world.VELOCITY + np.array([3.0, 0.0, 0.0]))
    after = [entry for entry in World(15.0).dvl() if entry[0] > before[-1][0] + 1_000_000]
    engine = Engine(config("navigation"))
    found = fly(engine, [*before, *after, *imu])
    why = [f"{state}: {words}" for state, words in found]
    first = why.index("COASTING: the last ping contradicts the estimate")
    assert "UNSAFE: 4 pings in a row contradict the estimate" in why[first:]
    assert not any("5 pings in a row" in words for words in why)
    assert engine.state == "OK", engine.machine.why


def test_a_false_beam_does_not_give_the_velocity_of_the_start() -> None:
    """One beam is false by 1 m/s while the navigator aligns itself, until a second after it would have begun."""
    engine, found = Engine(config("navigation")), []
    for arrival_ns, source, data in World(6.0).arrivals(imu=True):
        sent = data
        if source == 0 and arrival_ns < world.START_NS + 2_000_000_000:
            report = json.loads(data)
            report["transducers"][1]["velocity"] += 1.0
            sent = json.dumps(report).encode() + b"\n"
        found += [Sent.parse(message.data) for message in engine.arrive(source, arrival_ns, sent)]
    assert found[0].time_ns > world.START_NS + 1_900_000_000
    assert max(float((np.abs(one.velocity - world.VELOCITY) / one.sd).max()) for one in found) < 4.0


def imu_fields(data: bytes, column: int, change: float | bytes) -> bytes:
    """A line of the IMU with one of its six numbers changed by so much, or replaced."""
    fields = data.partition(b"*")[0].split(b",")
    fields[column + 1] = (
        change if isinstance(change, bytes) else b"%.9g" % (float(fields[column + 1]) + change)
    )
    line = b",".join(fields)
    return line + b"*%02X\n" % xor_of(line)


@pytest.mark.parametrize(("column", "size"), [(3, 0.5), (3, 2.5), (5, -2.5), (3, 90.0), (1, 0.02)])
@pytest.mark.parametrize("end_s", [3.01, 3.02, 3.35])
def test_an_axis_that_departs_for_a_moment_is_never_ok_and_wrong(
    column: int, size: float, end_s: float
) -> None:
    """One axis of the IMU for up to 0.35 s: nobody knows whether the vehicle was hit."""
    engine, found = Engine(config("navigation")), []
    for arrival_ns, source, data in World(6.0).arrivals(imu=True):
        at_s = (arrival_ns - world.START_NS) * 1e-9
        departs = source == 1 and 3.0 <= at_s < end_s
        sent = imu_fields(data, column, size) if departs else data
        found += [Sent.parse(message.data) for message in engine.arrive(source, arrival_ns, sent)]
    good = [one for one in found if one.state == "OK"]
    assert len(good) > 30
    assert max(float((np.abs(one.velocity - world.VELOCITY) / one.sd).max()) for one in good) < 4.0


def test_an_axis_that_stops_is_unsafe() -> None:
    """The other five read on."""
    stuck = config("navigation", change=("[start]", "limits.stuck_after = 25\n[start]"))
    engine, states, last = Engine(stuck), set(), b""
    for arrival_ns, source, data in World(6.0).arrivals(imu=True):
        sent = data
        if source == 1:
            last = last or (data.split(b",")[3] if arrival_ns > world.START_NS + 3_000_000_000 else b"")
            sent = imu_fields(data, 2, last) if last else data
        engine.arrive(source, arrival_ns, sent)
        if arrival_ns > world.START_NS + 4_000_000_000:
            states.add(engine.machine.why.partition(" for ")[0])
            assert engine.state == "UNSAFE"
    assert states == {"no inertial readings"}


def test_a_start_after_a_long_gap_takes_nothing_for_measured_that_was_stated() -> None:
    """Fifteen seconds without inertial readings: where the vehicle is and points to has changed by then."""
    engine = Engine(config("navigation"))
    for arrival_ns, source, data in World(25.0).arrivals(imu=True):
        if source == 1 and 5.0 <= (arrival_ns - world.START_NS) * 1e-9 < 20.0:
            continue
        engine.arrive(source, arrival_ns, data)
    navigator = navigator_of(engine)
    assert engine.estimator.resets == 1
    sd = np.sqrt(np.diag(navigator.covariance()))
    heading = np.deg2rad(30.0)
    surge, sway, heave = world.VELOCITY
    true = 25.0 * np.array(
        [
            np.cos(heading) * surge - np.sin(heading) * sway,
            np.sin(heading) * surge + np.cos(heading) * sway,
            heave,
        ]
    )
    error = np.abs(np.asarray(navigator.state()["position_t_m"]) - true)
    assert (error[:2] / sd[:2] < 3.0).all()
    assert (error[:2] > 2.0).any()
    assert sd[5] > 1.0, "the yaw may be any after 15 s of 0.1 rad/s"
    assert sd[3] < np.deg2rad(2.0), "the level is measured again"


AHRS = """
[attitude]
yaw_sd_deg = 3.0
[[source]]
name = "ahrs"
address = "udpin:127.0.0.1:10"
format = "attitude-csv"
rate_hz = 10
clock = "host"
"""


MEASURED = "heading_sd_deg = 20.0\nvelocity_sd_mps = [0.3, 0.3, 0.3]"
GIVEN = """heading_deg = 30.0
heading_sd_deg = 0.1
velocity = "given"
velocity_sd_mps = [0.01, 0.01, 0.01]
"""


@pytest.mark.parametrize(
    ("start", "yaw_sd_deg", "velocity_sd_mps"), [(MEASURED, 20.0, 0.3), (GIVEN, 3.0, 0.1)]
)
def test_what_is_stated_of_a_measurement_holds_for_every_start(
    start: str, yaw_sd_deg: float, velocity_sd_mps: float
) -> None:
    """The 1 sigma of a heading and a velocity that were given is not that of those which are measured later."""
    stated = "window_s = 1.0\nheading_deg = 30.0\nheading_sd_deg = 2.0"
    engine = Engine(config("navigation", change=(stated, f'level = "attitude"\n{start}'), extra=AHRS))
    made = World(25.0)
    turned = [
        (at_ns, 2, b"%d,0.0,0.0,0.5235987756\n" % at_ns)
        for at_ns in (world.START_NS + k * 100_000_000 + 1_000 for k in range(250))
    ]
    for arrival_ns, source, data in made.arrivals(turned, imu=True):
        if source == 1 and 5.0 <= (arrival_ns - world.START_NS) * 1e-9 < 20.0:
            continue
        engine.arrive(source, arrival_ns, data)
        if engine.estimator.resets and engine.estimator.time_ns is not None:
            break
    sd = np.sqrt(np.diag(navigator_of(engine).covariance()))
    assert np.rad2deg(sd[5]) == pytest.approx(yaw_sd_deg, rel=1e-3)
    assert sd[6:9] == pytest.approx(velocity_sd_mps, rel=0.05)


def test_false_beams_that_agree_are_never_ok(monkeypatch: pytest.MonkeyPatch) -> None:
    """All beams of four seconds are false by 3 m/s, as of a shoal: the filter follows them, and nothing is sent."""
    true, made = list(World(20.0).dvl()), World(20.0)
    monkeypatch.setattr(world, "VELOCITY", world.VELOCITY + np.array([3.0, 0.0, 0.0]))
    false = list(World(20.0).dvl())
    start_ns = true[0][0]
    beams = [
        one if 3.0 < (one[0] - start_ns) * 1e-9 < 7.0 else other
        for one, other in zip(false, true, strict=True)
    ]
    monkeypatch.undo()
    engine = Engine(config("navigation"))
    states = []
    for arrival_ns, source, data in sorted([*beams, *made.imu()], key=lambda entry: entry[:2]):
        engine.arrive(source, arrival_ns, data)
        states.append(((arrival_ns - start_ns) * 1e-9, engine.state))
    late = {state for at_s, state in states if 3.5 < at_s < 16.5}
    assert late == {"UNSAFE"}
    assert states[-1][1] == "OK", engine.machine.why


@pytest.mark.parametrize(("column", "size"), [(3, 0.06), (4, 0.03), (5, 0.01), (0, 0.002), (1, 0.005)])
def test_a_bias_that_steps_is_noticed_and_learnt(column: int, size: float) -> None:
    """No gate sees it: half of the messages of the next twenty seconds were OK and wrong before."""
    engine, found = Engine(config("navigation")), []
    for arrival_ns, source, data in World(30.0).arrivals(imu=True):
        steps = source == 1 and arrival_ns >= world.START_NS + 10_000_000_000
        sent = imu_fields(data, column, size) if steps else data
        found += [Sent.parse(message.data) for message in engine.arrive(source, arrival_ns, sent)]
    wrong = [
        one
        for one in found
        if one.state == "OK" and (np.abs(one.velocity - world.VELOCITY) / one.sd).max() > 4.0
    ]
    assert len(wrong) <= 12
    assert all(one.time_ns < world.START_NS + 14_000_000_000 for one in wrong)
    late = [one for one in found if one.time_ns > world.START_NS + 24_000_000_000]
    assert np.mean([np.linalg.norm(one.velocity - world.VELOCITY) for one in late]) < 0.03
    assert "PARTIAL" in {one.state for one in found}
