"""The water table: written and read back, and each fault named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.io.water_table import WaterTable, read_water_table, water_file


def example() -> WaterTable:
    """Two pings of two cells and three beams; one beam is lost and has neither quality nor noise."""
    velocity = np.arange(12.0).reshape(4, 3) / 10.0
    velocity[3, 1] = np.nan
    known = np.isfinite(velocity)
    return WaterTable(
        time_ns=np.array([0, 0, 10**9, 10**9]),
        cell=np.array([1, 2, 1, 3]),
        range_m=np.array([2.0, 4.0, 2.0, 6.0]),
        velocity_mps=velocity,
        valid=known,
        quality=np.where(known, 200.0, np.nan),
        sd_mps=np.where(known, 0.03, np.nan),
    )


def test_what_is_written_is_read(tmp_path: Path) -> None:
    table, path = example(), water_file(tmp_path / "beams.parquet")
    assert path == tmp_path / "beams_water.parquet"
    table.to_frame().write_parquet(path)
    read = read_water_table(path)
    assert (read.rows, read.beams) == (4, 3)
    for name, values in vars(table).items():
        np.testing.assert_array_equal(getattr(read, name), values, err_msg=name)


FAULTS: dict[str, tuple[Callable[[pl.DataFrame], pl.DataFrame], str]] = {
    "missing": (
        lambda frame: frame.drop("range_m"),
        "column 'range_m' is missing; expected the columns of a water",
    ),
    "type": (lambda frame: frame.with_columns(cell=pl.lit(1.5)), "column 'cell' is Float64, expected Int64"),
    "empty": (
        lambda frame: frame.with_columns(cell=pl.when(pl.col("cell") == 3).then(None).otherwise("cell")),
        "row 3, column 'cell' is empty",
    ),
    "order": (lambda frame: frame.reverse(), "row 1 is not later, or of a later cell"),
    "twice": (
        lambda frame: frame.with_columns(cell=pl.lit(1, dtype=pl.Int64)),
        "row 1 is not later, or of a later cell",
    ),
    "cell": (
        lambda frame: frame.with_columns(pl.col("cell") - 1),
        "row 0, column 'cell' is 0, expected 1 or more",
    ),
    "velocity": (
        lambda frame: frame.with_columns(beam2_valid=pl.lit(value=True)),
        "row 3, beam 2 is flagged valid",
    ),
    "range": (lambda frame: frame.with_columns(-pl.col("range_m")), "row 0, beam 1 is flagged valid"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_named(fault: str) -> None:
    change, words = FAULTS[fault]
    with pytest.raises(DataError, match=f"^dive: .*{words}"):
        WaterTable.from_frame(change(example().to_frame()), "dive")
