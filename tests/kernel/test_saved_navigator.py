"""Copies and saved bytes of a navigator; that a restored one continues bit for bit: `test_late_data`."""

import copy
import pickle
import threading
from typing import Any

import numpy as np

from bottomlock.kernel import BeamGeometry, Method, Navigator
from bottomlock.kernel.models import ThrustModel
from tests.property import settings

JANUS = BeamGeometry.janus(0.35, lever_arms_p_m=[[1.0, 0.1, 0.5]] * 4, sound_speed_scale=1.01)
STEP_NS = 50_000_000


def navigator(method: Method) -> Navigator:
    """At rest, with a propeller."""
    thrust = ThrustModel(scale_sd=[0.1] * 3, slip_sd_mps=[0.02] * 3).as_dict()
    options = settings.options() | {"thrust": "velocity"}
    return Navigator(JANUS, settings.table_2() | {"thrust": thrust}, options, settings.start(), method=method)


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


def test_a_copy_goes_its_own_way() -> None:
    """What one of the two takes does not move the other."""
    one, level = navigator("sway_current"), np.array([0.0, 0.0, -settings.GRAVITY])

    def push(to: Navigator, time_ns: int) -> None:
        to.push_imu(time_ns, omega_p_radps=np.full(3, 1e-3), force_p_mps2=level)

    push(one, 0)
    before = everything(one)
    for other in (copy.copy(one), copy.deepcopy(one)):
        push(other, STEP_NS)
        assert everything(other) != before
    assert everything(one) == before


def test_a_geometry_is_saved_whole() -> None:
    """Directions, lever arms and scale, bit for bit."""
    loaded = [BeamGeometry.load(JANUS.save()), copy.deepcopy(JANUS), pickle.loads(pickle.dumps(JANUS))]
    for other in loaded:
        np.testing.assert_array_equal(other.directions_p, JANUS.directions_p)
        np.testing.assert_array_equal(other.lever_arms_p_m, JANUS.lever_arms_p_m)
        assert other.sound_speed_scale == JANUS.sound_speed_scale


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
