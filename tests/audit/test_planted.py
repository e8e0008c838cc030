"""Whatever is planted in a log is found, and nothing else; what cannot be seen is not claimed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bottomlock import BeamGeometry
from bottomlock.audit.logs import BeamLog, read_log
from bottomlock.audit.run import audit_log
from bottomlock.io import pd0
from bottomlock.io.beam_table import write_recording
from bottomlock.io.beams import read_geometry
from tests.audit.synthetic import Array, channels, janus, kinds, make_log, stale

STATED = BeamGeometry.janus(np.deg2rad(22.0))
ALL = (1, 2, 3, 4)
RIVER = Path(__file__).parents[2] / "data" / "logs" / "pd0_riverpro" / "RiverPro_test01.PD0"


def mistilted(beam: int, by_deg: float) -> Array:
    rows = janus().copy()
    rows[beam] = janus(22.0 + by_deg)[beam]
    return rows


def found(log: BeamLog, *, stated: BeamGeometry | None = STATED) -> set[tuple[str, tuple[int, ...]]]:
    return kinds(audit_log(log, stated=stated).findings)


def zeros(log: BeamLog, beam: int, rows: range) -> BeamLog:
    y = log.velocity_mps.copy()
    y[list(rows), beam] = 0.0
    return replace(log, velocity_mps=y)


@pytest.mark.parametrize(
    ("order", "sign", "expected"),
    [
        ([1, 0, 2, 3], None, ("swapped_beams", (1, 2))),
        ([2, 1, 0, 3], None, ("swapped_beams", (1, 3))),
        ([1, 2, 3, 0], None, ("swapped_beams", ALL)),
        ([0, 1, 2, 3], [1, -1, 1, 1], ("sign_flipped", (2,))),
        ([0, 1, 2, 3], [-1, -1, -1, -1], ("all_signs_flipped", ALL)),
        ([0, 1, 2, 0], None, ("identical_beams", (1, 4))),
        ([0, 1, 2, 0], [1, 1, 1, -1], ("identical_beams", (1, 4))),
    ],
)
def test_channels_against_the_velocity(
    order: list[int], sign: list[int] | None, expected: tuple[str, tuple[int, ...]]
) -> None:
    """With the instrument's velocity beside them every order and sign is told, the mirrored ones too."""
    assert found(channels(make_log(1), order, sign)) == {expected}


def test_order_and_sign_together() -> None:
    log = channels(make_log(2), [3, 1, 2, 0], [1, 1, -1, 1])
    assert found(log) == {("swapped_beams", (1, 4)), ("sign_flipped", (3,))}


def test_closure_alone_sees_neighbours_swapped_but_not_opposite_beams() -> None:
    """Closure is 1 − 2 + 3 − 4: exchanging 1 and 3 does not change it, exchanging 1 and 2 does; so does any flip."""
    log = make_log(3, instrument=False)
    assert found(channels(log, [2, 1, 0, 3])) == set()
    assert found(channels(log, [1, 2, 3, 0])) == set()
    assert found(channels(log, [0, 1, 2, 3], [-1] * 4)) == set()
    assert found(channels(log, [0, 1, 2, 3], [1, 1, -1, 1])) == {("sign_flipped", (3,))}
    (swapped,) = audit_log(channels(log, [1, 0, 2, 3]), stated=STATED).findings
    # Exchanging 3 and 4 has the same closure as exchanging 1 and 2; the other two pairs have another.
    assert swapped.kind == "swapped_beams"
    assert swapped.text.endswith("beams 1 and 2 exchanged; or beams 3 and 4 exchanged.")
    assert "cannot distinguish" in swapped.advice


@pytest.mark.parametrize("by_deg", [-3.0, 1.0, 3.0])
def test_mistilted_beam_that_the_instrument_knows(by_deg: float) -> None:
    """The instrument solves with the true tilt, the stated geometry is wrong: the regression gives the difference."""
    audit = audit_log(make_log(4, physical=mistilted(2, by_deg)), stated=STATED)
    assert kinds(audit.findings) == {("mistilted_beam", (3,))}
    assert audit.findings[0].size == pytest.approx(abs(by_deg), abs=0.05)


@pytest.mark.parametrize("instrument", [True, False])
def test_mistilted_beam_that_the_instrument_does_not_know(instrument: bool) -> None:
    """The instrument's own matrix is nominal, and the regression gives it back; the closure moves with the velocity."""
    log = make_log(5, physical=mistilted(2, 3.0), used=janus(), instrument=instrument, pings=4000)
    audit = audit_log(log, stated=STATED)
    assert kinds(audit.findings) == {("mistilted_beam", (3,))}
    if audit.assessment.matrix is not None:
        np.testing.assert_allclose(np.rad2deg(audit.assessment.matrix.tilt_rad), 22.0, atol=0.05)
    best = audit.assessment.suspects[0]
    assert best.beam == 2
    assert abs(np.rad2deg(best.tilt_change_rad) - 3.0) < 4.0 * np.rad2deg(best.angle_sd_rad)


def test_beam_that_reads_too_long() -> None:
    rows = janus()
    rows[1] *= 1.05
    audit = audit_log(make_log(6, physical=rows, used=janus(), pings=4000), stated=STATED)
    assert [one.kind for one in audit.findings] == ["beam_scale"]
    best = audit.assessment.suspects[0]
    assert best.beam == 1
    assert best.scale == pytest.approx(0.05, abs=0.015)


def test_instrument_of_another_scale() -> None:
    """A sound speed that the velocity was corrected for and the beams were not."""
    log = make_log(7)
    assert log.instrument_mps is not None
    audit = audit_log(replace(log, instrument_mps=log.instrument_mps / 1.02), stated=STATED)
    assert kinds(audit.findings) == {("scale", ALL)}
    assert audit.findings[0].size == pytest.approx(2.0, abs=0.05)


def test_bias_of_one_channel() -> None:
    """The regression finds the part that looks like a velocity, the closure the rest: the bias is whole."""
    log = make_log(8)
    audit = audit_log(
        replace(log, velocity_mps=log.velocity_mps + np.array([0.0, 0.02, 0.0, 0.0])), stated=STATED
    )
    assert kinds(audit.findings) == {("beam_bias", (2,))}
    assert audit.findings[0].size == pytest.approx(20.0, abs=1.0)


def test_bias_that_the_instrument_shares() -> None:
    """Then one combination of the four is all that anybody can see."""
    log = make_log(9)
    y = log.velocity_mps + np.array([0.0, 0.02, 0.0, 0.0])
    own = y @ np.linalg.pinv(janus()).T
    assert found(replace(log, velocity_mps=y, instrument_mps=own)) == {("closure_bias", ())}


def test_whole_array_turned() -> None:
    audit = audit_log(make_log(10, physical=janus(first_deg=0.0)), stated=STATED)
    assert kinds(audit.findings) == {("rotated_geometry", ())}
    assert audit.findings[0].size == pytest.approx(45.0, abs=0.1)


def test_stale_pings() -> None:
    audit = audit_log(stale(make_log(11), list(range(200, 260, 3))), stated=STATED)
    assert kinds(audit.findings) == {("stale_pings", ())}
    assert audit.findings[0].size == 20
    assert "row 200" in audit.findings[0].evidence


def test_zero_that_stands_for_nothing() -> None:
    audit = audit_log(zeros(make_log(12), 3, range(300, 312)), stated=STATED)
    assert kinds(audit.findings) == {("zero_as_valid", (4,))}
    assert audit.findings[0].size == 12


def test_vehicle_at_rest_reads_zero() -> None:
    """Readings of 1 mm/s resolution at rest are often exactly zero, and often the same twice."""
    log = make_log(13, velocity=np.zeros((2000, 3)), sd_mps=0.001, decimals=3)
    assert {kind for kind, _ in found(log)} <= {"directions_not_observable"}


def test_heavy_tails() -> None:
    assert found(make_log(14, heavy=True)) == {("heavy_tails", ())}


def test_a_stuck_beam() -> None:
    """700 pings at one value; a run of nine is looked over, as a coarse resolution makes it."""
    log = make_log(17, decimals=3)
    y = log.velocity_mps.copy()
    y[200:900, 1] = y[200, 1]
    audit = audit_log(replace(log, velocity_mps=y), stated=STATED)
    (stuck,) = [one for one in audit.findings if one.kind == "stuck_beam"]
    assert (stuck.severity, stuck.beams, stuck.size) == ("fault", (2,), 700.0)
    assert "row 200" in stuck.evidence
    y = log.velocity_mps.copy()
    y[500:509, 1] = y[500, 1]
    assert "stuck_beam" not in {
        one.kind for one in audit_log(replace(log, velocity_mps=y), stated=STATED).findings
    }


def test_a_noisy_beam_is_named_and_is_no_fault() -> None:
    """One beam five times noisier than the rest biases the plain regression by degrees; here it is only named."""
    audit = audit_log(make_log(15, unequal=True, sd_mps=0.03), stated=STATED)
    assert [(one.kind, one.severity) for one in audit.findings] == [("noisy_beam", "warning")]
    assert audit.findings[0].size == pytest.approx(5.0, rel=0.2)
    assert audit.assessment.matrix is not None
    np.testing.assert_allclose(np.rad2deg(audit.assessment.matrix.tilt_rad), 22.0, atol=0.02)
    y, own = audit.log.velocity_mps, audit.log.instrument_mps
    assert own is not None
    plain = np.linalg.lstsq(np.hstack([own, np.ones((len(own), 1))]), y, rcond=None)[0][:3].T
    assert np.abs(plain - janus()).max() > 0.03


def test_beams_alone_and_unstated() -> None:
    """Which beams face each other is all that four readings tell."""
    (note,) = audit_log(make_log(16, instrument=False)).findings
    assert note.kind == "beams_alone"
    assert "beams 1 and 3 face each other, and beams 2 and 4" in note.text
    assert "9 of the 12 entries" in note.evidence


def test_three_beams() -> None:
    """Three beams have no closure; the regression still finds their directions."""
    rows = janus()[:3]
    audit = audit_log(make_log(17, physical=rows))
    assert audit.findings == []
    assert audit.assessment.closures == []
    assert audit.assessment.matrix is not None
    np.testing.assert_allclose(audit.assessment.matrix.directions, rows, atol=2e-3)


def test_a_log_that_hardly_moves() -> None:
    """At rest directions are not observable, and the audit says so instead of guessing."""
    log = make_log(18, velocity=np.zeros((600, 3)), sd_mps=1e-5, decimals=None)
    assert log.instrument_mps is not None
    drift = np.random.default_rng(18).normal(size=(600, 3)) * 1e-4
    assert found(replace(log, instrument_mps=log.instrument_mps + drift)) == {
        ("directions_not_observable", ())
    }


@pytest.mark.parametrize(
    ("order", "sign", "expected", "beam"),
    [
        ([2, 1, 0, 3], [1, 1, 1, 1], {"swapped_beams", "order_or_bias"}, 3),
        ([1, 0, 2, 3], [1, 1, 1, 1], set(), 0),
        ([0, 1, 2, 3], [1, 1, -1, 1], {"sign_flipped", "order_or_bias"}, 3),
    ],
)
def test_channels_of_a_river_profiler(
    order: list[int], sign: list[int], expected: set[str], beam: int, tmp_path: Path
) -> None:
    """A recording of 270 pings without a velocity of its own: opposite beams exchanged cannot be seen."""
    path = tmp_path / "river.parquet"
    write_recording(pd0.read(RIVER.read_bytes(), RIVER.name), path, source=RIVER)
    log, stated = read_log(path), read_geometry("teledyne_20").geometry
    clean = {kind for kind, _ in found(log, stated=stated)}
    made = [
        one for one in audit_log(channels(log, order, sign), stated=stated).findings if one.kind not in clean
    ]
    assert [one.kind for one in made if one.severity != "note" and one.kind not in expected] == []
    assert any(one.kind in expected and beam in one.beams for one in made) == bool(expected)
