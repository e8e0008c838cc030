"""Whatever is planted in a log is found, and nothing else; what cannot be seen is not claimed."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bottomlock import BeamGeometry
from bottomlock.audit.logs import BeamLog, read_log
from bottomlock.audit.run import Audit
from bottomlock.io import pd0
from bottomlock.io.beam_table import write_recording
from bottomlock.io.beams import read_geometry
from tests.audit.synthetic import Array, channels, janus, kinds, make_log, motion, stale

STATED = BeamGeometry.janus(np.deg2rad(22.0))
ALL = (1, 2, 3, 4)
RIVER = Path(__file__).parents[2] / "data" / "logs" / "pd0_riverpro" / "RiverPro_test01.PD0"


def found(log: BeamLog, *, stated: BeamGeometry | None = STATED) -> set[tuple[str, tuple[int, ...]]]:
    return kinds(Audit(log, stated=stated).findings)


def rows(beam: int, tilt_deg: float = 22.0, factor: float = 1.0) -> Array:
    """A Janus of which one beam has another tilt, or reads too long."""
    made = janus().copy()
    made[beam] = factor * janus(tilt_deg)[beam]
    return made


def steady(seed: int, pings: int, varies: float) -> BeamLog:
    """Beams alone on a course at 0.8, 0.1, 0.05 m/s."""
    rng = np.random.default_rng(seed)
    velocity = np.array([0.8, 0.1, 0.05]) + varies * (motion(rng, pings) - [0.6, 0.0, 0.0])
    return make_log(seed, velocity=velocity, pings=pings, instrument=False, sd_mps=0.02)


def read(log: BeamLog, *, bias: tuple[float, ...] = (0.0,) * 4, zero: slice = slice(0, 0)) -> BeamLog:
    """With biases of the channels, and readings of beam 4 that are 0."""
    y = log.velocity_mps + np.array(bias)
    y[zero, 3] = 0.0
    return replace(log, velocity_mps=y)


def own(log: BeamLog, by: Callable[[Array], Array]) -> BeamLog:
    """With another velocity of the instrument's own."""
    assert log.instrument_mps is not None
    return replace(log, instrument_mps=by(log.instrument_mps))


def shared_bias() -> BeamLog:
    log = read(make_log(9), bias=(0.0, 0.02, 0.0, 0.0))
    return own(log, lambda _: log.velocity_mps @ np.linalg.pinv(janus()).T)


def hardly_moves() -> BeamLog:
    drift = np.random.default_rng(18).normal(size=(600, 3)) * 1e-4
    log = make_log(18, velocity=np.zeros((600, 3)), sd_mps=1e-5, decimals=None)
    return own(log, lambda velocity: velocity + drift)


ONE = (0.0, 0.02, 0.0, 0.0)
DEPENDS = ("closure_depends_on_velocity", ())
Found = list[tuple[str, tuple[int, ...]]]
PLANTED: list[tuple[Callable[[], BeamLog], Found, float | None, float]] = [
    (lambda: channels(make_log(1), [1, 0, 2, 3]), [("swapped_beams", (1, 2))], None, 0),
    (lambda: channels(make_log(1), [2, 1, 0, 3]), [("swapped_beams", (1, 3))], None, 0),
    (lambda: channels(make_log(1), [1, 2, 3, 0]), [("swapped_beams", ALL)], None, 0),
    (lambda: channels(make_log(1), [0, 1, 2, 3], [1, -1, 1, 1]), [("sign_flipped", (2,))], None, 0),
    (lambda: channels(make_log(1), [0, 1, 2, 3], [-1] * 4), [("all_signs_flipped", ALL)], None, 0),
    (lambda: channels(make_log(1), [0, 1, 2, 0]), [("identical_beams", (1, 4))], None, 0),
    (lambda: channels(make_log(1), [0, 1, 2, 0], [1, 1, 1, -1]), [("identical_beams", (1, 4))], None, 0),
    (lambda: channels(make_log(2), [3, 1, 2, 0], [1, 1, -1, 1]),
     [("swapped_beams", (1, 4)), ("sign_flipped", (3,))], None, 0),
    (lambda: make_log(4, physical=rows(2, 19.0)), [("mistilted_beam", (3,))], 3.0, 0.05),
    (lambda: make_log(4, physical=rows(2, 23.0)), [("mistilted_beam", (3,))], 1.0, 0.05),
    (lambda: make_log(4, physical=rows(2, 25.0)), [("mistilted_beam", (3,))], 3.0, 0.05),
    (lambda: make_log(6, physical=rows(1, factor=1.05), used=janus(), pings=4000), [DEPENDS], None, 0),
    (lambda: make_log(6, physical=rows(1, factor=1.05)), [("scale", (2,))], 5.0, 0.05),
    # A sound speed that the velocity was corrected for and the beams were not.
    (lambda: own(make_log(7), lambda velocity: velocity / 1.02), [("scale", ALL)], 2.0, 0.05),
    (lambda: read(make_log(8), bias=ONE), [("beam_bias", (2,))], 20.0, 1.0),
    # One combination of the four is all that anybody can see.
    (shared_bias, [("closure_bias", ())], None, 0),
    (lambda: make_log(10, physical=janus(first_deg=0.0)), [("rotated_geometry", ())], 45.0, 0.1),
    (lambda: stale(make_log(11), list(range(200, 260, 3))), [("stale_pings", ())], 20.0, 0),
    (lambda: read(make_log(12), zero=slice(300, 312)), [("zero_as_valid", (4,))], 12.0, 0),
    (lambda: make_log(14, heavy=True), [("heavy_tails", ())], None, 0),
    # Decimetres a second of change decide between an exchange and a bias.
    (lambda: channels(steady(25, 400, 1.0), [1, 0, 2, 3]), [("swapped_beams", ALL)], None, 0),
    (lambda: read(steady(26, 600, 1.0), bias=(0.15, 0.0, 0.0, 0.0)), [("closure_bias", ())], 150.0, 5.0),
    (hardly_moves, [("directions_not_observable", ())], None, 0),
]  # fmt: skip


@pytest.mark.parametrize(("planted", "expected", "size", "within"), PLANTED)
def test_what_is_planted_is_found_and_nothing_else(
    planted: Callable[[], BeamLog], expected: Found, size: float | None, within: float
) -> None:
    findings = Audit(planted(), stated=STATED).findings
    assert kinds(findings) == set(expected)
    if size is not None:
        assert findings[0].size == pytest.approx(size, abs=within)


def test_closure_alone_sees_neighbours_swapped_but_not_opposite_beams() -> None:
    """Closure is 1 − 2 + 3 − 4: exchanging 1 and 3 does not change it, exchanging 1 and 2 does; so does any flip."""
    log = make_log(3, instrument=False)
    assert found(channels(log, [2, 1, 0, 3])) == set()
    assert found(channels(log, [1, 2, 3, 0])) == set()
    assert found(channels(log, [0, 1, 2, 3], [-1] * 4)) == set()
    assert found(channels(log, [0, 1, 2, 3], [1, 1, -1, 1])) == {("sign_flipped", (3,))}
    (swapped,) = Audit(channels(log, [1, 0, 2, 3]), stated=STATED).findings
    # Exchanging 3 and 4 has the same closure as exchanging 1 and 2; the other two pairs have another.
    assert swapped.kind == "swapped_beams"
    assert swapped.text.endswith("beams 1 and 2 exchanged; or beams 3 and 4 exchanged.")
    assert "cannot distinguish" in swapped.hint


@pytest.mark.parametrize("instrument", [True, False])
def test_mistilted_beam_that_the_instrument_does_not_know(instrument: bool) -> None:
    """The instrument's own matrix is nominal, and the regression gives it back; the closure moves with the velocity."""
    log = make_log(5, physical=rows(2, 25.0), used=janus(), instrument=instrument, pings=4000)
    audit = Audit(log, stated=STATED)
    assert [(one.kind, one.beams, one.severity) for one in audit.findings] == [(*DEPENDS, "fault")]
    if audit.matrix is not None:
        np.testing.assert_allclose(np.rad2deg(audit.matrix.tilt_rad), 22.0, atol=0.05)


@pytest.mark.parametrize("stated", [STATED, None])
@pytest.mark.parametrize("factors", [(0.8, 1, 1, 1), (1, 1, 1.02, 1), (1.04, 0.97, 1, 1), (1, 2.0, 1, 1)])
def test_channels_scaled_after_the_instrument_solved(
    factors: tuple[float, ...], stated: BeamGeometry | None
) -> None:
    """The matrix of such a log differs from the beams in more rows than are at fault; no other order is accused."""
    log = make_log(21)
    audit = Audit(replace(log, velocity_mps=log.velocity_mps * factors), stated=stated)
    made = kinds(audit.findings)
    assert DEPENDS in made
    assert {kind for kind, _ in made} <= {"closure_depends_on_velocity", "mistilted_beam", "scale"}
    assert any(one.kind == "scale" and one.size > 0.5 for one in audit.findings)


def test_a_channel_turned_after_the_instrument_solved() -> None:
    log = make_log(22)
    assert log.instrument_mps is not None
    y = log.velocity_mps.copy()
    y[:, 1] += log.instrument_mps @ (janus(25.0)[1] - janus(22.0)[1])
    audit = Audit(replace(log, velocity_mps=y), stated=STATED)
    assert DEPENDS in kinds(audit.findings)
    (turned,) = (one for one in audit.findings if one.kind == "mistilted_beam")
    assert 2 in turned.beams


def test_a_stuck_beam() -> None:
    """700 pings at one value; a run of nine is looked over, as a coarse resolution makes it."""
    log = make_log(17, decimals=3)
    y = log.velocity_mps.copy()
    y[200:900, 1] = y[200, 1]
    audit = Audit(replace(log, velocity_mps=y), stated=STATED)
    (stuck,) = [one for one in audit.findings if one.kind == "stuck_beam"]
    assert (stuck.severity, stuck.beams, stuck.size) == ("fault", (2,), 700.0)
    assert "row 200" in stuck.evidence
    y = log.velocity_mps.copy()
    y[500:509, 1] = y[500, 1]
    assert "stuck_beam" not in {
        one.kind for one in Audit(replace(log, velocity_mps=y), stated=STATED).findings
    }


def test_a_noisy_beam_is_named_and_is_no_fault() -> None:
    """One beam five times noisier than the rest biases the plain regression by degrees; here it is only named."""
    audit = Audit(make_log(15, unequal=True, sd_mps=0.03), stated=STATED)
    assert [(one.kind, one.severity) for one in audit.findings] == [("noisy_beam", "warning")]
    assert audit.findings[0].size == pytest.approx(5.0, rel=0.2)
    assert audit.matrix is not None
    np.testing.assert_allclose(np.rad2deg(audit.matrix.tilt_rad), 22.0, atol=0.02)
    y, own = audit.log.velocity_mps, audit.log.instrument_mps
    assert own is not None
    plain = np.linalg.lstsq(np.hstack([own, np.ones((len(own), 1))]), y, rcond=None)[0][:3].T
    assert np.abs(plain - janus()).max() > 0.03


def test_beams_alone_and_unstated() -> None:
    """Which packaged geometries close is all that four readings tell; at rest, and of three, nothing."""
    (note,) = Audit(make_log(16, instrument=False)).findings
    assert (note.kind, note.severity) == ("packaged_geometries", "note")
    assert {"linkquest_navquest", "waterlinked_a50", "x_janus_20"} <= set(re.findall(r"\w+", note.text))
    assert "teledyne_20" not in note.text
    still = make_log(13, velocity=np.zeros((2000, 3)), sd_mps=0.001, decimals=3, instrument=False)
    three = make_log(17, physical=janus()[:3], instrument=False)
    for log in (still, three):
        (note,) = Audit(log).findings
        assert (note.kind, note.severity) == ("beams_alone", "note")


@pytest.mark.parametrize("seed", range(31, 35))
def test_no_geometry_and_one_noisy_beam_is_no_fault(seed: int) -> None:
    """One beam three times noisier than the rest may hide which geometries close, and accuses none."""
    rng = np.random.default_rng(seed)
    log = make_log(seed, instrument=False, sd_mps=0.03)
    noisy = log.velocity_mps + 0.08 * rng.normal(size=(log.pings, 4)) * [1.0, 0.0, 0.0, 0.0]
    audit = Audit(replace(log, velocity_mps=noisy))
    (note,) = audit.findings
    assert note.severity == "note"
    assert note.kind in {"packaged_geometries", "beams_alone"}
    for closure in audit.closures:
        np.testing.assert_allclose(closure.weights, [1, -1, 1, -1], atol=1e-6)


def test_neighbours_exchanged_on_a_steady_course_or_a_bias() -> None:
    """At one velocity the two cannot be told apart: both are named, and no geometry is written."""
    (only,) = Audit(channels(steady(24, 400, 0.0), [1, 0, 2, 3]), stated=STATED).findings
    assert only.kind == "order_or_bias"
    assert "exchanged" in only.text
    assert "bias" in only.text


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
        one.kind for one in Audit(replace(log, velocity_mps=noisy), stated=STATED).findings
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
    write_recording(pd0.FORMAT.read(RIVER.read_bytes(), RIVER.name), path, source=RIVER)
    log, stated = read_log(path), read_geometry("teledyne_20").geometry
    clean = {kind for kind, _ in found(log, stated=stated)}
    made = [one for one in Audit(channels(log, order, sign), stated=stated).findings if one.kind not in clean]
    assert [one.kind for one in made if one.severity != "note" and one.kind not in expected] == []
    assert any(one.kind in expected and beam in one.beams for one in made) == bool(expected)
