"""A vehicle for the tests of live use: the bytes of its DVL, IMU and depth sensor, with their times of arrival."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import encoder
from bottomlock.io.beams import read_geometry
from bottomlock.io.sentences import xor_of
from bottomlock.kernel import EARTH_RATE_RADPS, Navigator, normal_gravity_mps2, solve_velocity
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine, Message
from bottomlock.live.navigation import NavigationEstimator
from bottomlock.ports import registry
from bottomlock.ports.estimate import Estimate, State
from bottomlock.ports.port import Port
from tests.dive import felt

START_NS = 1_790_000_000_000_000_000
LATITUDE_DEG = 32.8
VELOCITY = np.array([1.0, 0.1, 0.05])
BEAM_SD = 0.01


class Probe(Port):
    """A port that writes an estimate as a line of text."""

    name = "probe"

    def _refuses(self, estimate: Estimate) -> str | None:
        return "no component" if not estimate.rank and estimate.mode == "velocity" else None

    def _message(self, estimate: Estimate) -> bytes:
        sd = np.sqrt(np.diag(estimate.covariance_m2ps2))
        numbers = " ".join(f"{value!r}" for value in (*estimate.velocity_p_mps.tolist(), *sd.tolist()))
        text = f"{estimate.time_ns} {estimate.state} {estimate.rank} {estimate.reset_counter} {numbers}\n"
        return text.encode()


@contextmanager
def probe_registered() -> Iterator[None]:
    """The probe as a port by name, for as long as this lasts."""
    registry.PORTS["probe"] = Probe
    try:
        yield
    finally:
        registry.PORTS.pop("probe", None)


@dataclass(frozen=True)
class Sent:
    """A line of the probe."""

    time_ns: int
    state: str
    rank: int
    resets: int
    velocity: np.ndarray
    sd: np.ndarray

    @classmethod
    def parse(cls, data: bytes) -> Sent:
        """From its bytes."""
        time, state, rank, resets, *numbers = data.decode().split()
        values = np.array([float(text) for text in numbers])
        return cls(int(time), state, int(rank), int(resets), values[:3], values[3:])


VELOCITY_TOML = """
name = "test"
mode = "velocity"
dvl.geometry = "waterlinked_a50"
dvl.beam_noise_mps = 0.01
[[source]]
name = "dvl"
address = "{dvl}"
format = "{format}"
rate_hz = 10
[[port]]
port = "probe"
to = "{to}"
"""

NAVIGATION_TOML = """
name = "test"
mode = "navigation"
dvl.geometry = "waterlinked_a50"
dvl.beam_noise_mps = 0.01
origin.latitude_deg = 32.8
navigation.method = "tc"  # the vehicle moves as no slender one does
[imu]
rate_hz = 100
accel_bias_mg = 1.0
gyro_bias_deg_per_h = 10.0
accel_noise_mps_per_rt_h = 0.05
gyro_noise_deg_per_rt_h = 0.1
[start]
window_s = 1.0
heading_deg = 30.0
heading_sd_deg = 2.0
[states]
settle_s = 0.5
[[source]]
name = "dvl"
address = "{dvl}"
format = "{format}"
rate_hz = 10
[[source]]
name = "imu"
address = "{imu}"
format = "imu-csv"
rate_hz = 100
[[port]]
port = "probe"
to = "{to}"
rate_hz = 10
"""


PLACES = {
    "dvl": "tcp:127.0.0.1:9",
    "imu": "udpin:127.0.0.1:9",
    "to": "udpout:127.0.0.1:9",
    "format": "waterlinked-json",
}


def text_of(mode: str, **places: str) -> str:
    """The text of a configuration, with other places than `PLACES`."""
    return (VELOCITY_TOML if mode == "velocity" else NAVIGATION_TOML).format(**(PLACES | places))


def config(
    mode: str = "velocity",
    *,
    extra: str = "",
    geometry: str = "waterlinked_a50",
    change: tuple[str, str] = ("", ""),
    **addresses: str,
) -> LiveConfig:
    """A configuration of the tests, with a text of it that is another."""
    text = text_of(mode, **addresses)
    assert change[0] in text
    text = text.replace(*change, 1) if change[0] else text
    return parse_config(text.replace("waterlinked_a50", geometry) + extra, place="test")


Lost = Callable[[float], tuple[int, ...]]
Arrivals = list[tuple[int, int, bytes]]
"""Time of arrival, source (0 DVL, 1 IMU) and bytes, in order."""
Flown = list[tuple[int, Message, State]]
"""Arrival, message and state of everything that a run sends."""


def fly(engine: Engine, arrivals: Iterable[tuple[int, int, bytes]]) -> Flown:
    """Gives an engine what arrives."""
    found: Flown = []
    for arrival_ns, source, data in arrivals:
        found += [(arrival_ns, message, engine.state) for message in engine.arrive(source, arrival_ns, data)]
    return found


def lines(sent: Flown) -> list[Sent]:
    """What the probe has written."""
    return [Sent.parse(message.data) for _, message, _ in sent]


def states(sent: Flown) -> list[State]:
    """The states of the messages, without repeats."""
    names = [state for _, _, state in sent]
    return names[:1] + [b for a, b in pairwise(names) if a != b]


def navigator_of(engine: Engine) -> Navigator:
    """Its navigator, once it is aligned."""
    assert isinstance(engine.estimator, NavigationEstimator)
    assert engine.estimator.navigator is not None
    return engine.estimator.navigator


def one_to_three_beams(t: float) -> tuple[int, ...]:
    """Two beams lost from 3 s to 5 s, all from 5 s to 6.5 s."""
    return (1, 2) if 3.0 <= t < 5.0 else (0, 1, 2, 3) if 5.0 <= t < 6.5 else ()


@dataclass
class World:
    """A straight run at constant velocity, seen by its instruments.

    Attributes:
        seconds: duration.
        lost: beams that do not return, from 0, at a time in s.
        form: format of the DVL.
        offset_ns: the DVL's clock minus the host's, at a time in s.
        seed: of every noise.
        outliers: fraction of the readings of beams with twelve times the noise.
        through_mps: velocity through the water, which its beams measure with twice the noise; None without water.
    """

    seconds: float
    lost: Lost = lambda _: ()
    form: str = "waterlinked-json"
    offset_ns: Callable[[float], int] = lambda _: -1_000_000_000_000
    seed: int = 1
    outliers: float = 0.0
    through_mps: np.ndarray | None = None
    dvl_hz: float = 10.0
    imu_hz: float = 100.0
    pings: dict[int, np.ndarray] = field(default_factory=dict)

    def arrivals(self, more: Iterable[tuple[int, int, bytes]] = (), *, imu: bool = False) -> Arrivals:
        """What comes of its instruments, and more."""
        entries = [*self.dvl(), *(self.imu() if imu else ()), *more]
        return sorted(entries, key=lambda entry: entry[:2])

    def dvl(self) -> Iterator[tuple[int, int, bytes]]:
        """Reports of the DVL, 40 ms after the time of validity and up to 5 ms of delay."""
        random = np.random.default_rng([self.seed, 1])
        of_water = np.random.default_rng([self.seed, 3])
        geometry = read_geometry("waterlinked_a50").geometry
        encode = encoder(self.form, geometry).encode
        before = 0
        for k in range(round(self.seconds * self.dvl_hz)):
            t = (k + 0.5) / self.dvl_hz
            valid_ns = START_NS + round(t * 1e9)
            beams = geometry.beam_velocities(VELOCITY[np.newaxis])[0] + BEAM_SD * random.standard_normal(4)
            if self.outliers:
                beams += (random.random(4) < self.outliers) * 12.0 * BEAM_SD * random.standard_normal(4)
            lost = list(self.lost(t))
            beams[lost] = np.nan
            ranges = np.full(4, 12.0)
            ranges[lost] = np.nan
            offset = self.offset_ns(t)
            own = (valid_ns + offset) // 1000 * 1000
            water = None
            if self.through_mps is not None:
                water = geometry.beam_velocities(self.through_mps[np.newaxis])[0]
                water += 2.0 * BEAM_SD * of_water.standard_normal(4)
            whole = not lost
            solved = (
                solve_velocity(geometry, beams[np.newaxis], [[True] * 4], method="lc", beam_sd_mps=BEAM_SD)
                if whole
                else None
            )
            ping = Ping(
                time_ns=own,
                transmission_ns=own + 40_000_000,
                interval_ns=own - before if k and own > before else 0,
                number=k + 1,
                beam_velocity_mps=beams,
                range_m=ranges,
                velocity_p_mps=None if solved is None else solved.velocity_p_mps[0],
                covariance_m2ps2=None if solved is None else solved.cov_m2ps2[0],
                altitude_m=11.0,
                water_velocity_mps=water,
                water_range_m=4.0,
                water_sd_mps=2.0 * BEAM_SD,
            )
            before = own
            yield valid_ns + 40_000_000 + int(random.exponential(1e6)), 0, encode(ping)

    def imu(self) -> Iterator[tuple[int, int, bytes]]:
        """Inertial readings of the same run, level on heading 30 degrees."""
        random = np.random.default_rng([self.seed, 2])
        latitude = math.radians(LATITUDE_DEG)
        earth = EARTH_RATE_RADPS * np.array([math.cos(latitude), 0.0, -math.sin(latitude)])
        gravity = np.array([0.0, 0.0, normal_gravity_mps2(latitude)])
        still = np.tile([0.0, 0.0, math.radians(30.0)], (3, 1))
        (force, *_), (omega, *_), *_ = felt(1.0, still, np.tile(VELOCITY, (3, 1)), earth, gravity)
        for k in range(round(self.seconds * self.imu_hz)):
            time_ns = START_NS + round(k * 1e9 / self.imu_hz)
            w = omega + 1e-4 * random.standard_normal(3)
            f = force + 5e-3 * random.standard_normal(3)
            numbers = ",".join(f"{value:.9g}" for value in (*w, *f))
            own_ns = time_ns - START_NS
            text = f"{own_ns},{numbers}".encode()
            yield time_ns + int(random.exponential(3e5)), 1, text + b"*%02X\n" % xor_of(text)
