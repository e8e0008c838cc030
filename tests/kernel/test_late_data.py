"""Late data: any order in which measurements arrive within the horizon ends in the bits of the log in order of time."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import METHODS, KernelError, Method, Navigator
from tests.kernel.report_bits import report_bits
from tests.kernel.test_replay_log import JANUS, LOG, START, replayed
from tests.property import settings

MS = 1_000_000
SECOND = 1000 * MS
LEVEL = np.array([0.0, 0.0, -settings.GRAVITY])
AT_REST: Any = settings.start()
STREAMS = ("imu", "dvl", "depth", "heading", "gps")


def arrivals(latency_s: float, seed: int, log: Any = LOG) -> list[tuple[int, str, int]]:  # noqa: ANN401 - the kernel's
    """Time, stream and row of every event of the log, each measurement with a random latency; in order without."""
    events = [
        (int(t), rank, name, k)
        for rank, name in enumerate(STREAMS)
        for k, t in enumerate(log[f"{name}_time_ns"])
    ]
    events.sort()
    latency_ns = np.random.default_rng(seed).uniform(0, latency_s * SECOND, len(events))
    latency_ns[[name == "imu" for _, _, name, _ in events]] = 0.0
    order = np.argsort([t for t, *_ in events] + latency_ns, kind="stable")
    return [(t, name, k) for t, _, name, k in (events[i] for i in order)]


def push(to: Navigator, t: int, name: str, k: int, rows: Any = LOG) -> list[Any]:  # noqa: ANN401 - the kernel's
    """Pushes a row of the log, with the noise that a replay of it takes."""
    model = settings.table_2()
    match name:
        case "imu":
            return to.push_imu(
                t, omega_p_radps=rows["omega_p_radps"][k], force_p_mps2=rows["force_p_mps2"][k]
            )
        case "dvl":
            beams = rows["beam_velocity_mps"][k], rows["beam_valid"][k]
            return to.push_beams(t, *beams, sd_mps=rows["beam_sd_mps"][k])
        case "depth":
            return to.push_depth(t, rows["depth_m"][k], sd_m=model["depth"]["sd_m"])
        case "heading":
            return to.push_heading(t, rows["heading_rad"][k], sd_rad=model["heading"]["sd_rad"])
        case _:
            place = rows["gps_position_t_m"][k]
            return to.push_position(t, place, position_sd_m=model["gps"]["position_sd_m"])


def stand(told: dict[Any, Any], reports: list[Any]) -> None:
    """Keeps what stands of all reports, by sensor and time; a report that is not marked is the first of its kind."""
    for report in reports:
        key = report.sensor, report.time_ns
        assert report.revised == (key in told)
        told[key] = report_bits(report, without=("revised",))


@pytest.mark.parametrize("method", METHODS)
def test_any_arrival_ends_in_the_replay(method: Method) -> None:
    """Against the replay of the log and against the log in order; saved, copied and pickled on the way."""

    def fresh(horizon_ns: int) -> Navigator:
        options = settings.options(gate="joint")
        return Navigator(JANUS, settings.table_2(), options, START, method=method, horizon_ns=horizon_ns)

    told: dict[Any, Any] = {}
    ordered = fresh(0)
    nis = np.full(len(LOG["dvl_time_ns"]), np.nan)
    for event in arrivals(0.0, 1):
        reports = push(ordered, *event)
        stand(told, reports)
        for report in reports:
            if report.sensor == "beams" and len(report.residual):
                nis[np.searchsorted(LOG["dvl_time_ns"], report.time_ns)] = report.nis
    out: Any = replayed(methods=(method,), sample_time_ns=LOG["imu_time_ns"][-1:])
    np.testing.assert_array_equal(out["nis"][0], nis)
    for number, latency_s in enumerate((0.3, 0.9)):
        told_late: dict[Any, Any] = {}
        late = fresh(SECOND)
        for k, event in enumerate(arrivals(latency_s, seed=number)):
            stand(told_late, push(late, *event))
            if k % 150 == 100:
                late = (
                    lambda one: Navigator.load(one.save()),
                    copy.copy,
                    lambda one: pickle.loads(pickle.dumps(one)),
                )[k // 150 % 3](late)
        assert told_late == told
        assert set(late.late_events().values()) == {0}
        np.testing.assert_array_equal(late.covariance(), ordered.covariance())
        state: Any = late.state()
        for key, value in ordered.state().items():
            np.testing.assert_array_equal(state[key], value)
        for key in (
            "position_t_m",
            "attitude_t_p",
            "velocity_p_mps",
            "accel_bias_p_mps2",
            "gyro_bias_p_radps",
            "dvl_bias_mps",
        ):
            np.testing.assert_array_equal(out[key][0, -1], state[key])
        np.testing.assert_array_equal(out["dvl_scale"][0, -1], state["dvl_scale_factor"])
        np.testing.assert_array_equal(out["sd"][0, -1], np.sqrt(np.diag(late.covariance())))


def under_way(seconds: float = 3.0, method: Any = "tc", **more: Any) -> Navigator:  # noqa: ANN401 - any argument
    """At rest for a while, at 100 Hz."""
    to = Navigator(JANUS, settings.table_2(), settings.options(gate="joint"), AT_REST, method=method, **more)
    times = np.arange(0, round(seconds * 100) + 1) * 10 * MS
    to.push_imu_block(
        times, omega_p_radps=np.zeros((len(times), 3)), force_p_mps2=np.tile(LEVEL, (len(times), 1))
    )
    return to


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (-1, r"horizon_ns is -1, expected 0 to 10000000000 ns"),
        (2.0, r"horizon_ns is 2\.0, expected a whole number of nanoseconds"),
        (10**30, r"horizon_ns is 10+, expected a whole number of nanoseconds, 0 to 10000000000"),
    ],
)
def test_a_horizon_is_nanoseconds_up_to_ten_seconds(value: Any, words: str) -> None:  # noqa: ANN401
    with pytest.raises(KernelError, match=words):
        under_way(horizon_ns=value)
