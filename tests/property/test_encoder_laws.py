"""Bytes of the encoders read back by our readers: beams to the format's resolution, validity and time exactly."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bottomlock import BeamGeometry
from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import FORMATS, Encoder, Format, encoder
from bottomlock.errors import DataError
from bottomlock.io import formats
from bottomlock.io.beam_table import Recording
from bottomlock.io.rows import Options
from tests.oracle.rotations import Array
from tests.property import strategies as sea
from tests.property.encoder_steps import STEPS

FEWER = settings(max_examples=settings().max_examples // 4)
SMALLEST = 1e-37
"""Below it a 32-bit float loses digits."""
START_NS = 1_700_000_000_000_000_000


def instrument(one: Format) -> Encoder:
    """An encoder with beams of 25 degrees, switched on at START_NS."""
    count = one.beams
    geometry = BeamGeometry.from_angles([np.deg2rad(25.0)] * count, np.arange(count) * 2 * np.pi / count)
    return encoder(one.name, geometry, start_ns=START_NS)


def read(one: Format, data: bytes) -> Recording:
    """The bytes by the reader of the same name, and found by it."""
    (reader,) = (found for found in formats.BYTES if found.name == one.name)
    assert reader.sniff(data)
    return reader.read(data, "bytes", Options())


@st.composite
def pings(draw: st.DrawFn, beams: int, fastest: float = 32.0) -> list[Ping]:
    """Pings of one instrument at rising times, every set of beams lost, with and without its own velocity."""
    found = []
    time_ns = START_NS + draw(st.integers(10**9, 10**17))
    number = draw(st.integers(1, 70_000))
    speeds = st.floats(-fastest, fastest)
    interval_ns = 0
    for _ in range(draw(st.integers(1, 5))):
        valid = draw(st.lists(st.booleans(), min_size=beams, max_size=beams).map(np.array))
        velocity = np.where(valid, draw(st.lists(speeds, min_size=beams, max_size=beams)), np.nan)
        ranges = np.where(valid, draw(sea.numbers(0.1, 6000.0, beams)), np.nan)
        known = draw(st.booleans())
        found.append(
            Ping(
                time_ns=time_ns,
                trigger_ns=time_ns - draw(st.integers(0, 10**8)),
                transmission_ns=time_ns + draw(st.integers(0, 10**9)),
                interval_ns=interval_ns,
                number=number,
                beam_velocity_mps=velocity,
                range_m=ranges,
                velocity_p_mps=draw(sea.numbers(-fastest, fastest, 3)) if known else None,
                covariance_m2ps2=np.diag(draw(sea.numbers(1e-8, 1.0, 3))) if known else None,
                altitude_m=draw(st.none() | st.floats(0.1, 6000.0)),
                attitude_rad=draw(st.none() | sea.numbers(-1.5, 1.5, 3)),
            )
        )
        interval_ns = draw(st.integers(2 * 10**8, 10**9))
        time_ns += interval_ns
        number += 1
    return found


def states(ping: Ping, one: Format) -> int:
    """The time that the record states, ns on the clock of the table."""
    time_ns = ping.time_ns if STEPS[one.name].time_of == "validity" else ping.sent_ns
    return time_ns - (START_NS if one.name == "cerulean-dvkfc" else 0)


def near(value: Array, truth: Array, step: float, relative: float) -> None:
    """Equal to half a step of the record, or to a float's relative error."""
    np.testing.assert_allclose(
        value, truth, rtol=4 * relative + 1e-12, atol=0.5000001 * step + SMALLEST * bool(relative)
    )


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.name)
@given(data=st.data())
def test_pings_read_back(one: Format, data: st.DataObject) -> None:
    """Every number of beams lost, any time of this century, any speed and range of a DVL."""
    sent, steps = data.draw(pings(one.beams)), STEPS[one.name]
    encode = instrument(one).encode
    recording = read(one, b"".join(encode(ping) for ping in sent))
    table, account = recording.table, recording.account
    assert not account.skipped
    assert not account.flagged
    assert table.rows == len(sent)
    assert np.array_equal(table.valid, [ping.valid for ping in sent])
    truth = np.array([ping.beam_velocity_mps for ping in sent])
    near(np.where(table.valid, table.velocity_mps, np.nan), truth, steps.velocity_step_mps, steps.relative)
    near(table.range_m, np.array([ping.range_m for ping in sent]), steps.range_step_m, steps.relative)
    late = [abs(int(t) - states(ping, one)) for t, ping in zip(table.time_ns, sent, strict=True)]
    assert max(late) <= steps.time_step_ns // 2
    if (table.instrument_valid >= 0).any():
        known = [ping.velocity_p_mps is not None for ping in sent]
        assert np.array_equal(table.instrument_valid == 1, known)
        own = np.array([ping.velocity_p_mps for ping in sent if ping.velocity_p_mps is not None]).reshape(
            -1, 3
        )
        near(table.instrument_mps[known], own, steps.velocity_step_mps, steps.relative)


def plain(beams: int, **changed: Any) -> Ping:  # noqa: ANN401 - any field
    values: dict[str, Any] = {
        "time_ns": START_NS + 10**9,
        "transmission_ns": START_NS + 2 * 10**9,
        "interval_ns": 10**8,
        "number": 1,
        "beam_velocity_mps": np.full(beams, 1.0),
        "range_m": np.full(beams, 10.0),
    }
    return Ping(**(values | changed))


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.name)
@given(
    value=st.floats(allow_nan=False, allow_infinity=False),
    beam=st.integers(0, 2),
    sign=st.sampled_from([-1, 1]),
)
def test_what_does_not_fit_is_an_error(one: Format, value: float, beam: int, sign: int) -> None:
    """A number at or beyond the field's limit comes back as it is, or is not written: never wrapped or clipped."""
    count, steps = one.beams, STEPS[one.name]
    for near_limit in (value, sign * 32.767, sign * 32.768, sign * 32.7675, sign * 1e9):
        velocity = np.full(count, 0.5)
        velocity[beam] = near_limit
        try:
            data = instrument(one).encode(plain(count, beam_velocity_mps=velocity))
        except DataError:
            assert abs(near_limit) > 32.7
            continue
        table = read(one, data).table
        assert table.valid.all()
        near(table.velocity_mps[0], velocity, steps.velocity_step_mps, steps.relative)


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.name)
@FEWER
@given(value=st.floats(0.0, 1e12))
def test_ranges_do_not_wrap(one: Format, value: float) -> None:
    """A range comes back, reads as none where it rounds to the mark for none, or is an error."""
    count, steps = one.beams, STEPS[one.name]
    for near_limit in (value, 655.35, 655.36, 167_772.15, 167_772.16):
        ranges = np.full(count, 3.0)
        ranges[1] = near_limit
        try:
            data = instrument(one).encode(plain(count, range_m=ranges))
        except DataError:
            assert near_limit < 0.01 or near_limit > 1e5
            continue
        found = read(one, data).table.range_m[0]
        assert np.isnan(found[1]) <= (near_limit < 1e-6)
        near(found[np.isfinite(found)], ranges[np.isfinite(found)], steps.range_step_m, steps.relative)
