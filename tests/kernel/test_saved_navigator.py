"""A navigator that was saved goes on as the one that was never stopped, bit for bit."""

import copy
import pickle
import struct
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import METHODS, SENSORS, BeamGeometry, KernelError, Navigator
from bottomlock.kernel.models import ThrustModel
from tests.kernel.report_bits import report_bits
from tests.property import settings

JANUS = BeamGeometry.janus(0.35, lever_arms_p_m=[[1.0, 0.1, 0.5]] * 4, sound_speed_scale=1.01)
STEP_NS = 50_000_000
SECONDS = 10
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
Push = Callable[[Navigator, int, np.random.Generator], list[Any]]


def _ping(to: Navigator, time_ns: int, draw: np.random.Generator) -> list[Any]:
    # Some outliers and lost beams: gates, weights and counts of rejections are part of the state.
    velocity = 0.04 * draw.normal(size=4) + 5.0 * (draw.random(4) < 0.1)
    return to.push_beams(time_ns, velocity, draw.random(4) < 0.8, sd_mps=np.full(4, 0.042))


PUSH: dict[str, Push] = {
    "beams": _ping,
    "velocity": lambda to, time_ns, draw: to.push_velocity(
        time_ns, 0.05 * draw.normal(size=3), cov_m2ps2=np.diag([1e-2] * 3)
    ),
    "depth": lambda to, time_ns, draw: to.push_depth(time_ns, 0.02 * draw.normal(), sd_m=0.02),
    "attitude": lambda to, time_ns, _: to.push_attitude(
        time_ns, LEVEL, roll_pitch_sd_rad=0.02, yaw_sd_rad=0.1
    ),
    "heading": lambda to, time_ns, draw: to.push_heading(time_ns, 0.1 * draw.normal(), sd_rad=0.1),
    "gps_position": lambda to, time_ns, draw: to.push_position(
        time_ns, 2.0 * draw.normal(size=3), position_sd_m=[2.0] * 3
    ),
    "gps_velocity": lambda to, time_ns, draw: to.push_gps(
        time_ns,
        2.0 * draw.normal(size=3),
        0.1 * draw.normal(size=3),
        position_sd_m=[2.0] * 3,
        velocity_sd_mps=[0.1] * 3,
    ),
    "acoustic_position": lambda to, time_ns, draw: to.push_acoustic_position(
        time_ns=time_ns, position_t_m=2.0 * draw.normal(size=3)
    ),
    "thrust_surge": lambda to, time_ns, draw: to.push_thrust(time_ns, [draw.normal(), 0, 0], sd_mps=0.05),
    "thrust_sway": lambda to, time_ns, draw: to.push_thrust(time_ns, draw.normal(size=3), sd_mps=0.05),
    "thrust_heave": lambda to, time_ns, draw: to.push_thrust(time_ns, [0, 0, draw.normal()], sd_mps=0.05),
}
"""A measurement of every sensor."""


def navigator(method: Any) -> Navigator:  # noqa: ANN401
    """At rest, with a depth sensor whose bias is estimated, and a propeller."""
    model: Any = settings.table_2()
    model["depth"] = {**model["depth"], "bias_sd_m": 0.3}
    model["acoustic_position"] = {
        "sd_m": 1.0,
        "sd_per_range": 0.01,
        "transceiver_t_m": [0.0, 0.0, -50.0],
        "outlier_fraction": 0.0,
        "outlier_factor": 1.0,
    }
    model["thrust"] = ThrustModel(scale_sd=[0.1] * 3, slip_sd_mps=[0.02] * 3).as_dict()
    start: Any = settings.start(attitude=LEVEL)
    robust = {"closure_gate": 0.999, "beam_gate": 0.999, "tail": "student_t", "student_t_degrees": 4.0}
    options = settings.options(gate="joint", inflate_after_rejections=3, robust=robust) | {
        "thrust": "velocity"
    }
    return Navigator(JANUS, model, options, start, method=method)


def imu(to: Navigator, time_ns: int, draw: np.random.Generator) -> list[Any]:
    """A reading of a vehicle that rocks."""
    return to.push_imu(
        time_ns=time_ns,
        omega_p_radps=1e-3 * draw.normal(size=3),
        force_p_mps2=np.array([0.0, 0.0, -settings.GRAVITY]) + 0.01 * draw.normal(size=3),
    )


def turn(to: Navigator, k: int, push: Push, seed: int) -> list[Any]:
    """What arrives in step k: now and then a measurement between two readings, and the later one."""
    draw = np.random.default_rng([seed, k])
    reports = []
    if draw.random() < 0.2:
        reports += push(to, k * STEP_NS - int(draw.integers(1, STEP_NS)), draw)
    return reports + imu(to, k * STEP_NS, draw)


def everything(of: Navigator) -> bytes:
    """All that a caller can read, as bits."""
    values: list[Any] = [*of.state().values(), of.covariance(), *of.late_events().values()]
    water: dict[str, Any] = dict(of.water() or {"layers": {}})
    values += [
        *water.pop("layers").values(),
        *water.values(),
        *(of.thrust() or {}).values(),
    ]
    return b"".join(np.asarray(value).tobytes() for value in values)


def goes_on(to: Navigator, first: int, push: Push, seed: int) -> list[Any]:
    """The reports of the next ten seconds; the reading of step `first` alone completes what waits."""
    reports = imu(to, first * STEP_NS, np.random.default_rng(seed))
    for k in range(first + 1, first + SECONDS * 10**9 // STEP_NS):
        reports += turn(to, k, push, seed)
    return [report_bits(report) for report in reports]


@pytest.mark.parametrize("method", METHODS)
def test_a_restored_navigator_goes_on_bit_for_bit(method: str) -> None:
    """Every method with every sensor; saved at a random moment, also with a measurement that waits for its reading."""
    assert set(PUSH) == {"beams", *SENSORS}
    for number, push in enumerate(PUSH.values()):
        moment = np.random.default_rng([number, len(method)])
        saved_at = int(moment.integers(25, 60))
        one = navigator(method)
        imu(one, 0, moment)
        for k in range(1, saved_at):
            turn(one, k, push, seed=number)
        if number % 2:
            assert push(one, saved_at * STEP_NS - STEP_NS // 2, moment) == []
        others = [Navigator.load(one.save())]
        if not number:
            others += [copy.copy(one), pickle.loads(pickle.dumps(one))]
        assert all(everything(other) == everything(one) for other in others)
        reports = goes_on(one, saved_at, push, seed=number)
        assert reports or method == "ins"
        for other in others:
            assert goes_on(other, saved_at, push, seed=number) == reports
            assert everything(other) == everything(one)
            assert other.save() == one.save()


def test_a_copy_goes_its_own_way() -> None:
    """What one of the two takes does not move the other."""
    one, draw = navigator("sway_current"), np.random.default_rng(1)
    imu(one, 0, draw)
    before = everything(one)
    for other in (copy.copy(one), copy.deepcopy(one)):
        imu(other, STEP_NS, draw)
        assert everything(other) != before
    assert everything(one) == before


def test_a_geometry_is_saved_whole() -> None:
    """Directions, lever arms and scale, bit for bit."""
    loaded = [BeamGeometry.load(JANUS.save()), copy.deepcopy(JANUS), pickle.loads(pickle.dumps(JANUS))]
    for other in loaded:
        np.testing.assert_array_equal(other.directions_p, JANUS.directions_p)
        np.testing.assert_array_equal(other.lever_arms_p_m, JANUS.lever_arms_p_m)
        assert other.sound_speed_scale == JANUS.sound_speed_scale


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda _: b"", "navigator not restored: the bytes begin otherwise"),
        (lambda _: JANUS.save(), "navigator not restored: the bytes begin otherwise"),
        (lambda data: data[:30], "30 bytes are too few"),
        (
            lambda data: data[:8] + struct.pack("<H", 16) + data[10:],
            "format 16, expected 22: another version",
        ),
    ],
)
def test_bytes_that_are_no_navigator_are_refused(change: Callable[[bytes], bytes], words: str) -> None:
    """One line says what is wrong with them."""
    with pytest.raises(KernelError, match=words):
        Navigator.load(change(navigator("tc").save()))


def test_no_damage_gives_a_navigator() -> None:
    """Whatever is cut, flipped, doubled or put in, the digest tells; the content itself is attacked in Rust."""
    draw = np.random.default_rng(3000)
    data = navigator("tc").save()
    for _ in range(3000):
        at, more = int(draw.integers(len(data))), draw.bytes(int(draw.integers(1, 9)))
        kind = int(draw.integers(4))
        cut = {0: at, 1: at, 2: at + 1, 3: at + len(more)}[kind]
        damaged = data[:at] if kind == 0 else data[:at] + more + data[cut:]
        if damaged != data:
            with pytest.raises(KernelError):
                Navigator.load(damaged)


def test_two_threads_share_a_navigator() -> None:
    """One pushes, the other reads, copies and saves: every call is whole, and the estimate is that of one thread."""
    alone, shared = navigator("sway_current"), navigator("sway_current")
    steps = 400
    draw = np.random.default_rng(3)
    block = {
        "time_ns": np.arange(steps) * STEP_NS,
        "omega_p_radps": 1e-3 * draw.normal(size=(steps, 3)),
        "force_p_mps2": np.tile([0.0, 0.0, -settings.GRAVITY], (steps, 1)),
    }
    parts = [{key: value[k : k + 20] for key, value in block.items()} for k in range(0, steps, 20)]
    for part in parts:
        alone.push_imu_block(**part)
    done, faults = threading.Event(), []

    def read() -> None:
        try:
            while not done.is_set():
                times = [shared.state()["time_ns"], Navigator.load(shared.save()).state()["time_ns"]]
                assert times == sorted(times)
                assert times[0] in {int(part["time_ns"][-1]) for part in parts} | {0}
                np.linalg.cholesky(shared.covariance())
        except Exception as fault:  # noqa: BLE001 - it is looked at below
            faults.append(fault)

    readers = [threading.Thread(target=read) for _ in range(2)]
    for reader in readers:
        reader.start()
    for part in parts:
        shared.push_imu_block(**part)
    done.set()
    for reader in readers:
        reader.join()
    assert faults == []
    assert everything(shared) == everything(alone)
