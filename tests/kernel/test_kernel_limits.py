"""What the kernel refuses before it begins: work without room, threads without cores, a closed loop out of step."""

import os
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock import errors, kernel
from bottomlock.kernel import ClosedLoop, KernelError, Method
from tests.analytic import batch_along
from tests.property import settings

WORK = batch_along(4.0)
DIVE = Path(__file__).parents[2] / "data" / "logs" / "robosub" / "case.toml"
TRUTH = WORK["truth"]


@pytest.mark.parametrize("runs", [2**33, 2**40, 2**62, 2**64 - 1])
@pytest.mark.parametrize("methods", [["tc"], ["ins", "lc", "tc"]])
def test_runs_without_room_are_refused(runs: int, methods: list[Method]) -> None:
    """Nothing is allocated, and the message has every count."""
    words = rf"{runs} runs of {len(methods)} methods with \d+ samples need .*B \(\d+ bytes\) of memory"
    with pytest.raises(KernelError, match=words):
        kernel.run_batch(**WORK, methods=methods, runs=runs, threads=1)


def test_samples_of_a_replay_without_room_are_refused() -> None:
    """A few readings, and more samples between them than there is room for their covariances."""
    none = np.empty(0, np.int64)
    log: Any = {
        "imu_time_ns": np.array([0, 10**9]),
        "omega_p_radps": np.zeros((2, 3)),
        "force_p_mps2": np.tile([0.0, 0.0, -9.8], (2, 1)),
        "dvl_time_ns": none,
        "beam_velocity_mps": np.empty((0, 4)),
        "beam_valid": np.empty((0, 4), bool),
    }
    start: Any = settings.start()
    further: Any = {"smooth": True, "covariances": True, "sample_time_ns": np.arange(1_000_000)}
    with pytest.raises(KernelError, match="2000 methods with 1000000 samples and 0 pings need"):
        kernel.replay_log(
            WORK["geometry"], WORK["assumed"], WORK["options"], ["tc"] * 2000, log, start, **further
        )


@pytest.mark.parametrize("threads", [30_000, 2**63])
def test_threads_without_cores_are_refused(threads: int) -> None:
    """Each costs memory, and more than a few for a core only take turns."""
    cores = len(os.sched_getaffinity(0))
    words = rf"threads: got {threads}, expected 0 \(one per core\) to {16 * cores} on this machine of {cores} cores"
    with pytest.raises(KernelError, match=words):
        kernel.run_batch(**WORK, methods=["tc"], runs=1, threads=threads)


def test_samples_closer_than_readings_are_all_recorded() -> None:
    """Each sample is that of the first reading at or after it, if several are due at once too."""
    last = int(TRUTH["time_ns"][-1])
    wanted = np.array([last - 3, last - 2, last])
    result = kernel.run_batch(
        **{**WORK, "schedule": {**WORK["schedule"], "sample_time_ns": wanted}},
        methods=["tc"],
        runs=2,
        threads=1,
    )
    for sample in (0, 1):
        np.testing.assert_array_equal(result["error"][:, :, sample], result["error"][:, :, 2])
    assert (result["sd"] > 0).all()


def loop(methods: list[Method], *, vehicles: int = 1, **change: Any) -> ClosedLoop:  # noqa: ANN401 - any argument
    """Vehicles at the start of the truth."""
    start: Any = {"time_ns": int(TRUTH["time_ns"][0])} | {
        key: TRUTH[key][[0] * vehicles] for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")
    }
    settings = {
        "vehicle_per_method": False,
        "seed": 1,
        "trajectory_key": 2,
        "first_run": 0,
        "threads": 1,
    } | change
    return ClosedLoop(
        WORK["geometry"], WORK["simulated"], WORK["assumed"], WORK["options"], methods, start, **settings
    )


def part(first: int, last: int, samples: list[int], *, vehicles: int = 1) -> tuple[Any, Any]:
    """Truth and schedule from sample to sample, without a measurement."""
    truth = {
        key: value[None, first:last].repeat(vehicles, axis=0)
        for key, value in TRUTH.items()
        if key != "time_ns"
    }
    none = np.empty(0, np.int64)
    schedule = {
        "dvl_time_ns": none,
        "beam_valid": np.empty((0, 4), bool),
        "sample_time_ns": np.array(samples, np.int64),
    }
    return truth | {"time_ns": TRUTH["time_ns"][first:last]}, schedule


@pytest.mark.parametrize("vehicle_per_method", [True, False])
def test_a_closed_loop_without_methods_is_refused(vehicle_per_method: bool) -> None:
    with pytest.raises(KernelError, match="methods is empty, expected at least one"):
        loop([], vehicle_per_method=vehicle_per_method)
    with pytest.raises(KernelError, match="first_run is 18446744073709551615, expected room"):
        loop(["ins"], vehicles=2, first_run=2**64 - 1)


def test_a_closed_loop_out_of_step_is_left_as_it_was() -> None:
    """A truth that does not go on, and samples outside it, are refused before any vehicle moves."""
    one, times = loop(["tc"]), TRUTH["time_ns"]
    for bad, words in [
        (part(3, 9, []), f"truth begins at {times[3]} ns, expected {times[0]} ns"),
        (part(0, 5, [int(times[7])]), f"sample epoch {times[7]} ns lies outside the truth"),
        (part(0, 5, [int(times[2]), int(times[2])]), "sample time .* does not come after"),
    ]:
        with pytest.raises(KernelError, match=words):
            one.advance(*bad)
    one.advance(*part(0, 5, [int(times[2])]))
    with pytest.raises(KernelError, match=f"truth begins at {times[0]} ns, expected {times[4]} ns"):
        one.advance(*part(0, 5, []))
    assert one.results()["error"].shape == (1, 1, 1, 9)


def test_a_closed_loop_that_has_failed_says_so() -> None:
    """A ping beyond the truth is met on the way, when the vehicles have moved."""
    one, times = loop(["tc"]), TRUTH["time_ns"]
    truth, schedule = part(0, 5, [int(times[2])])
    beyond = schedule | {"dvl_time_ns": times[8:9], "beam_valid": np.ones((1, 4), bool)}
    with pytest.raises(KernelError, match=f"dvl epoch {times[8]} ns lies outside the truth") as first:
        one.advance(truth, beyond)
    for again in (one.results, one.estimate, lambda: one.advance(*part(4, 9, []))):
        with pytest.raises(KernelError, match="has failed and cannot go on") as later:
            again()
        assert str(first.value) in str(later.value)


def test_threads_take_turns_with_a_closed_loop() -> None:
    """Two threads that call at once get results or the kernel's errors, and one of them goes on."""
    one = loop(["tc", "sway_current"], vehicles=50)
    segments = [
        part(first, first + 5, [int(TRUTH["time_ns"][first + 2])], vehicles=50) for first in range(0, 60, 4)
    ]
    refusals = []

    def call() -> None:
        for segment in segments:
            try:
                one.advance(*segment)
                one.estimate()
            except KernelError as error:
                refusals.append(str(error))

    with ThreadPoolExecutor(2) as threads:
        for ended in [threads.submit(call) for _ in range(2)]:
            ended.result()
    assert len(refusals) == len(segments)
    assert all("truth begins at" in words for words in refusals)
    assert one.results()["error"].shape == (50, 2, len(segments), 9)


def test_the_error_of_the_kernel_is_one_of_the_package() -> None:
    """Under its public name, a ValueError too, and the same one after a journey between processes."""
    assert bottomlock.KernelError is errors.KernelError is KernelError
    assert KernelError.__module__ == "bottomlock.errors"
    assert issubclass(KernelError, bottomlock.BottomlockError)
    assert issubclass(KernelError, ValueError)
    with pytest.raises(KernelError, match="unknown method 'tcc'") as caught:
        kernel.run_batch(**WORK, methods=["tcc"], runs=1, threads=1)
    assert type(caught.value) is KernelError
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (type(copy), str(copy)) == (KernelError, str(caught.value))
