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
from tests.audit.synthetic import Array, channels, janus, kinds, make_log, motion, stale

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
    assert "cannot distinguish" in swapped.hint


@pytest.mark.parametrize("by_deg", [-3.0, 1.0, 3.0])
def test_mistilted_beam_that_the_instrument_knows(by_deg: float) -> None:
    """The instrument solves with the true tilt, the stated geometry is wrong: the regression gives the difference."""
    audit = audit_log(make_log(4, physical=mistilted(2, by_deg)), stated=STATED)
    assert kinds(audit.findings) == {("mistilted_beam", (3,))}
    assert audit.findings[0].size == pytest.approx(abs(by_deg), abs=0.05)


DEPENDS = ("closure_depends_on_velocity", ())


@pytest.mark.parametrize("instrument", [True, False])
def test_mistilted_beam_that_the_instrument_does_not_know(instrument: bool) -> None:
    """The instrument's own matrix is nominal, and the regression gives it back; the closure moves with the velocity."""
    log = make_log(5, physical=mistilted(2, 3.0), used=janus(), instrument=instrument, pings=4000)
    audit = audit_log(log, stated=STATED)
    assert [(one.kind, one.beams, one.severity) for one in audit.findings] == [(*DEPENDS, "fault")]
    if audit.assessment.matrix is not None:
        np.testing.assert_allclose(np.rad2deg(audit.assessment.matrix.tilt_rad), 22.0, atol=0.05)


def test_beam_that_reads_too_long() -> None:
    rows = janus()
    rows[1] *= 1.05
    assert found(make_log(6, physical=rows, used=janus(), pings=4000)) == {DEPENDS}


def test_beam_that_is_too_long_and_the_instrument_knows() -> None:
    rows = janus()
    rows[1] *= 1.05
    audit = audit_log(make_log(6, physical=rows), stated=STATED)
    assert kinds(audit.findings) == {("scale", (2,))}
    assert audit.findings[0].size == pytest.approx(5.0, abs=0.05)


@pytest.mark.parametrize("stated", [STATED, None])
@pytest.mark.parametrize("factors", [(0.8, 1, 1, 1), (1, 1, 1.02, 1), (1.04, 0.97, 1, 1), (1, 2.0, 1, 1)])
def test_channels_scaled_after_the_instrument_solved(
    factors: tuple[float, ...], stated: BeamGeometry | None
) -> None:
    """The matrix of such a log differs from the beams in more rows than are at fault; no other order is accused."""
    log = make_log(21)
    audit = audit_log(replace(log, velocity_mps=log.velocity_mps * factors), stated=stated)
    made = kinds(audit.findings)
    assert DEPENDS in made
    assert {kind for kind, _ in made} <= {"closure_depends_on_velocity", "mistilted_beam", "scale"}
    assert any(one.kind == "scale" and one.size > 0.5 for one in audit.findings)


def test_a_channel_turned_after_the_instrument_solved() -> None:
    log = make_log(22)
    assert log.instrument_mps is not None
    y = log.velocity_mps.copy()
    y[:, 1] += log.instrument_mps @ (janus(25.0)[1] - janus(22.0)[1])
    audit = audit_log(replace(log, velocity_mps=y), stated=STATED)
    assert DEPENDS in kinds(audit.findings)
    (turned,) = (one for one in audit.findings if one.kind == "mistilted_beam")
    assert 2 in turned.beams


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
    assert (note.kind, note.severity) == ("beams_alone", "note")
    assert "weights +1.00 -1.00 +1.00 -1.00" in note.text
    assert "9 of the 12 entries" in note.evidence


@pytest.mark.parametrize("seed", range(31, 35))
def test_no_geometry_and_one_noisy_beam_is_no_fault(seed: int) -> None:
    """One beam three times noisier than the rest moves the combination of least spread off ±1."""
    rng = np.random.default_rng(seed)
    log = make_log(seed, instrument=False, sd_mps=0.03)
    noisy = log.velocity_mps + 0.08 * rng.normal(size=(log.pings, 4)) * [1.0, 0.0, 0.0, 0.0]
    audit = audit_log(replace(log, velocity_mps=noisy))
    (note,) = audit.findings
    assert (note.kind, note.severity) == ("beams_alone", "note")
    (combination,) = audit.assessment.closures
    assert np.sign(combination.weights).tolist() in ([1, -1, 1, -1], [-1, 1, -1, 1])


def steady(seed: int, pings: int, varies: float) -> BeamLog:
    """Beams alone on a course at 0.8, 0.1, 0.05 m/s."""
    rng = np.random.default_rng(seed)
    velocity = np.array([0.8, 0.1, 0.05]) + varies * (motion(rng, pings) - [0.6, 0.0, 0.0])
    return make_log(seed, velocity=velocity, pings=pings, instrument=False, sd_mps=0.02)


def test_neighbours_exchanged_on_a_steady_course_or_a_bias() -> None:
    """At one velocity the two cannot be told apart: both are named, and no geometry is written."""
    (only,) = audit_log(channels(steady(24, 400, 0.0), [1, 0, 2, 3]), stated=STATED).findings
    assert only.kind == "order_or_bias"
    assert "exchanged" in only.text
    assert "bias" in only.text


def test_neighbours_exchanged_are_told_by_motion() -> None:
    """Decimetres a second of change decide against a bias."""
    (only,) = audit_log(channels(steady(25, 400, 1.0), [1, 0, 2, 3]), stated=STATED).findings
    assert only.kind == "swapped_beams"


def test_a_bias_is_no_exchange() -> None:
    """A closure that stays where it is while the vehicle moves."""
    log = steady(26, 600, 1.0)
    (only,) = audit_log(
        replace(log, velocity_mps=log.velocity_mps + np.array([0.15, 0.0, 0.0, 0.0])), stated=STATED
    ).findings
    assert only.kind == "closure_bias"
    assert only.size == pytest.approx(150.0, abs=5.0)


@pytest.mark.parametrize("seed", range(41, 45))
def test_correlated_noise_is_no_bias(seed: int) -> None:
    """A closure that wanders over forty pings has a mean; it is no bias."""
    rng = np.random.default_rng(seed)
    log = make_log(seed, instrument=False, pings=1000, decimals=None)
    wander = np.zeros(1000)
    for k in range(1, 1000):
        wander[k] = 0.95 * wander[k - 1] + 0.31 * rng.normal()
    noisy = log.velocity_mps + 0.03 * wander[:, None] * [1.0, 0.0, 0.0, 0.0]
    assert "closure_bias" not in {
        one.kind for one in audit_log(replace(log, velocity_mps=noisy), stated=STATED).findings
    }


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
