"""What `bottomlock live-demo` runs: a simulated vehicle, `live` and a MAVLink listener on loopback."""

import asyncio
import contextlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.cli.console import console, say
from bottomlock.cli.live import serve_page
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.encoders.registry import encoder
from bottomlock.errors import OutputError
from bottomlock.instruments.faults import NONE
from bottomlock.instruments.play import Channel, parse_address, play, sink_of
from bottomlock.instruments.readings import Readings
from bottomlock.instruments.schedule import Record, depth_lines, imu_lines, records
from bottomlock.instruments.sources import with_geometry
from bottomlock.live.config import LiveConfig
from bottomlock.live.engine import Engine
from bottomlock.live.health import status
from bottomlock.live.loop import cancel, cancel_at_signals
from bottomlock.live.runner import Live, host_clock
from bottomlock.ports.mavlink import dialect

SCENARIO, GEOMETRY = "survey_table2", "waterlinked_a50"
TWO_FROM, NONE_FROM, BACK_FROM = 0.3, 0.55, 0.75
"""Parts of the duration: from here on two beams return, none, and all again."""
LOST_FIRST = (3, 4)
DVL_HZ = 5.0
SEABED_M = 60.0
SENT_AFTER_S = 5.0
"""The instruments send so much longer: what listens ends first."""


def demo_scenario(seconds: float) -> Scenario:
    """The scenario of a demonstration that lasts so many seconds.

    It is the packaged one at constant depth, so that the vehicle is calm while it aligns, over a seabed that is near
    enough for all beams; they are lost by outages alone.
    """
    scenario = load_scenario(SCENARIO).with_trajectory(duration_s=seconds + SENT_AFTER_S)
    two_s, none_s, back_s = (part * seconds for part in (TWO_FROM, NONE_FROM, BACK_FROM))
    outages = [
        {"beams": LOST_FIRST, "from_s": two_s, "to_s": none_s},
        {"beams": (1, 2, 3, 4), "from_s": none_s, "to_s": back_s},
    ]
    changes = {
        "mission.dive_rate_mps": 0.0,
        "seabed.depth_m": SEABED_M,
        "dvl.rate_hz": DVL_HZ,
        "dvl.outages": outages,
    }
    return with_geometry(scenario.replace(changes), GEOMETRY)


_DIAGONAL = (0, 6, 11)
"""Places of the first three variances in the upper triangle of a 6 by 6 covariance."""


@dataclass(frozen=True)
class Heard:
    """A message: its time, velocity (3,) and 1 sigma (3,) in m/s, platform axes, and the state when it came."""

    time_ns: int
    velocity_mps: NDArray[np.float64]
    sd_mps: NDArray[np.float64]
    state: str


class Listener(asyncio.DatagramProtocol):
    """Parses datagrams and keeps what it has heard.

    Args:
        state: gives the state now.

    Raises:
        ScenarioError: where the MAVLink library is not installed.
    """

    def __init__(self, state: Callable[[], str]) -> None:
        self._link = dialect().MAVLink(None)
        self._state = state
        self.heard: list[Heard] = []

    def datagram_received(self, data: bytes, addr: object) -> None:  # noqa: ARG002 - asyncio's
        """Takes the messages of a datagram."""
        for message in self._link.parse_buffer(data) or ():
            if message.get_type() != "ODOMETRY":
                continue
            velocity = np.array([message.vx, message.vy, message.vz])
            sd = np.array([math.sqrt(message.velocity_covariance[place]) for place in _DIAGONAL])
            self.heard.append(Heard(message.time_usec * 1000, velocity, sd, self._state()))


PRINT_S = 1.0
LEAST_SILENCE_S = 0.1
"""A host pauses as long at any speed, so that the pause of the run is as many times longer."""

Clock = Callable[[], int]


def say_now(text: str) -> None:
    """Prints a line at once."""
    say(text)
    console.file.flush()


def demo_config(scenario: Scenario, readings: Readings, places: dict[str, str], **other: Any) -> LiveConfig:  # noqa: ANN401
    """The configuration of `live`: the IMU's and DVL's errors as the scenario draws them.

    Args:
        scenario: of the vehicle.
        readings: of its run; the heading at the start is given.
        places: addresses by the names dvl, imu, depth and port.
        other: `page_port` and `speed`.
    """
    truth = readings.truth
    assert truth is not None  # a simulated run
    assert scenario.depth is not None
    dvl = scenario.dvl.model_dump()
    errors = (
        "beam_bias_mps", "beam_bias_walk_mps_per_rt_s", "scale_factor_percent", "scale_factor_walk_percent_per_rt_s",
    )  # fmt: skip
    rates = {"dvl": DVL_HZ, "imu": scenario.imu.rate_hz, "depth": scenario.depth.rate_hz}
    formats = {"dvl": "waterlinked-json", "imu": "imu-csv", "depth": "depth-csv"}
    content = {
        "name": "demo",
        "mode": "navigation",
        "dvl": {
            "geometry": GEOMETRY,
            "beam_noise_mps": scenario.dvl.beam_noise_mps,
            "errors": {key: dvl[key] for key in errors},
        },
        "source": [
            {"name": name, "address": places[name], "format": formats[name], "rate_hz": rates[name]}
            for name in formats
        ],
        "port": [{"port": "odometry", "to": places["port"]}],
        "imu": scenario.imu.model_dump(exclude={"limits"}),
        "depth": {"bias_m": scenario.depth.bias_m, "bias_time_s": scenario.depth.bias_time_s},
        "origin": {"latitude_deg": scenario.environment.latitude_deg},
        "start": {
            "window_s": 2.0,
            "heading_deg": math.degrees(truth.rpy_rad[0, 2]),
            "heading_sd_deg": 1.0,
            "position_m": truth.position_t_m[0].tolist(),
        },
        "filter": {"gate_probability": scenario.filter.gate_probability},
        "states": {"silent_least_s": LEAST_SILENCE_S * max(other["speed"], 1.0)},
        "health": {"port": other["page_port"]},
    }
    return LiveConfig.model_validate(content).checked()


def _scaled(clock: Clock, speed: float) -> Clock:
    """A clock that runs `speed` times as fast, so that a fast run has the times of a slow one."""
    begin_ns = clock()
    return lambda: begin_ns + round((clock() - begin_ns) * speed)


@dataclass
class Demo:
    """One demonstration."""

    scenario: Scenario
    readings: Readings
    seconds: float
    speed: float
    page_port: int
    offset_ns: int | None = None
    live: Live | None = None
    listener: Listener | None = None

    async def run(self) -> None:
        """Runs for so many seconds, or until Ctrl-C."""
        cancel_at_signals()
        with contextlib.suppress(asyncio.CancelledError):
            await self._chain()

    async def _chain(self) -> None:
        """Instruments, then `live` at their addresses, its page, the listener; ended in the other order."""
        clock = _scaled(host_clock(), self.speed)
        listener = Listener(lambda: "" if self.live is None else self.live.engine.state)
        self.listener = listener
        hearing, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: listener, local_addr=("127.0.0.1", 0)
        )
        channels, opened = list(self._channels()), asyncio.Event()
        tasks = [asyncio.create_task(self._play(channels, opened, clock))]
        try:
            await _first(tasks[0], opened)
            places = {channel.name: channel.sink.where for channel in channels}
            places["port"] = f"udpout:127.0.0.1:{hearing.get_extra_info('sockname')[1]}"
            settings = demo_config(
                self.scenario, self.readings, places, page_port=self.page_port, speed=self.speed
            )
            self.live = Live(settings, Engine(settings), say=self._said, clock=clock)
            tasks += [
                asyncio.create_task(task)
                for task in (serve_page(self.live, say_now), self.live.run(), self._lines(clock))
            ]
            await asyncio.wait(tasks, timeout=self.seconds / self.speed, return_when=asyncio.FIRST_EXCEPTION)
        finally:
            for task in reversed(tasks):
                await cancel(task)
            hearing.close()

    def _channels(self) -> Iterator[Channel]:
        readings = self.readings
        inertial, depths = readings.imu, readings.depth
        assert inertial is not None
        assert depths is not None

        def pings(offset_ns: int) -> Iterator[Record]:
            writer = encoder("waterlinked-json", readings.geometry)
            return records(readings, writer, NONE, seed=self.scenario.campaign.seed, offset_ns=offset_ns)

        makers: dict[str, Callable[[int], Iterator[Record]]] = {
            "dvl": pings,
            "imu": lambda offset_ns: imu_lines(inertial, offset_ns=offset_ns),
            "depth": lambda offset_ns: depth_lines(depths, offset_ns=offset_ns),
        }
        for name, maker in makers.items():
            yield Channel(name, sink_of(parse_address("tcpin:0", name)), maker)

    async def _play(self, channels: list[Channel], opened: asyncio.Event, clock: Clock) -> None:
        def begin() -> int:
            self.offset_ns = clock() - self.readings.first_ns
            return self.offset_ns

        await play(
            channels, speed=self.speed, opened=opened.set, offset_ns=begin, sent=lambda _part, _record: None
        )

    def _said(self, text: str) -> None:
        """Prints what `live` says, but for its connections, which are all there."""
        if not text.startswith("source "):
            say_now(text)

    async def _lines(self, clock: Clock) -> None:
        """Prints a line a second."""
        assert self.live is not None
        assert self.listener is not None
        while True:
            await asyncio.sleep(PRINT_S)
            shown = status(self.live)
            run_s = 0.0 if self.offset_ns is None else (clock() - self.offset_ns) * 1e-9
            say_now(line(run_s, shown, self.listener))

    def summary(self) -> Iterator[str]:
        """States in their order, messages, and the error of what was received."""
        if self.live is None or self.listener is None:
            return
        heard, truth = self.listener.heard, self.readings.truth
        sent = self.live.engine.ports[0].sent
        yield f"{len(heard)} ODOMETRY messages received of {sent} sent"
        if not heard or truth is None or self.offset_ns is None:
            return
        yield "states: " + " → ".join(state for state, _ in groupby(message.state for message in heard))
        times = np.array([message.time_ns for message in heard]) - self.offset_ns
        true = np.stack(
            [np.interp(times, self.readings.time_ns, axis) for axis in truth.velocity_p_mps.T], axis=1
        )
        error = np.linalg.norm(np.stack([message.velocity_mps for message in heard]) - true, axis=1)
        sd = np.array([np.linalg.norm(message.sd_mps) for message in heard])
        for state in dict.fromkeys(message.state for message in heard):
            there = np.array([message.state == state for message in heard])
            yield (
                f"{state}: velocity error {np.sqrt((error[there] ** 2).mean()):.3f} m/s RMS over {there.sum()} "
                f"messages, 1σ sent {np.sqrt((sd[there] ** 2).mean()):.3f} m/s"
            )


def line(run_s: float, shown: dict[str, Any], listener: Listener) -> str:
    """State, beams, velocity with 1 sigma as received last, messages received."""
    beams = " ".join(
        "-" if beam["velocity_mps"] is None else str(k) for k, beam in enumerate(shown["beams"], 1)
    )
    velocity = "nothing received yet"
    if listener.heard:
        last = listener.heard[-1]
        pairs = zip(last.velocity_mps, last.sd_mps, strict=True)
        velocity = "  ".join(f"{v:+.3f} ± {sd:.3f}" for v, sd in pairs) + " m/s"
    return f"{run_s:6.1f} s  {shown['state']:12}  beams {beams}  {velocity}  {len(listener.heard)} messages"


async def _first(task: "asyncio.Task[None]", opened: asyncio.Event) -> None:
    """Waits until the instruments are open.

    Raises:
        OutputError: where they cannot be opened.
    """
    waiting = asyncio.create_task(opened.wait())
    try:
        await asyncio.wait({task, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
            raise OutputError("the instruments ended before they sent anything")
    finally:
        await cancel(waiting)
