"""Cells of a water profile: each rule by hand, the whole against a literal loop over pings, beams and cells."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.config.sensors import WaterCells
from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.water_cells import CellCounts, check_cells, water_beams

JANUS = BeamGeometry.janus(np.deg2rad(30.0))
SD = np.full(4, 0.05)


@dataclass(frozen=True)
class Cells:
    """A `CellTable`."""

    time_ns: Any
    cell: Any
    range_m: Any
    velocity_mps: Any
    valid: Any
    quality: Any
    sd_mps: Any


def profile(
    pings: int = 1, cells: int = 3, *, velocity: tuple[float, float, float] = (1.0, 0.2, 0.0)
) -> Cells:
    """Cells of 2 m, the first at 3 m, of a uniform flow; nothing known of correlation and noise."""
    rows = pings * cells
    number = np.tile(np.arange(cells) + 1, pings)
    along = np.repeat(JANUS.beam_velocities([velocity]), rows, axis=0)
    return Cells(
        np.repeat(np.arange(pings) * 10**9, cells), number, 1.0 + 2.0 * number, along,
        np.ones((rows, 4), dtype=bool), np.full((rows, 4), np.nan), np.full((rows, 4), np.nan),
    )  # fmt: skip


def changed(table: Cells, name: str, row: Any, value: Any) -> Cells:  # noqa: ANN401
    column = getattr(table, name).copy()
    column[row] = value
    return replace(table, **{name: column})


@pytest.mark.parametrize(
    ("bottom_m", "kept"), [(9.3, 3), (9.2, 2), (7.0, 2), (6.9, 1), (4.5, 0), (np.nan, 3)]
)
def test_side_lobes_of_the_bottom(bottom_m: float, kept: int) -> None:
    """Straight down it is R cos 30°: 8.05, 7.97, 6.06, 5.98, 3.9 m; the cells end at 4, 6 and 8 m."""
    bottom = np.array([[bottom_m + 5.0, bottom_m, bottom_m + 9.0, np.nan]])
    rows, counts = water_beams(
        profile(), JANUS, WaterCells(cells=(1, 2, 3)), beam_sd_mps=SD,
        bottom=(np.zeros(1, dtype=np.int64), bottom if np.isfinite(bottom_m) else bottom * np.nan),
    )  # fmt: skip
    assert counts == CellCounts(used=4 * kept, side_lobes=12 - 4 * kept)
    assert rows.valid.all() == (kept > 0)


def test_ranges_of_another_ping_do_not_count() -> None:
    for apart_ns, cut in ((900_000_000, 12), (1_100_000_000, 0)):
        _, counts = water_beams(
            profile(), JANUS, WaterCells(cells=(1, 2, 3)), beam_sd_mps=SD,
            bottom=(np.array([-apart_ns]), np.full((1, 4), 3.0)),
        )  # fmt: skip
        assert counts.side_lobes == cut


def test_correlation() -> None:
    """A beam of 63 is out at a limit of 64, one of 64 and one that says nothing are not."""
    table = changed(profile(cells=2), "quality", 0, [63.0, 64.0, np.nan, 255.0])
    rows, counts = water_beams(table, JANUS, WaterCells(cells=(1,), min_correlation=64.0), beam_sd_mps=SD)
    assert rows.valid.tolist() == [[False, True, True, True]]
    assert counts == CellCounts(used=3, correlation=1)


@pytest.mark.parametrize(("fish_mps", "limit", "kept"), [
    (0.29, None, True), (0.31, None, False), (0.15, 0.08, True), (0.17, 0.08, False),
])  # fmt: skip
def test_closure_takes_all_beams_of_the_cell(fish_mps: float, limit: float | None, kept: bool) -> None:
    """One beam off by f closes with f/2, which scatters as one beam: 3 × 0.05 is reached at 0.3, 0.08 at 0.16."""
    table = profile()
    table = changed(table, "velocity_mps", (0, 2), table.velocity_mps[0, 2] + fish_mps)
    limits = WaterCells(max_closure_mps=limit)
    rows, counts = water_beams(table, JANUS, limits, beam_sd_mps=SD)
    assert counts == (CellCounts(used=8) if kept else CellCounts(used=4, closure=4))
    assert rows.range_m[0] == (4.0 if kept else 5.0)


def test_a_ping_without_a_good_cell_keeps_its_row() -> None:
    table = changed(profile(2), "valid", slice(0, 3), False)
    rows, _ = water_beams(table, JANUS, WaterCells(), beam_sd_mps=SD)
    assert rows.valid.any(axis=1).tolist() == [False, True]
    assert np.isnan(rows.velocity_mps[0]).all()
    assert rows.range_m.tolist() == [4.0, 4.0]
    assert np.isfinite(rows.sd_mps).all()


def test_a_ping_that_lacks_a_chosen_cell() -> None:
    """The other one counts; a ping without any of them has no row."""
    rows, counts = water_beams(profile(cells=2), JANUS, WaterCells(cells=(2, 7)), beam_sd_mps=SD)
    assert counts == CellCounts(used=4)
    assert rows.range_m.tolist() == [5.0]
    rows, counts = water_beams(profile(cells=2), JANUS, WaterCells(cells=(7,)), beam_sd_mps=SD)
    assert (len(rows.time_ns), counts) == (0, CellCounts())


def test_no_pings() -> None:
    rows, counts = water_beams(profile(0), JANUS, WaterCells(), beam_sd_mps=SD)
    assert rows.velocity_mps.shape == (0, 4)
    assert counts == CellCounts()


def test_faults_are_named() -> None:
    three = BeamGeometry.from_angles([0.4] * 3, [0.0, 2.0, 4.0])
    with pytest.raises(DataError, match="have 4 beams, expected the geometry's 3"):
        water_beams(profile(), three, WaterCells(), beam_sd_mps=SD[:3])
    with pytest.raises(DataError, match="cell 7 is in no ping, expected cells of 1 to 3"):
        check_cells(profile(), WaterCells(cells=(1, 7)))
    with pytest.raises(DataError, match="row 1: beam 3 is valid and its velocity or range is not finite"):
        water_beams(changed(profile(), "velocity_mps", (1, 2), np.nan), JANUS, WaterCells(), beam_sd_mps=SD)


def test_counts_in_words_and_summed() -> None:
    counts = CellCounts(used=3, closure=4) + CellCounts(used=2, side_lobes=1)
    assert counts.text() == ("5 used; left out: 1 within the bottom's side lobes, 4 of too large a closure")


@given(st.integers(0, 2**32 - 1))
def test_is_the_literal_loop(seed: int) -> None:
    """Any subset of beams, noise, ranges and correlations, written out cell by cell."""
    rng = np.random.default_rng(seed)
    table = profile(4, 3)
    shape = table.valid.shape
    table = replace(
        table, velocity_mps=table.velocity_mps + 0.1 * rng.normal(size=shape), valid=rng.random(shape) < 0.8,
        quality=rng.uniform(0, 255, shape), sd_mps=np.where(rng.random(shape) < 0.5, 0.04, np.nan),
    )  # fmt: skip
    bottom = rng.uniform(3.0, 12.0, (4, 4))
    limits = WaterCells(cells=(1, 3), min_correlation=40.0, max_closure_mps=0.12)
    rows, counts = water_beams(table, JANUS, limits, beam_sd_mps=SD, bottom=(np.arange(4) * 10**9, bottom))
    used = 0
    for ping in range(4):
        taken: list[list[tuple[float, float, float]]] = [[], [], [], []]
        for k in np.flatnonzero((table.time_ns == ping * 10**9) & (table.cell != 2)):
            r = table.range_m[k]
            good = [
                bool(table.valid[k, b]) and r + 1.0 <= bottom[ping].min() * np.cos(np.pi / 6)
                and table.quality[k, b] >= 40.0
                for b in range(4)
            ]  # fmt: skip
            y = table.velocity_mps[k]
            if all(good) and abs(y[0] - y[1] + y[2] - y[3]) / 2.0 > 0.12:
                continue
            for b in [b for b in range(4) if good[b]]:
                sd = 0.05 if np.isnan(table.sd_mps[k, b]) else table.sd_mps[k, b]
                taken[b].append((y[b], r, sd))
        used += sum(map(len, taken))
        ranges = [np.mean([one[1] for one in beam]) for beam in taken if beam]
        assert rows.valid[ping].tolist() == [bool(beam) for beam in taken]
        assert rows.range_m[ping] == pytest.approx(np.mean(ranges) if ranges else 5.0)
        for b, beam in enumerate(taken):
            if beam:
                assert rows.velocity_mps[ping, b] == pytest.approx(np.mean([one[0] for one in beam]))
                assert rows.sd_mps[ping, b] == pytest.approx(np.sqrt(np.mean([one[2] ** 2 for one in beam])))
    assert counts.used == used
    assert sum(vars(counts).values()) == 32
