"""The water table: written and read back, and each fault named."""

from pathlib import Path

import numpy as np

from bottomlock.io.beam_table import WaterTable, read_water_table, water_file


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
