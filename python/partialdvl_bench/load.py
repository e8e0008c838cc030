"""A mission from its folder, as an estimator receives it."""

from pathlib import Path

import numpy as np
import polars as pl

from bottomlock import DataError
from bottomlock.files.records import read_record, read_recorded
from bottomlock.files.table_file import read_parquet
from bottomlock.recordings.axes import quaternions, to_angles
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import PreparedRun, prepare
from partialdvl_bench.digests import digest
from partialdvl_bench.make import CASE, RECORD, SEALED, TRUTH
from partialdvl_bench.mission import Mission, Pings, Scalars, Start, Truth

REMEDY = "make the missions again with `bottomlock bench make`"


def load_mission(folder: str | Path, *, truth: bool = True) -> Mission:
    """A mission that `bottomlock bench make` has written.

    Args:
        folder: the mission's folder.
        truth: whether to read the truth too, where it is beside the readings or below `sealed`.

    Raises:
        DataError: for a folder without a mission, or files that have changed since they were made.
    """
    folder = Path(folder)
    record = read_record(folder / RECORD)
    if record is None:
        raise DataError(f"{folder}: holds no mission (there is no {RECORD}); {REMEDY}")
    for name in record["digests"]:
        read_recorded(folder / name, record, remedy=REMEDY)
    case = load_case(folder / CASE)
    prepared = prepare(case, read_streams(case), run=0)
    grid_ns = _grid(prepared)
    return Mission(
        name=folder.name,
        split=record["split"],
        geometry=prepared.streams.instrument.geometry,
        model=prepared.model,
        options=prepared.options,
        start=Start(
            time_ns=int(prepared.alignment.time_ns),
            position_t_m=prepared.alignment.position_t_m,
            velocity_p_mps=prepared.alignment.velocity_p_mps,
            attitude_t_p=quaternions(prepared.alignment.attitude),
        ),
        imu=prepared.streams.inertial,
        pings=Pings(
            prepared.streams.beams.time_ns, prepared.streams.beams.velocity_mps, prepared.streams.beams.valid
        ),
        depth=_depth(prepared),
        heading=_heading(prepared),
        grid_ns=grid_ns,
        truth=_truth(folder, grid_ns) if truth else None,
        water=prepared.streams.water,
    )


def truth_path(folder: Path) -> Path | None:
    """The truth of the mission in this folder, beside it or below `sealed`; None where it is not there."""
    places = (folder / TRUTH, folder.parent.parent / SEALED / folder.name / TRUTH)
    return next((place for place in places if place.is_file()), None)


def truth_of(frame: pl.DataFrame) -> Truth:
    """The columns of a truth's table as arrays."""
    return Truth(
        time_ns=frame["time_ns"].to_numpy(),
        position_t_m=frame.select("position_north_m", "position_east_m", "position_down_m").to_numpy(),
        velocity_p_mps=frame.select("surge_mps", "sway_mps", "heave_mps").to_numpy(),
        attitude_t_p=frame.select("attitude_w", "attitude_x", "attitude_y", "attitude_z").to_numpy(),
        current_t_mps=frame.select("current_north_mps", "current_east_mps").to_numpy(),
    )


def _grid(prepared: PreparedRun) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    start, last = int(prepared.alignment.time_ns), int(prepared.streams.inertial.time_ns[-1])
    return np.arange(start + 1_000_000_000, last + 1, 1_000_000_000, dtype=np.int64)


def _truth(folder: Path, grid_ns: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Truth | None:
    path = truth_path(folder)
    if path is None:
        return None
    frame = read_parquet(path)
    record = read_record(folder / RECORD)
    if record is None or digest({"truth": frame}) != record["truth"]:
        raise DataError(f"{path}: is not the truth that the mission's record states; {REMEDY}")
    frame = frame.filter(pl.col("time_ns").is_in(grid_ns.tolist()))
    if frame.height != len(grid_ns):
        raise DataError(f"{path}: holds {frame.height} of the {len(grid_ns)} times of the grid; {REMEDY}")
    return truth_of(frame)


def _depth(prepared: PreparedRun) -> Scalars:
    depths = prepared.streams.depths
    assert depths is not None  # every case has the section
    return Scalars(depths.time_ns, depths.depth_m)


def _heading(prepared: PreparedRun) -> Scalars:
    attitudes = prepared.streams.attitudes
    assert attitudes is not None  # every case has the section
    return Scalars(attitudes.time_ns, to_angles(attitudes.attitude)[:, 2])
