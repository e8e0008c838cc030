"""Kinds of findings that take a log of their own, with their numbers; and what the page says of the estimates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from matplotlib.patches import Rectangle

from bottomlock import BeamGeometry
from bottomlock.audit.defects import copies
from bottomlock.audit.findings import KINDS, finding
from bottomlock.audit.geometry_file import geometry_text
from bottomlock.audit.logs import read_log, read_reference, tracked
from bottomlock.audit.page import closure_figure, page_of
from bottomlock.audit.run import Audit, numbers_of
from bottomlock.errors import DataError
from bottomlock.figures.drawing import on_paper
from bottomlock.io.beams import Columns
from bottomlock.pages.page import Table
from tests.audit.synthetic import Array, janus, make_log
from tests.audit.test_mounting import alone

T = np.arange(0.0, 600.0, 0.4)
NS = np.round(T * 1e9).astype(np.int64)


def test_two_transducers_that_look_the_same_way() -> None:
    """Their numbers differ by noise: the matrix tells which channel is another's beam."""
    rows = janus()
    rows[3] = rows[0]
    stated = BeamGeometry.janus(np.deg2rad(22.0))
    found = Audit(make_log(41, physical=rows), stated=stated).findings
    assert [(one.kind, one.beams) for one in found] == [("swapped_beams", (4,))]
    assert "channel 4 is beam 1" in found[0].text


@pytest.mark.parametrize(("sign", "told"), [(1, "same numbers in"), (-1, "sign changed")])
def test_one_channel_twice(sign: int, told: str) -> None:
    """In four fifths of the pings; the rest, and readings of zero, are others."""
    y = make_log(46, decimals=None).velocity_mps.copy()
    y[:960, 3] = sign * y[:960, 0]
    y[:40] = 0.0
    (one,) = copies(replace(make_log(46, decimals=None), velocity_mps=y))
    assert (one.beams, one.unit) == ((1, 4), "of pings")
    assert one.size == pytest.approx(920 / 1160)
    assert told in one.text


def test_a_reference_of_another_time_is_told() -> None:
    """An instrument that counts from its start beside the time of day: it is compared with nothing."""
    log, later = make_log(44), NS + 1_764_000_000_000_000_000
    reference = tracked(later, np.zeros((len(T), 3)), np.zeros((len(T), 3)))
    (one,) = (one for one in Audit(log, reference=reference).findings if one.kind == "another_time")
    assert (one.severity, one.unit) == ("fault", "s")
    assert one.size == pytest.approx(1e-9 * (later[0] - log.time_ns[0]))
    assert [one for one in Audit(log).findings if one.kind == "another_time"] == []


@pytest.mark.parametrize(("column", "value"), [("roll_rad", -10.0), ("pitch_rad", 4.0)])
def test_an_attitude_in_degrees_is_refused(column: str, value: float, tmp_path: Path) -> None:
    table = pl.DataFrame({"time_ns": [0, 10**9], "roll_rad": 0.0, "pitch_rad": 0.1, "yaw_rad": 7.0})
    table = table.with_columns(pl.Series(column, [0.0, value]))
    table.write_csv(tmp_path / "a.csv")
    with pytest.raises(DataError, match=r"a\.csv: row 1: column '\w+' is .*; is it in degrees\?") as error:
        read_reference(tmp_path / "a.csv")
    assert error.value.key == column


def test_a_velocity_of_another_vehicle() -> None:
    rng = np.random.default_rng(2)
    other = np.stack([0.5 + 0.3 * np.sin(T / 7.0), 0.2 * np.cos(T / 5.0), 0.0 * T], axis=1)
    rpy = np.stack([0.0 * T, 0.0 * T, 0.5 * np.sin(T / 20.0)], axis=1)
    reference = tracked(NS, rpy, 0.3 * rng.normal(size=other.shape).cumsum(axis=0) / 20.0)
    (one,) = Audit(alone(T, other), reference=reference).findings
    assert (one.kind, one.severity) == ("mounting_not_observable", "note")


def test_a_log_of_too_few_pings() -> None:
    (one,) = Audit(make_log(42, pings=30), stated=BeamGeometry.janus(np.deg2rad(22.0))).findings
    assert (one.kind, one.size) == ("too_few_pings", 30.0)


@pytest.mark.parametrize("of_all", [1, 30])
def test_a_log_without_pings_to_judge_says_so(of_all: int) -> None:
    """Whether it is short, or a beam is lost nearly always; a log with no finding was judged."""
    log = replace(make_log(42), instrument_mps=None)
    valid = log.valid.copy()
    valid[of_all:, 2] = False
    found = Audit(replace(log, valid=valid), stated=BeamGeometry.janus(np.deg2rad(22.0))).findings
    assert [(one.kind, one.size) for one in found if one.kind == "too_few_pings"] == [
        ("too_few_pings", of_all)
    ]


def test_millimetres_a_second_are_no_velocity() -> None:
    log = make_log(42)
    found = {one.kind: one for one in Audit(replace(log, velocity_mps=1e3 * log.velocity_mps)).findings}
    one = found["too_fast"]
    assert (one.severity, one.unit, one.expected) == ("fault", "m/s", "at most 20 m/s")
    assert one.size == pytest.approx(1e3 * np.median(np.abs(log.velocity_mps)))
    assert "1e+" not in finding("stale_pings", 499.0, 0.998, chance=0, row=1, longest=499).text


def test_records_that_were_changed() -> None:
    beside = {"records_read": 200, "flagged": {"stale repeat": {"count": 10, "first_line": 7}}}
    (one,) = Audit(replace(make_log(43), beside=beside)).findings
    assert (one.kind, one.size, one.weight) == ("reader_flagged", 10.0, 0.05)
    assert "first_line 7" in one.evidence


def test_every_finding_has_its_parts() -> None:
    """A text, evidence and a hint, whatever the kind; what a template names and nobody gives is an error."""
    for template, kind in KINDS.items():
        assert all((kind.text, kind.evidence, kind.hint)), template
    with pytest.raises(KeyError):
        finding("too_fast", 1.0, 0.5)
    one = finding("beam_bias", 20.0, 0.02, beams=[2], sd=1.0)
    assert (one.kind, one.place, one.size, one.sd, one.unit) == ("beam_bias", "beam 3", 20.0, 1.0, "mm/s")
    assert (one.severity, one.expected) == ("warning", "0 mm/s")


def test_noise_of_three_beams_is_that_of_their_second_differences() -> None:
    """There is no closure; of a vehicle that moves slowly the noise is found within a tenth."""
    slow: Array = 0.2 * np.stack([np.sin(T / 20.0), np.cos(T / 25.0), np.sin(T / 30.0)], axis=1)
    audit = Audit(make_log(44, physical=janus()[:3], velocity=slow, sd_mps=0.01))
    (line,) = (one for one in geometry_text(audit).splitlines() if one.startswith("beam_noise_mps"))
    assert float(line.split()[2]) == pytest.approx(0.01, rel=0.1)


def test_the_page_has_a_row_an_estimate() -> None:
    audit = Audit(make_log(45), stated=BeamGeometry.janus(np.deg2rad(22.0)))
    (part,) = (one for one in page_of(audit, numbers_of(audit)).parts if one.id == "estimates")
    (table,) = part.blocks
    assert isinstance(table, Table)
    rows = {row[1]: row[2].split(", ") for row in table.rows}
    assert len(rows) == len(table.rows)
    for name, expected, within in (
        ("tilt of the beams, °", [22.0] * 4, 0.05),
        ("azimuth of the beams, °", [45.0, 135.0, -135.0, -45.0], 0.2),
        ("bias of the beams, mm/s", [0.0] * 4, 0.5),
        ("stated beam of the channels", [1.0, 2.0, 3.0, 4.0], 0.0),
        ("weights of the beams", [1.0, -1.0, 1.0, -1.0], 0.01),
        ("robust sigma, mm/s", [20.0], 2.0),
    ):
        values = [float(cell.split(" ± ")[0]) for cell in rows[name]]
        np.testing.assert_allclose(values, expected, atol=within)


@pytest.mark.usefixtures("undrawn")
def test_the_figure_shows_what_was_estimated() -> None:
    """The histogram holds every ping, and the Gaussian as many."""
    log = make_log(47)
    closure = closure_figure(Audit(log, stated=BeamGeometry.janus(np.deg2rad(22.0))))
    assert closure is not None
    axes = on_paper(closure).axes[0]
    counts = [bar.get_height() for bar in axes.patches if isinstance(bar, Rectangle)]
    (gaussian,) = axes.lines
    assert sum(counts) == log.pings
    assert np.sum(gaussian.get_ydata()) == pytest.approx(log.pings, rel=0.02)
    assert max(map(abs, axes.get_xlim())) == pytest.approx(6.0 * 20.0, rel=0.2)


def test_nothing_observable_has_no_figure() -> None:
    still = Audit(make_log(48, velocity=np.zeros((600, 3)), sd_mps=0.001, instrument=False))
    assert closure_figure(still) is None


def test_a_common_scale_is_written_as_a_speed_of_sound() -> None:
    """The beams read 2 % more than the velocity; half a per cent is none, and each row names its beam."""
    for factor, expected in ((1.02, 1.02), (1.003, None)):
        log = make_log(49, decimals=None)
        assert log.instrument_mps is not None
        audit = Audit(replace(log, instrument_mps=log.instrument_mps / factor))
        lines = geometry_text(audit).splitlines()
        found = [float(one.split()[2]) for one in lines if one.startswith("sound_speed_scale")]
        assert found == ([] if expected is None else [pytest.approx(expected, abs=1e-3)])
        assert [one.split("# beam ")[1][0] for one in lines if "# beam " in one] == list("1234")
        matrix = audit.matrix
        assert matrix is not None
        sds = [one.sd for one in audit.findings if one.kind == "scale"]
        assert all(sd in 100.0 * matrix.scale_sd for sd in sds)
        assert len(sds) == (expected is not None)


@pytest.mark.parametrize(("factor", "is_told"), [(2.0, False), (3.2, True), (8.0, True)])
def test_how_noisy_a_beam_is(factor: float, is_told: bool) -> None:
    """From two and a half times the noise of the others it is told, with its factor."""
    log, rng = make_log(51, instrument=False, decimals=None, pings=4000), np.random.default_rng(51)
    y = log.velocity_mps + 0.01 * np.sqrt(factor**2 - 1.0) * rng.normal(size=(4000, 1)) * [0.0, 1.0, 0.0, 0.0]
    stated = BeamGeometry.janus(np.deg2rad(22.0))
    found = [
        one for one in Audit(replace(log, velocity_mps=y), stated=stated).findings if one.kind == "noisy_beam"
    ]
    assert [one.beams for one in found] == [(2,)] * is_told
    assert [one.size for one in found] == pytest.approx([factor] * is_told, rel=0.1)


def test_flags_of_a_mapped_log(tmp_path: Path) -> None:
    """By the columns that the map names, whatever else is there."""
    names = tuple(f"v{k}" for k in range(4))
    table = {
        "time_ns": [0, 10**8],
        **{name: [0.1, 0.2] for name in names},
        "good": [1, 0],
        "beam1_valid": [0, 0],
    }
    pl.DataFrame(table).write_csv(tmp_path / "log.csv")
    log = read_log(tmp_path / "log.csv", Columns(velocity=names, valid=("good",) * 4))
    assert log.valid.tolist() == [[True] * 4, [False] * 4]
