"""Live is not OK where it must not be: every condition reached by bytes, under default settings."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bottomlock.errors import ScenarioError
from bottomlock.io.sentences import xor_of
from bottomlock.live.config import parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.estimator import solve_ping
from bottomlock.live.navigation import NavigationEstimator
from bottomlock.recordings.readings import Ping
from tests.live import world
from tests.live.world import World, config

Arrivals = list[tuple[int, int, bytes]]


def fly(engine: Engine, arrivals: Arrivals) -> list[tuple[str, str]]:
    """The states with their reasons, without repeats, times left out."""
    found: list[tuple[str, str]] = []
    for arrival_ns, source, data in sorted(arrivals, key=lambda entry: entry[:2]):
        engine.arrive(source, arrival_ns, data)
        found.append((engine.state, engine.machine.why))
    return list(dict.fromkeys(found))


def navigating(changed: world.World | None = None, imu: Arrivals | None = None) -> list[tuple[str, str]]:
    made = changed or World(6.0)
    return fly(Engine(config("navigation")), [*made.dvl(), *(list(made.imu()) if imu is None else imu)])


def reading(data: bytes, change: np.ndarray) -> bytes:
    """A line of the IMU whose rates and forces are multiplied."""
    time, *numbers = data.decode().split("*")[0].split(",")
    values = np.array([float(number) for number in numbers]) * change
    text = ",".join([time, *(f"{value:.9g}" for value in values)]).encode()
    return text + b"*%02X\n" % xor_of(text)


def imu_times(change: np.ndarray, from_s: float = 0.0) -> Arrivals:
    begin_ns = world.START_NS + round(from_s * 1e9)
    return [
        (at_ns, source, reading(data, change) if at_ns >= begin_ns else data)
        for at_ns, source, data in World(6.0).imu()
    ]


@pytest.mark.parametrize("mode", ["velocity", "navigation"])
def test_understated_noise_is_unsafe(monkeypatch: pytest.MonkeyPatch, mode: str) -> None:
    """Beams of 42 mm/s where the configuration claims 4."""
    monkeypatch.setattr(world, "BEAM_SD", 0.042)
    sure = config(mode, extra="")
    sure = sure.model_copy(update={"dvl": sure.dvl.model_copy(update={"beam_noise_mps": 0.004})})
    made = World(8.0)
    found = fly(Engine(sure), [*made.dvl(), *(made.imu() if mode == "navigation" else ())])
    state, why = found[-1]
    assert state == "UNSAFE"
    assert why.startswith("beams disagree with one another by ")
    assert 5.0 < float(why.split(" by ")[1].split()[0]) < 20.0


@pytest.mark.long
def test_noise_as_claimed_is_not() -> None:
    """Of ten minutes of pings no set of twenty is beyond the limit."""
    assert "disagree" not in " ".join(why for _, why in fly(Engine(config()), list(World(600.0).dvl())))


def test_axes_of_an_imu_with_z_up_are_named() -> None:
    """ROS's axes, forward, port, up: there is no start, and the reason says how to turn them."""
    found = navigating(imu=imu_times(np.array([1, -1, -1, 1, -1, -1])))
    assert {state for state, _ in found} == {"INITIALISING"}
    assert "imu.mounting_roll_deg = 180" in found[-1][1]


def test_forces_in_g_are_no_start_with_a_level_attitude() -> None:
    """A tenth of gravity upwards."""
    found = navigating(imu=imu_times(np.array([1, 1, 1, 0.1, 0.1, 0.1])))
    assert found[-1][0] == "INITIALISING"
    assert "they read (-0.0, +0.0, -1.0) m/s²" in found[-1][1]
    assert "are they in g" in found[-1][1]


@pytest.mark.parametrize(("from_s", "state"), [(0.0, "INITIALISING"), (3.0, "UNSAFE")])
def test_rates_beyond_the_full_scale_are_named(from_s: float, state: str) -> None:
    """At the alignment and later: what was rejected, not only that readings are missing."""
    found = navigating(imu=imu_times(np.array([1e6, 1e6, 1e6, 1, 1, 1]), from_s))
    assert found[-1][0] == state
    assert "full scale" in found[-1][1]


def test_pings_that_contradict_the_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beams jump by 3 m/s: coasting at the first rejection, unsafe at the fourth; the fifth opens the gate again."""
    before, imu = list(World(3.0).dvl()), list(World(9.0).imu())
    monkeypatch.setattr(world, "VELOCITY", world.VELOCITY + np.array([3.0, 0.0, 0.0]))
    after = [entry for entry in World(9.0).dvl() if entry[0] > before[-1][0] + 1_000_000]
    engine = Engine(config("navigation"))
    found = fly(engine, [*before, *after, *imu])
    why = [f"{state}: {words}" for state, words in found]
    first = why.index("COASTING: the last ping contradicts the estimate")
    assert "UNSAFE: 4 pings in a row contradict the estimate" in why[first:]
    assert not any("5 pings in a row" in words for words in why)
    assert engine.state == "OK", engine.machine.why


def test_what_the_used_beams_determine() -> None:
    """Of three valid beams the gate rejects one: two directions are determined, and the velocity is theirs."""
    settings = config("navigation")
    estimator = NavigationEstimator(settings)
    instrument = settings.instrument()
    velocity = instrument.geometry.directions_p @ np.array([1.0, 0.0, 0.0])
    valid = np.array([True, True, True, False])
    none = np.full(4, np.nan)
    ping = Ping(0, 0, np.where(valid, velocity, np.nan), valid, none, none, np.full(3, np.nan), None)
    told: dict[str, Any] = {
        "verdict": "accepted_in_part", "degrees": 2, "nis": 1.0, "reason": None, "beam_weight": None,
    }  # fmt: skip

    def report(**changed: Any) -> Any:  # noqa: ANN401 - in the shape of the kernel's
        return SimpleNamespace(**told | changed)

    fixes = solve_ping(instrument, ping, "info")
    estimator._judged(report(rejected_rows=[True, False, False]), ping, fixes)
    assert (estimator.rank, estimator.last.used.tolist()) == (2, [False, True, True, False])
    estimator._judged(report(rejected_rows=[False, False, False]), ping, fixes)
    assert estimator.rank == 3
    estimator._judged(report(verdict="rejected", rejected_rows=[]), ping, fixes)
    assert (estimator.rank, estimator.rejected) == (0, 1)


def test_a_limit_that_the_gate_never_reaches_is_refused() -> None:
    """The gate opens again at the fifth rejection in a row."""
    text = world.NAVIGATION_TOML.replace("settle_s = 0.5", "settle_s = 0.5\nrejected_pings = 5")
    places = {"dvl": "tcp:127.0.0.1:9", "imu": "udpin:127.0.0.1:9", "to": "stdout", "format": "pd0"}
    with pytest.raises(ScenarioError, match="the gate opens again at rejection 5"):
        parse_config(text.format(**places), place="test")
