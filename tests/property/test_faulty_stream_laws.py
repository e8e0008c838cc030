"""A stream with faults, read back: every row is a record that was sent, with its beams or fewer, never another's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock import BeamGeometry
from bottomlock.encoders.registry import FORMATS, Format, encoder
from bottomlock.errors import DataError
from bottomlock.instruments.faults import Faults
from bottomlock.instruments.readings import Readings, ranges_or_flat
from bottomlock.instruments.schedule import POWERED_S, records
from bottomlock.io import formats
from bottomlock.io.rows import Options
from tests.property.encoder_steps import STEPS

BASE_NS = 1_767_225_600_000_000_000
PINGS = 12
fractions = st.sampled_from([0.0, 0.1, 0.4])


def readings(beams: int, seed: int) -> Readings:
    """Pings of which no two share a number, every beam lost now and then."""
    rng = np.random.default_rng(seed)
    geometry = BeamGeometry.from_angles([np.deg2rad(25.0)] * beams, np.arange(beams) * 2 * np.pi / beams)
    beam_mps = np.where(rng.random((PINGS, beams)) < 0.8, rng.uniform(-3, 3, (PINGS, beams)), np.nan)
    return Readings(
        name="drawn",
        geometry=geometry,
        beam_sd_mps=np.full(beams, 0.01),
        time_ns=np.cumsum(rng.integers(10**8, 3 * 10**8, PINGS)),
        beam_mps=beam_mps,
        range_m=ranges_or_flat(rng.uniform(2, 40, (PINGS, beams)), beam_mps, geometry, 20.0),
        stated=rng.random(PINGS) < 0.8,
    )


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.name)
@given(
    seed=st.integers(0, 2**32 - 1),
    faults=st.builds(
        Faults,
        drops=fractions,
        duplicates=fractions,
        stale=fractions,
        half_lines=fractions,
        clock_steps=fractions,
        clock_step_s=st.sampled_from([0.05, 1.0, 30.0]),
    ),
)
def test_rows_are_records_that_were_sent(one: Format, seed: int, faults: Faults) -> None:
    """Drops, duplicates, stale records, half lines and clock steps, in any mixture."""
    run, steps = readings(one.beams, seed), STEPS[one.name]
    powered_ns = run.first_ns + BASE_NS - round(POWERED_S * 1e9)
    writer = encoder(one.name, run.geometry, start_ns=powered_ns)
    sent = list(records(run, writer, faults, seed=seed, offset_ns=BASE_NS))
    (reader,) = (found for found in formats.BYTES if found.name == one.name)
    try:
        table = reader.read(b"".join(record.data for record in sent), "bytes", Options()).table
    except DataError:
        # Nothing is left only where something was lost.
        assert any(record.faults & {"drops", "half_lines"} for record in sent)
        return
    since_ns = powered_ns if one.name == "cerulean-dvkfc" else 0
    stated = [record.stated for record in sent if record.data and record.stated is not None]
    times = np.array([(p.time_ns if steps.time_of == "validity" else p.sent_ns) - since_ns for p in stated])
    for row in range(table.rows):
        # Steps of the clock may bring two records to one time.
        near = np.flatnonzero(np.abs(times - table.time_ns[row]) <= steps.time_step_ns // 2)
        assert near.size
        valid = table.valid[row]
        assert any(
            (valid <= stated[k].valid).all()
            and np.allclose(
                table.velocity_mps[row, valid],
                stated[k].beam_velocity_mps[valid],
                rtol=1e-6,
                atol=0.51 * steps.velocity_step_mps,
            )
            for k in near
        )
