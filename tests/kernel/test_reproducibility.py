"""Same seed, same bits: for any number of threads, any chunking, any company of runs and methods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import Method
from tests.oracle import truth
from tests.property import settings

if TYPE_CHECKING:
    from bottomlock._kernel import BatchDict

SECONDS = 6
JANUS = bottomlock.BeamGeometry.janus(np.deg2rad(20))
MOTION: Any = truth.make(yaw=truth.figure_eight_yaw, seconds=SECONDS, rate_hz=50.0)
TRUE_ERRORS = settings.table_2() | {"dvl_outliers": {"outlier_fraction": 0.2, "outlier_factor": 10.0}}


def batch(
    first_run: int,
    runs: int,
    *,
    threads: int = 1,
    seed: int = 7,
    methods: list[Method] | None = None,
    **more: Any,  # noqa: ANN401
) -> BatchDict:
    """A short batch of every method with beams 3 and 4 lost."""
    return bottomlock.run_batch(
        JANUS,
        MOTION,
        TRUE_ERRORS,
        settings.table_2(),
        settings.options(gate="joint"),
        more.get("schedule", settings.schedule(SECONDS, lost=(3, 4))),
        methods or bottomlock.METHODS,
        seed=seed,
        trajectory_key=11,
        first_run=first_run,
        runs=runs,
        threads=threads,
    )


def same(one: BatchDict, other: BatchDict) -> None:
    """Every array bit for bit."""
    for key, values in one.items():
        np.testing.assert_array_equal(values, other[key], err_msg=key)  # type: ignore[literal-required]


def test_threads_change_no_bit() -> None:
    """Results are placed by index, never summed in order of arrival."""
    same(batch(0, 7), batch(0, 7, threads=2))
    same(batch(0, 7), batch(0, 7, threads=5))


@pytest.mark.parametrize("sizes", [(1,) * 7, (3, 4), (6, 1)])
def test_chunks_change_no_bit(sizes: tuple[int, ...]) -> None:
    """A campaign resumed in other chunks is the same campaign."""
    whole = batch(0, 7)
    start = 0
    for size in sizes:
        part = batch(start, size, threads=2)
        for key, values in whole.items():
            np.testing.assert_array_equal(values[start : start + size], part[key], err_msg=key)  # type: ignore[index,literal-required]
        start += size


def test_a_method_does_not_feel_the_others() -> None:
    """Methods share the streams and nothing else: alone or in company (and in other lanes) the same bits."""
    everyone: Any = batch(2, 2)
    for index, method in enumerate(bottomlock.METHODS):
        alone: Any = batch(2, 2, methods=[method])
        for key in (
            "error",
            "sd",
            "nees",
            "nees_velocity_attitude",
            "nis_mean",
            "fixes_accepted",
            "fixes_rejected",
        ):
            np.testing.assert_array_equal(
                everyone[key][:, index], alone[key][:, 0], err_msg=f"{method} {key}"
            )


def test_masks_may_differ_by_run() -> None:
    """(runs, epochs, beams) masks: run k has its own, and equal masks give the bits of a shared one."""
    shared = settings.schedule(SECONDS, lost=(3, 4))
    own = settings.schedule(SECONDS, lost=(3, 4))
    own["beam_valid"] = np.tile(shared["beam_valid"], (3, 1, 1))
    same(batch(0, 3), batch(0, 3, schedule=own))
    own["beam_valid"] = own["beam_valid"].copy()
    own["beam_valid"][1] = True
    mixed, plain = batch(0, 3, schedule=own), batch(0, 3)
    np.testing.assert_array_equal(mixed["error"][[0, 2]], plain["error"][[0, 2]])
    assert not np.array_equal(mixed["error"][1], plain["error"][1])


def test_seeds_runs_and_trajectories_differ() -> None:
    """The key has three parts and each of them counts."""
    first = batch(0, 2)["error"]
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(first, batch(0, 2, seed=8)["error"])


def test_loose_coupling_flies_with_all_beams() -> None:
    """The reference method ignores the masks: lost beams change it by not a bit."""
    full = settings.schedule(SECONDS)
    np.testing.assert_array_equal(
        batch(0, 2, methods=["lc"])["error"], batch(0, 2, methods=["lc"], schedule=full)["error"]
    )


def test_batch_is_the_streaming_navigator() -> None:
    """A navigator fed the run's own streams, sample by sample, ends in the batch's state bit for bit."""
    schedule = settings.schedule(SECONDS, lost=(3, 4))
    streams = bottomlock.simulate_sensors(
        JANUS, MOTION, TRUE_ERRORS, schedule, seed=7, trajectory_key=11, run=3
    )
    nav = bottomlock.Navigator(
        JANUS, settings.table_2(), settings.options(gate="joint"), streams["initial"], method="tc"
    )
    ping = 0
    for k, time_ns in enumerate(streams["imu_time_ns"]):
        nav.push_imu(
            int(time_ns),
            omega_p_radps=streams["imu_omega_p_radps"][k],
            force_p_mps2=streams["imu_force_p_mps2"][k],
        )
        if ping < SECONDS and streams["dvl_time_ns"][ping] == time_ns:
            y, valid = streams["dvl_velocity_mps"][ping], streams["dvl_valid"][ping]
            nav.push_beams(int(time_ns), y, valid, sd_mps=np.full(4, 0.042))
            ping += 1
    assert ping == SECONDS
    result = batch(3, 1, methods=["tc"])
    error = MOTION["position_t_m"][-1] - nav.state()["position_t_m"]
    np.testing.assert_array_equal(result["error"][0, 0, -1, :3], error)
    error = MOTION["velocity_p_mps"][-1] - nav.state()["velocity_p_mps"]
    np.testing.assert_array_equal(result["error"][0, 0, -1, 6:], error)
    np.testing.assert_array_equal(result["sd"][0, 0, -1], np.sqrt(np.diag(nav.covariance()))[:9])
