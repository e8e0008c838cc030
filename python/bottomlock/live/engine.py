"""The engine: bytes and their times of arrival in, bytes for the ports out.

It has no clock of its own, so a raw log played again gives the very bytes that were sent. Work that depends on time
alone (silence, lines that wait) is done at multiples of `TICK_NS` of the arrival clock, whoever asks first.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from bottomlock import units
from bottomlock.errors import BottomlockError
from bottomlock.io.rows import Options
from bottomlock.io.sentences import without_numbers
from bottomlock.live.clock import ClockMap, Verdict
from bottomlock.live.config import LiveConfig
from bottomlock.live.doubts import Reasons
from bottomlock.live.estimator import Estimator, VelocityEstimator
from bottomlock.live.navigator_config import kernel_settings
from bottomlock.live.readings import LineReader, MavlinkReader, PingReader, Reader, RosReader
from bottomlock.live.sections import DVL_FORMATS, ROS_TYPES, ImuSection, SourceSection
from bottomlock.live.states import Facts, StateMachine
from bottomlock.ports.estimate import SILENT, Estimate, State
from bottomlock.ports.port import Port
from bottomlock.recordings.readings import Ping, Reading

TICK_NS = 50_000_000
LONGEST_PAUSE_NS = 1_000_000_000
"""A longer pause of the process is the silence of its sources."""
WAIT_NS = 150_000_000
"""How long the lines of an incomplete ping are held for the rest of it."""
REPEATS = 64
"""Stamps that a DVL's are compared with to find repeats."""

OFTEN = 0.2
"""Steps of a clock over readings that were taken, above which it runs at another rate than its stamps."""
OLDEST_NS = 10_000_000_000
"""Age from which on a stamp on the host's clock is none: the longest horizon of a navigator."""


@dataclass(frozen=True)
class Message:
    """Bytes for a port, by its place in the configuration."""

    port: int
    data: bytes


@dataclass
class SourceState:
    """A source as the engine sees it.

    Attributes:
        section: its settings.
        reader: bytes to pings or readings.
        clocks: of each kind of reading, on the host's: MAVLink's messages count from boot or from 1970.
        last_ns: arrival of its last bytes; None before the first.
        used: readings or pings that were taken.
        refused: those that were not, by reason.
        connections: how often it was connected.
        stamps: of the last pings that were taken.
        stamp_ns: of the last ping, whether or not it was taken.
    """

    section: SourceSection
    reader: Reader[Ping] | Reader[Reading]
    clocks: dict[type, ClockMap] = field(default_factory=dict)
    last_ns: int | None = None
    used: int = 0
    refused: Reasons = field(default_factory=Reasons)
    connections: int = 0
    stamps: list[int] = field(default_factory=list)
    stamp_ns: int | None = None

    def clock_of(self, reading: Ping | Reading) -> ClockMap:
        """The clock of the stamps of such readings."""
        return self.clocks.setdefault(type(reading), ClockMap(units.ns_from_s(self.section.step_s)))

    @property
    def clock_steps(self) -> int:
        """How often one of its clocks was set."""
        return sum(clock.steps for clock in self.clocks.values())


@dataclass
class PortState:
    """A port as the engine sees it: messages sent, and why the last estimate was not."""

    port: Port
    name: str
    sent: int = 0
    silent_because: str = "nothing to send yet"


class Engine:
    """Live navigation as a function of bytes and times of arrival.

    Args:
        config: the configuration.
        make_estimator: makes the estimator; by default that of the mode.
        reset_counter: of the estimates, at the start.

    Attributes:
        content_hash: of what the navigator was made of at the start, whatever becomes of the files since.
        offered: is given every estimate that the ports are offered; None for nobody.
    """

    def __init__(
        self,
        config: LiveConfig,
        *,
        make_estimator: Callable[[LiveConfig], Estimator] | None = None,
        reset_counter: int = 0,
    ) -> None:
        self.config = config
        self.content_hash = config.content_hash()
        instrument = config.instrument()
        self.beams = instrument.geometry.beams
        self.estimator = (make_estimator or _estimator)(config)
        self.sources = [self._source(section) for section in config.source]
        self.ports = [
            PortState(port, section.port) for section, port in zip(config.port, config.ports(), strict=True)
        ]
        self.offered: Callable[[Estimate], None] | None = None
        self.machine = StateMachine(config.states)
        self._reset_counter = reset_counter
        self._tick_ns: int | None = None
        self._offered_ns: int | None = None
        self._estimate_ns = units.ns_from_s(1.0 / config.navigation.estimate_hz)
        self._ping_period_ns = _period_ns(one for one in config.source if one.format in DVL_FORMATS)
        self._imu_period_ns = _period_ns(config.sources_of(config.motion))
        # Only stamps that are taken as they are have the offset that the DVL's file states.
        self._dvl_offset_ns = units.ns_from_s(instrument.stated.clock_offset_s)
        self._steps_seen = 0
        self._failed = ""
        self._pause_ns, self._paused_at_ns, self._caught_up_ns = 0, 0, 0
        self.now_ns = 0

    def _source(self, section: SourceSection) -> SourceState:
        reader: Reader[Ping] | Reader[Reading]
        if section.format in DVL_FORMATS:
            options = Options(negate_beams=section.negate_beams, keep_stale=section.keep_stale)
            reader = PingReader(section.format, self.beams, options)
        elif section.format in ROS_TYPES:
            gravity = kernel_settings(self.config, self.config.instrument()).gravity_mps2
            reader = RosReader(section.format, self.config.depth, gravity)
        elif section.format == "mavlink":
            reader = self._mavlink_reader(section)
        else:
            within = section.address.startswith("serial:")
            reader = LineReader(section.format, checksum=section.checksum, within=within)
        return SourceState(section, reader)

    def _mavlink_reader(self, section: SourceSection) -> MavlinkReader:
        """Of what no lines give."""
        config = self.config
        inertial, turned, deep, fixed = (
            section in config.sources_of(readings) for readings in ("imu", "attitude", "depth", "gps")
        )
        return MavlinkReader(
            config.depth if deep else None,
            kernel_settings(config, config.instrument()).gravity_mps2,
            config.attitude.message if turned and config.attitude is not None else None,
            inertial=inertial and isinstance(config.imu, ImuSection),
            gps=fixed and config.gps is not None,
            system=section.system,
            component=section.component,
        )

    @property
    def state(self) -> State:
        """The state now."""
        return self.machine.state

    @property
    def reset_counter(self) -> int:
        """Discontinuities that no measurement explains, modulo 256."""
        return (self._reset_counter + self.estimator.resets) % 256

    def fail(self, why: str) -> None:
        """Nothing is sent any more: the engine has failed."""
        self._failed = why
        self._judge(self.now_ns)

    def connected(self, source: int, now_ns: int) -> list[Message]:
        """A source was connected (anew): a record that had begun is forgotten."""
        messages = self.advance(now_ns)
        one = self.sources[source]
        one.connections += 1
        if one.connections > 1:
            one.reader.reset()
        return messages

    def paused(self, pause_ns: int, now_ns: int) -> list[Message]:
        """The process did not run for so long: what came meanwhile waits, and no source is silent or late for it.

        A pause of more than `LONGEST_PAUSE_NS` is none.
        """
        if pause_ns > LONGEST_PAUSE_NS:
            return self.advance(now_ns)
        self._pause_ns, self._paused_at_ns = pause_ns, self.now_ns
        self._caught_up_ns = now_ns + max(pause_ns, TICK_NS)
        self._tick_ns = self.now_ns = now_ns
        return []

    def arrive(self, source: int, arrival_ns: int, data: bytes) -> list[Message]:
        """Takes bytes of a source, by its place in the configuration; arrivals never fall."""
        messages = self.advance(arrival_ns)
        one = self.sources[source]
        one.last_ns = arrival_ns
        for reading in one.reader.feed(data):
            messages += self._take(one, arrival_ns, reading)
        return messages

    def advance(self, now_ns: int) -> list[Message]:
        """Does what depends on time alone, up to `now_ns`."""
        messages: list[Message] = []
        first = now_ns // TICK_NS if self._tick_ns is None else self._tick_ns // TICK_NS + 1
        # After a long pause of the process the last tick says what a thousand would.
        for tick in range(max(first, now_ns // TICK_NS - 1000), now_ns // TICK_NS + 1):
            self._tick_ns = tick * TICK_NS
            messages += self._tick(self._tick_ns)
        self.now_ns = now_ns
        return messages

    def _tick(self, now_ns: int) -> list[Message]:
        messages: list[Message] = []
        for one in self.sources:
            if one.reader.waiting and one.last_ns is not None and now_ns - one.last_ns >= WAIT_NS:
                for reading in one.reader.flush():
                    messages += self._take(one, one.last_ns, reading)
        self._judge(now_ns)
        return messages

    def _take(self, one: SourceState, arrival_ns: int, reading: Ping | Reading) -> list[Message]:
        time_ns = self._time_ns(one, arrival_ns, reading)
        if time_ns is None:
            return []
        try:
            self.estimator.take(time_ns, reading, arrival_ns)
        except BottomlockError as error:
            one.refused.add(without_numbers(str(error))[:100])
            return []
        one.used += 1
        if isinstance(reading, Ping):
            # What a ping has changed is sent at once.
            self._judge(arrival_ns)
            return self._send(least_ns=1)
        return self._send(least_ns=self._estimate_ns) if isinstance(reading, self.config.moved_by) else []

    def _time_ns(self, one: SourceState, arrival_ns: int, reading: Ping | Reading) -> int | None:
        """Time of validity on the host's clock; None where it is unsure, which is counted."""
        latency_ns = units.ns_from_s(one.section.latency_s)
        is_ping = isinstance(reading, Ping)
        offset_ns = self._dvl_offset_ns if is_ping else 0
        if one.section.clock == "arrival":
            return arrival_ns - latency_ns
        if one.section.clock == "host":
            # One stamp far ahead would make every later reading an old one.
            ahead_ns = reading.time_ns - arrival_ns
            if not -OLDEST_NS < ahead_ns <= units.ns_from_s(one.section.step_s):
                one.refused.add("its time is not that of the host")
                return None
            return reading.time_ns + offset_ns - latency_ns
        sent_ns = reading.transmission_ns if isinstance(reading, Ping) else reading.time_ns
        clock, is_stuck = one.clock_of(reading), is_ping and reading.time_ns == one.stamp_ns
        one.stamp_ns = reading.time_ns if is_ping else one.stamp_ns
        verdict: Verdict = "late"
        if not is_stuck:
            verdict = clock.observe(sent_ns, arrival_ns, waited=arrival_ns < self._caught_up_ns)
        # Stamps that rise from one that was there before are those of a clock that was set back.
        if verdict != "stepped" and is_ping and reading.time_ns in one.stamps:
            one.refused.add("its time repeats")
            return None
        if verdict == "late":
            is_odd = clock.steps > OFTEN * max(one.used, 10)
            one.refused.add(
                "its clock is set again and again: are its times in the unit of its format?"
                if is_odd
                else "late, or its clock was set: time of validity unsure"
            )
            return None
        if verdict == "stepped":
            one.stamps.clear()
        if is_ping:
            one.stamps.append(reading.time_ns)
            del one.stamps[:-REPEATS]
        return clock.host_ns(reading.time_ns) - latency_ns

    def _judge(self, now_ns: int) -> None:
        steps = sum(one.clock_steps for one in self.sources)
        estimator = self.estimator
        facts = Facts(
            now_ns=now_ns,
            mode=self.config.mode,
            waiting_for="" if self._failed else estimator.waiting_for,
            ping_age_ns=self._age(now_ns, estimator.ping_used_ns),
            ping_period_ns=self._ping_period_ns,
            rank=estimator.rank,
            imu_age_ns=self._age(now_ns, estimator.imu_used_ns),
            imu_period_ns=self._imu_period_ns,
            velocity_sd_mps=estimator.velocity_sd_mps,
            stepped=steps > self._steps_seen,
            doubt=estimator.doubts.now,
            water_age_ns=self._age(now_ns, estimator.water_used_ns),
            imu_fault=estimator.imu_fault,
            fault=self._failed or estimator.fault,
        )
        self._steps_seen = steps
        self.machine.update(facts)

    def _age(self, now_ns: int, then_ns: int | None) -> int | None:
        """Time since then, without a pause of the process that has just been."""
        if then_ns is None:
            return None
        waits = then_ns <= self._paused_at_ns and now_ns < self._caught_up_ns
        return max(now_ns - then_ns - (self._pause_ns if waits else 0), 0)

    def _send(self, *, least_ns: int) -> list[Message]:
        """The estimate to every port, if it is `least_ns` later than the last; nothing where the state forbids it."""
        time_ns = self.estimator.time_ns
        if time_ns is None or not (self.ports or self.offered):
            return []
        if self._offered_ns is not None and time_ns - self._offered_ns < least_ns:
            return []
        if self.state in SILENT:
            for one in self.ports:
                one.silent_because = f"state is {self.state}: {self.machine.why}"
            return []
        estimate = self.estimator.estimate(self.state, self.reset_counter)
        if estimate is None:
            return []
        self._offered_ns = time_ns
        if self.offered is not None:
            self.offered(estimate)
        messages = []
        for place, one in enumerate(self.ports):
            data = self._encoded(one, estimate)
            if data is not None:
                one.sent += 1
                messages.append(Message(place, data))
        return messages

    @staticmethod
    def _encoded(one: PortState, estimate: Estimate) -> bytes | None:
        """The message of a port; None, and the reason, where it sends nothing."""
        try:
            data = one.port.encode(estimate)
            one.silent_because = "" if one.port.waits else one.port.reason or ""
        except BottomlockError as error:
            one.silent_because = str(error)
            return None
        return data


def _estimator(config: LiveConfig) -> Estimator:
    if config.mode == "navigation":
        from bottomlock.live.navigation import NavigationEstimator  # noqa: PLC0415 - mode velocity starts without it

        return NavigationEstimator(config)
    return VelocityEstimator(config)


def _period_ns(sources: Iterable[SourceSection]) -> int:
    """Longest expected period among sources; 0 without any."""
    return max((units.ns_from_s(1.0 / one.rate_hz) for one in sources), default=0)
