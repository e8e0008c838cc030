"""The shipped dive as files for `crates/bottomlock-c/tests/dive.c`: a saved navigator and its events."""

from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.kernel import Navigator
from bottomlock.kernel.models import DepthModel, MagnetometerModel, Model
from bottomlock.replay import rerun
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams

KINDS = {"imu": 0, "dvl": 1, "depth": 2, "attitude": 3}
EVENT = np.dtype([("kind", "<i8"), ("time_ns", "<i8"), ("numbers", "<f8", 12)])


def write_dive(root: Path, folder: Path, method: Any) -> tuple[Path, Path]:  # noqa: ANN401 - a name
    """Writes the navigator at the start and the events of `data/logs/robosub`."""
    case = load_case(root / "data" / "logs" / "robosub" / "case.toml")
    prepared = rerun.prepare(case, read_streams(case))
    log: Any = rerun.kernel_log(case, prepared, prepared.streams.beams.valid[prepared.pings])
    model = prepared.model
    start = rerun.kernel_start(prepared.alignment)
    navigator = Navigator(prepared.streams.instrument.geometry, model, prepared.options, start, method=method)
    return write_files(folder, navigator, model, log)


def write_files(folder: Path, navigator: Navigator, model: Model, log: Any) -> tuple[Path, Path]:  # noqa: ANN401 - a log
    events = sorted(
        (int(time_ns), kind, row, stream)
        for stream, kind in KINDS.items()
        for row, time_ns in enumerate(log.get(f"{stream}_time_ns", ()))
    )
    records = [(kind, time_ns, _numbers(stream, model, log, row)) for time_ns, kind, row, stream in events]
    files = folder / "dive.navigator", folder / "dive.events"
    files[0].write_bytes(navigator.save())
    files[1].write_bytes(np.array(records, dtype=EVENT).tobytes())
    return files


def _numbers(stream: str, model: Model, log: dict[str, Any], row: int) -> np.ndarray[Any, Any]:
    if stream == "imu":
        given = [*log["omega_p_radps"][row], *log["force_p_mps2"][row]]
    elif stream == "dvl":
        valid = log["beam_valid"][row]
        given = [*np.where(valid, log["beam_velocity_mps"][row], 0.0), *valid, *log["beam_sd_mps"][row]]
    elif stream == "depth":
        given = [log["depth_m"][row], model.of(DepthModel).sd_m]
    else:
        sds = model.of(MagnetometerModel)
        given = [*log["attitude_t_p"][row], sds.roll_pitch_sd_rad, sds.yaw_sd_rad]
    return np.pad(np.asarray(given, dtype=np.float64), (0, 12 - len(given)))
