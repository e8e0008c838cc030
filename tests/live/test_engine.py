"""The engine: bytes and times of arrival in, messages out; states through the loss and return of beams."""

from __future__ import annotations

import random
import re
from itertools import pairwise

import numpy as np
import pytest

from bottomlock.io.sentences import xor_of
from bottomlock.live.engine import Engine, Message
from bottomlock.ports.estimate import SILENT
from tests.live.world import (
    START_NS,
    VELOCITY,
    Flown,
    Sent,
    World,
    config,
    fly,
    lines,
    one_to_three_beams,
    states,
)


@pytest.mark.parametrize("form", ["waterlinked-json", "pd0"])
def test_velocity_with_what_beams_are_left(form: str) -> None:
    """Every ping with a beam is an estimate; what two beams do not determine is absent, not uncertain."""
    world = World(9.0, one_to_three_beams, form=form)
    engine = Engine(config(format=form))
    sent = fly(engine, world.arrivals())
    assert states(sent) == ["OK", "PARTIAL", "OK"]
    partial = [line for line in lines(sent) if line.rank == 2]
    assert len(partial) == 20
    for line in partial:
        assert np.isfinite(line.velocity).sum() in {0, 1}
        np.testing.assert_array_equal(np.isfinite(line.sd), np.isfinite(line.velocity))
    whole = [line for line in lines(sent) if line.rank == 3]
    errors = np.array([(line.velocity - VELOCITY) / line.sd for line in whole])
    assert np.sqrt((errors**2).mean()) < 1.4


def test_nothing_is_sent_without_beams() -> None:
    """In mode velocity there is nothing to coast on: the state is UNSAFE and says why."""
    engine = Engine(config())
    sent = fly(engine, World(6.4, one_to_three_beams).arrivals())
    assert engine.state == "UNSAFE"
    assert "no usable beam for" in engine.machine.why
    assert max(arrival for arrival, _, _ in sent) < START_NS + 5_100_000_000


def test_time_of_validity_on_the_hosts_clock() -> None:
    """The instrument's clock is 1000 s off and drifts by 40 ppm: estimates bear the host's time, to 2 ms."""
    world = World(60.0, offset_ns=lambda t: round(1e12 + 4e-5 * 1e9 * t))
    sent = fly(Engine(config()), world.arrivals())
    valid = START_NS + np.round((np.arange(600) + 0.5) / 10.0 * 1e9)
    times = np.array([line.time_ns for line in lines(sent)])
    # The transmission is taken as the arrival: 40 ms after validity, and the least delay of the line.
    assert len(times) == 600
    assert np.abs(times - valid)[20:].max() < 2e6
    assert np.abs(times - valid).max() < 5e6


def test_a_clock_that_is_set_back_sends_nothing_with_a_wrong_time() -> None:
    """Pings after it are unsure until the step is known; then they go on."""
    world = World(12.0, offset_ns=lambda t: 0 if t < 5.0 else -700_000_000)
    engine = Engine(config())
    sent = fly(engine, world.arrivals())
    valid = {START_NS + round((k + 0.5) / 10.0 * 1e9) for k in range(120)}
    for line in lines(sent):
        assert min(abs(line.time_ns - one) for one in valid) < 6e6
    assert engine.sources[0].clock_steps == 1
    (clock,) = engine.sources[0].clocks.values()
    assert clock.last_step_ns == pytest.approx(-7e8, abs=6e6)
    assert engine.state == "OK"


@pytest.mark.parametrize("back_s", [0.7, 2.0, 6.4])
def test_a_clock_that_is_set_back_by_whole_pings_is_known_after_a_second(back_s: float) -> None:
    """Its stamps are those of earlier pings again; a report that comes twice is none of it."""
    world = World(16.0, offset_ns=lambda t: 0 if t < 8.0 else -round(back_s * 1e9))
    engine = Engine(config())
    fly(engine, [one for arrival_ns, _, data in world.arrivals() for one in [(arrival_ns, 0, data)] * 2])
    (source,) = engine.sources
    assert source.clock_steps == 1
    assert 160 - source.used <= 12
    assert source.refused["its time repeats"] >= 160 - 12
    assert engine.state == "OK"


def test_times_in_another_unit_are_named() -> None:
    """Milliseconds in place of microseconds: nothing after the first ping is sent as OK, and the mistake is told."""
    engine = Engine(config())
    late = [
        (at, source, re.sub(rb'("time_of_(?:validity|transmission)":\d+)\d{3}', rb"\1", data))
        for at, source, data in World(8.0).arrivals()
    ]
    fly(engine, late)
    assert engine.state == "UNSAFE"
    words = "its clock is set again and again: are its times in the unit of its format?"
    assert engine.sources[0].refused[words] > 30


def asked_in_between(engine: Engine, world: World) -> list[tuple[int, Message]]:
    """Arrival and message of all that a run with an IMU sends, asked now and then for the time between arrivals."""
    draw, now = random.Random(3), 0
    found: list[tuple[int, Message]] = []
    for arrival_ns, source, data in world.arrivals(imu=True):
        if now and draw.random() < 0.3:
            found += [(arrival_ns, m) for m in engine.advance(draw.randint(now, arrival_ns))]
        found += [(arrival_ns, m) for m in engine.arrive(source, arrival_ns, data)]
        now = arrival_ns
    return found


def test_the_engine_is_a_function_of_what_arrives() -> None:
    """Asked for the time in between or not, the messages are the same bits."""
    world = World(8.0, one_to_three_beams)
    once = [(a, m) for a, m, _ in fly(Engine(config("navigation")), world.arrivals(imu=True))]
    assert once == asked_in_between(Engine(config("navigation")), world)
    assert once


def test_navigation_coasts_and_comes_back_without_a_jump() -> None:
    """OK, PARTIAL, COASTING, OK; the velocity stays within its sigma, also where beams return."""
    engine = Engine(config("navigation"))
    sent = fly(engine, World(10.0, one_to_three_beams).arrivals(imu=True))
    assert states(sent) == ["OK", "PARTIAL", "COASTING", "OK"]
    found = lines(sent)
    times = np.array([line.time_ns for line in found])
    assert (np.diff(times) >= 1e8 - 1).all()
    errors = np.array([(line.velocity - VELOCITY) / line.sd for line in found])
    assert np.abs(errors).max() < 5.0
    for before, after in pairwise(found):
        jump = np.abs(after.velocity - before.velocity)
        assert (jump < 3.0 * np.hypot(before.sd, after.sd)).all()


def test_a_ping_is_not_sent_again_while_coasting() -> None:
    """The ports that pass beams on get none."""
    engine = Engine(config(mode="navigation"))
    fly(engine, World(6.4, one_to_three_beams).arrivals(imu=True))
    assert engine.state == "COASTING"
    (before, coasting) = (engine.estimator.estimate(state, 0) for state in ("PARTIAL", "COASTING"))
    assert before is not None
    assert coasting is not None
    assert before.beams is not None
    assert coasting.beams is None


def test_silent_inertial_readings_are_unsafe() -> None:
    """Nothing is sent from then on; after they are back it goes on, once the beams have made it certain."""
    engine = Engine(config("navigation"))
    sent: Flown = []
    gap = (START_NS + 4_000_000_000, START_NS + 5_000_000_000)
    for arrival_ns, source, data in World(9.0).arrivals(imu=True):
        if source == 1 and gap[0] < arrival_ns < gap[1]:
            engine.advance(arrival_ns)
            continue
        for message in engine.arrive(source, arrival_ns, data):
            assert engine.state not in SILENT
            sent.append((arrival_ns, message, engine.state))
    arrivals = np.array([arrival for arrival, _, _ in sent])
    assert not ((arrivals > gap[0] + 150_000_000) & (arrivals < gap[1])).any()
    assert states(sent)[-1] == "OK"
    assert engine.reset_counter == 0


def test_stamps_on_the_hosts_clock() -> None:
    """Taken as they are; one far ahead is refused, and the readings after it are not old."""
    settings = config("navigation", format="pd0")
    host = settings.source[1].model_copy(update={"clock": "host"})
    engine = Engine(settings.model_copy(update={"source": (settings.source[0], host)}))
    for k, (arrival_ns, source, data) in enumerate(World(3.0, form="pd0").arrivals(imu=True)):
        if source == 1:
            own, _, rest = data.partition(b"*")[0].partition(b",")
            ahead = 3600 * 1_000_000_000 if k == 100 else 0
            engine.arrive(1, arrival_ns, b"%d," % (START_NS + int(own) + ahead) + rest + b"\n")
        else:
            engine.arrive(source, arrival_ns, data)
    assert engine.state == "OK"
    assert dict(engine.sources[1].refused) == {"its time is not that of the host": 1}


@pytest.mark.parametrize(("column", "by"), [(4, 10.0), (4, -80.0), (6, 60.0), (3, 4.0)])
def test_one_inertial_reading_that_no_vehicle_makes(column: int, by: float) -> None:
    """A flipped bit of a force or a rate within the full scale, while no beam returns: no message is off by more."""
    engine, found = Engine(config("navigation")), []
    for arrival_ns, source, data in World(7.0, lambda t: (0, 1, 2, 3) if t > 5.0 else ()).arrivals(imu=True):
        given = data
        if source == 1 and data.startswith(b"5500000000,"):
            parts = data.partition(b"*")[0].split(b",")
            parts[column] = repr(float(parts[column]) + by).encode()
            given = b",".join(parts) + b"*%02X\n" % xor_of(b",".join(parts))
        found += [Sent.parse(message.data) for message in engine.arrive(source, arrival_ns, given)]
    late = [line for line in found if line.time_ns > START_NS + 5_500_000_000]
    assert len(late) > 10
    assert max(float(np.abs((line.velocity - VELOCITY) / line.sd).max()) for line in late) < 4.0
