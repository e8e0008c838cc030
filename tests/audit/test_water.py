"""Water against the bottom: the current, its scatter and drift by planted ones; signs and scales told apart."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import BeamLog, Reference
from bottomlock.audit.page import page_of
from bottomlock.audit.run import Audit, audit_file, numbers_of
from bottomlock.files.atomic_write import write_parquet
from bottomlock.io.beam_table import WaterTable
from bottomlock.kernel import BeamGeometry
from bottomlock.pages.page import html
from tests.audit.synthetic import make_log, motion

STATED = BeamGeometry.janus(np.deg2rad(22.0))
PINGS = 3000
CURRENT = np.array([0.2, -0.1, 0.0])
DRIFT = np.array([0.3, -0.2, 0.0])


def recording(
    *, factor: float = 1.0, sd: float = 0.03, seed: int = 5, sign: float = 1.0
) -> tuple[BeamLog, WaterTable, Reference]:
    """A vehicle that turns about, ten minutes; the water's beams read `factor` times the speed through it."""
    rng = np.random.default_rng(seed)
    v = motion(rng, PINGS)
    log = make_log(seed, velocity=v, sd_mps=0.005)
    t = log.time_s
    rpy = np.stack(
        [0.05 * np.sin(t / 7.0), 0.04 * np.cos(t / 9.0), 0.01 * t + 0.4 * np.sin(t / 40.0)], axis=1
    )
    turn = Rotation.from_euler("ZYX", rpy[:, ::-1])
    c = CURRENT + (t[:, None] - t.mean()) / 3600.0 * DRIFT
    y = sign * factor * STATED.beam_velocities(v - turn.inv().apply(c)) + sd * rng.normal(size=(PINGS, 4))
    none = np.full(y.shape, np.nan)
    cells = WaterTable(
        log.time_ns,
        np.ones(PINGS, dtype=np.int64),
        np.full(PINGS, 3.0),
        y,
        np.ones(y.shape, dtype=bool),
        none,
        none,
    )
    return log, cells, Reference(log.time_ns, rpy, None)


def audited(*, factor: float = 1.0, sd: float = 0.03, seed: int = 5, sign: float = 1.0) -> Audit:
    log, water, attitude = recording(factor=factor, sd=sd, seed=seed, sign=sign)
    return Audit(log, stated=STATED, cells=water, own_attitude=attitude)


def water_kinds(made: Audit) -> list[tuple[str, str]]:
    return [(one.kind, one.severity) for one in made.findings if one.kind.startswith("water")]


def test_the_current_with_its_scatter_and_drift() -> None:
    """One ping north and east: a beam's noise over √2 sin 22° (four beams); of a beam that of water and bottom."""
    found = audited().water
    assert found is not None
    assert (found.pings, found.cell, found.range_m) == (PINGS, 1, 3.0)
    beam = np.hypot(0.03, 0.005)
    np.testing.assert_allclose(found.current_mps, CURRENT[:2], atol=0.01)
    np.testing.assert_allclose(found.drift_mps_per_h, DRIFT[:2], atol=0.1)
    assert found.beam_sd_mps == pytest.approx(beam, rel=0.05)
    np.testing.assert_allclose(found.ping_sd_mps, beam / np.sqrt(2.0) / np.sin(np.deg2rad(22.0)), rtol=0.1)
    assert abs(found.scale - 1.0) < 0.05
    assert water_kinds(audited()) == []


@pytest.mark.parametrize(
    ("factor", "sign", "expected"),
    [
        (1.0, -1.0, [("water_scale", "fault")]),
        (0.7, 1.0, [("water_scale", "warning")]),
        (1.0, 1.0, []),
        (1.06, 1.0, []),
        (1.94, 1.0, [("water_scale", "warning")]),
        (0.001, 1.0, [("water_scale", "warning")]),
    ],
)
def test_signs_and_scales(factor: float, sign: float, expected: list[tuple[str, str]]) -> None:
    """A wrong sign, metres per second for knots and the other way round, and millimetres; 6 % are no finding."""
    made = audited(factor=factor, sign=sign, sd=0.03 * factor)
    assert water_kinds(made) == expected
    assert made.water is not None
    assert made.water.scale == pytest.approx(sign * factor, rel=0.1)


@pytest.mark.parametrize("seed", range(8))
def test_right_beams_are_not_accused(seed: int) -> None:
    assert water_kinds(audited(seed=seed, sd=0.08)) == []


def test_nothing_without_attitude_geometry_or_enough_pings() -> None:
    log, water, attitude = recording()
    assert Audit(log, stated=STATED, cells=water).water is None
    assert Audit(log, cells=water, own_attitude=attitude).water is None
    few = WaterTable(*(column[:199] for column in vars(water).values()))
    assert Audit(log, stated=STATED, cells=few, own_attitude=attitude).water is None
    enough = WaterTable(*(column[:200] for column in vars(water).values()))
    assert Audit(log, stated=STATED, cells=enough, own_attitude=attitude).water is not None


def test_the_table_beside_the_beams_is_read(tmp_path: Path) -> None:
    """With the attitude that the instrument recorded with its pings; the page has a part of it."""
    log, water, attitude = recording()
    beams: dict[str, Any] = {"time_ns": log.time_ns}
    for k in range(4):
        beams |= {f"beam{k + 1}_mps": log.velocity_mps[:, k], f"beam{k + 1}_valid": log.valid[:, k]}
    beams |= dict(zip(("roll_rad", "pitch_rad", "heading_rad"), attitude.rpy_rad.T, strict=True))
    write_parquet(tmp_path / "beams.parquet", pl.DataFrame(beams))
    write_parquet(tmp_path / "beams_water.parquet", water.to_frame())
    (tmp_path / "dvl.toml").write_text('configuration = "x"\ntilt_deg = 22.0\nbeam_noise_mps = 0.01\n')
    made = audit_file(tmp_path / "beams.parquet", geometry=tmp_path / "dvl.toml")
    assert made.water is not None
    np.testing.assert_allclose(made.water.current_mps, CURRENT[:2], atol=0.01)
    numbers = numbers_of(made)
    assert numbers["water"]["pings"] == PINGS
    assert "water_track.noise_mps" in html(page_of(made, numbers))
    write_parquet(tmp_path / "beams.parquet", pl.DataFrame(beams).drop("heading_rad"))
    assert audit_file(tmp_path / "beams.parquet", geometry=tmp_path / "dvl.toml").water is None
