"""A log through the kernel: any number of threads, bad rows named; that it is the streaming one: `test_late_data`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import FIX_STATUS, Method
from tests.drawn_log import drawn_log
from tests.oracle import truth
from tests.property import settings

if TYPE_CHECKING:
    from bottomlock._kernel import LogDict, ReplayDict

SECONDS = 12
JANUS = bottomlock.BeamGeometry.janus(np.deg2rad(20), lever_arms_p_m=np.tile([-1.8, 0.0, 0.1], (4, 1)))
SENSORS = [("dvl", 937), ("depth", 411), ("heading", 1303), ("gps", 3001)]


def recording() -> tuple[LogDict, Any]:
    """Streams of a figure-eight whose measurements never fall on an inertial reading; beams come and go."""
    motion: Any = truth.make(yaw=truth.figure_eight_yaw, seconds=SECONDS, rate_hz=50.0)
    epochs = {
        name: np.arange(period, SECONDS * 1000, period, dtype=np.int64) * 1_000_000 + 77
        for name, period in SENSORS
    }
    rng = np.random.default_rng(3)
    valid = rng.random((len(epochs["dvl"]), 4)) < 0.7
    schedule: Any = {
        "dvl_time_ns": epochs["dvl"],
        "beam_valid": valid,
        "depth_time_ns": epochs["depth"],
        "magnetometer_time_ns": epochs["heading"],
        "gps_time_ns": epochs["gps"],
        "sample_time_ns": motion["time_ns"][:1],
    }
    streams = bottomlock.simulate_sensors(
        JANUS, motion, settings.table_2(), schedule, seed=1, trajectory_key=2, run=0
    )
    w, x, y, z = streams["magnetometer_attitude_t_p"].T
    log: LogDict = drawn_log(
        streams, "gps",
        beam_velocity_mps=np.where(valid, streams["dvl_velocity_mps"], np.nan), beam_valid=valid,
        beam_sd_mps=rng.uniform(0.02, 0.08, valid.shape), heading_time_ns=epochs["heading"],
        heading_rad=np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)),
    )  # fmt: skip
    keys = ("time_ns", "position_t_m", "attitude_t_p", "velocity_p_mps")
    start: Any = {key: streams["initial"][key] for key in keys}
    return log, start


LOG, START = recording()


def replayed(log: LogDict = LOG, methods: Sequence[Method] = bottomlock.METHODS, **more: Any) -> ReplayDict:  # noqa: ANN401
    return bottomlock.replay_log(
        JANUS,
        settings.table_2(),
        settings.options(gate="joint"),
        methods,
        log,
        more.pop("start", START),
        sample_time_ns=more.pop("sample_time_ns", np.arange(1, SECONDS + 1) * 1_000_000_000),
        **more,
    )


def test_threads_company_and_repeats_change_no_bit() -> None:
    """Each method is independent of the other methods and of the number of threads."""
    one = replayed()
    for other in (replayed(), replayed(threads=2), replayed(threads=5)):
        for key, values in one.items():
            np.testing.assert_equal(other[key], values, err_msg=key)  # type: ignore[literal-required]
    alone = replayed(methods=("plcf",))
    np.testing.assert_array_equal(alone["sd"][0], one["sd"][bottomlock.METHODS.index("plcf")])


def test_pings_tell_what_became_of_them() -> None:
    """TC has a row for each valid beam, LC a fix where three are valid, INS takes none."""
    out = replayed(methods=("ins", "lc", "tc"))
    valid: Any = LOG["beam_valid"]
    names = np.array(FIX_STATUS)[out["fix_status"]]
    assert set(names[0]) == {"none"}
    assert np.isnan(out["nis"][0]).all()
    np.testing.assert_array_equal(names[1] == "no_information", valid.sum(axis=1) < 3)
    np.testing.assert_array_equal(np.isfinite(out["innovation_mps"][2]), valid)
    np.testing.assert_array_equal(out["nis_dof"][2], valid.sum(axis=1))
    assert np.isnan(out["innovation_mps"][1]).all()
    assert out["unused"]["before_start"]["dvl"] == 0
    assert out["sample_time_ns"][0] == 1_000_000_000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depth_m": np.full(len(LOG["depth_time_ns"]), np.nan)}, r"depth row 0: depth_m at 411000077 ns"),
        (
            {"beam_valid": np.ones((3, 4), dtype=bool)},
            r"log\.beam_valid has shape \(3, 4\), expected \(12, 4\)",
        ),
        ({"imu_time_ns": LOG["imu_time_ns"] * 1.0}, r"log\.imu_time_ns has dtype float64, expected int64"),
        (
            {"gps_position_t_m": np.zeros((2, 3))},
            r"log\.gps_position_t_m has shape \(2, 3\), expected \(3, 3\)",
        ),
        (
            {"attitude_time_ns": LOG["imu_time_ns"][:2], "attitude_t_p": [[1.0, 0, 0, 0], [2.0, 0, 0, 0]]},
            r"log\.attitude_t_p\[1\] has norm 2, expected 1 \(scalar first\)",
        ),
    ],
)
def test_bad_rows_are_named(change: dict[str, Any], message: str) -> None:
    """One line with stream, row and what was expected."""
    with pytest.raises(bottomlock.KernelError, match=message) as caught:
        replayed({**LOG, **change})  # type: ignore[typeddict-item]
    assert "\n" not in str(caught.value)


def test_missing_keys_and_times_outside_are_named() -> None:
    log = {key: value for key, value in LOG.items() if key != "depth_m"}
    with pytest.raises(bottomlock.KernelError, match="log lacks the key 'depth_m'"):
        replayed(log)  # type: ignore[arg-type]
    with pytest.raises(bottomlock.KernelError, match="outside the replay"):
        replayed(sample_time_ns=[99_000_000_000])


def test_innovations_are_those_of_the_pings() -> None:
    """Beams in order without the lost ones, NaN beyond the rows; NIS is zᵀS⁻¹z of the very arrays."""
    result: Any = replayed(methods=("tc",), innovations=True)
    (sensors,) = result["innovations"]
    assert {"beams", "depth", "heading", "gps_position"} <= set(sensors)
    beams = sensors["beams"]
    assert not beams["withheld"].any()
    for k, time_ns in enumerate(beams["time_ns"]):
        row, n = int(np.searchsorted(LOG["dvl_time_ns"], time_ns)), int(beams["rows"][k])
        z, s = beams["residual"][k, :n], beams["covariance"][k, :n, :n]
        assert z @ np.linalg.solve(s, z) == pytest.approx(result["nis"][0, row], rel=1e-9)
        assert np.isnan(beams["residual"][k, n:]).all()
    assert "innovations" not in replayed(methods=("tc",))
