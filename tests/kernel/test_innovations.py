"""Innovations of a replay in arrays, and measurements that are predicted and not used."""

from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import replay_log
from tests.kernel.test_replay_log import JANUS, recording
from tests.property import settings


def flown(log: Any, start: Any, **options: Any) -> Any:  # noqa: ANN401 - the kernel's dicts
    """One method along the log."""
    last = log["imu_time_ns"][-1:]
    return replay_log(
        JANUS, settings.table_2(), settings.options(), ["tc"], log, start, sample_time_ns=last, **options
    )


def test_innovations_are_those_of_the_pings() -> None:
    """Beams in order without the lost ones, NaN beyond the rows; NIS is zᵀS⁻¹z of the very arrays."""
    log, start = recording()
    result = flown(log, start, innovations=True)
    (sensors,) = result["innovations"]
    assert {"beams", "depth", "heading", "gps_position"} <= set(sensors)
    beams = sensors["beams"]
    assert not beams["withheld"].any()
    for k, time_ns in enumerate(beams["time_ns"]):
        row, n = int(np.searchsorted(log["dvl_time_ns"], time_ns)), int(beams["rows"][k])
        z, s = beams["residual"][k, :n], beams["covariance"][k, :n, :n]
        assert z @ np.linalg.solve(s, z) == pytest.approx(result["nis"][0, row], rel=1e-9)
        assert np.isnan(beams["residual"][k, n:]).all()
    assert "innovations" not in flown(log, start)


def test_withheld_rows_are_predicted_alone() -> None:
    """Of a log with withheld pings these are recorded, and the end is that of the log without them."""
    log, start = recording()
    withheld = np.zeros(len(log["dvl_time_ns"]), dtype=bool)
    withheld[4:7] = True
    result = flown(log | {"dvl_withheld": withheld}, start)
    assert result["innovations"][0]["beams"]["time_ns"].tolist() == log["dvl_time_ns"][4:7].tolist()
    assert result["innovations"][0]["beams"]["withheld"].all()
    columns = ("dvl_time_ns", "beam_velocity_mps", "beam_valid", "beam_sd_mps")
    kept: Any = log
    without = flown(kept | {key: kept[key][~withheld] for key in columns}, start)
    assert result["position_t_m"].tolist() == without["position_t_m"].tolist()
