"""States of live use: what is known now decides, in one table, whether and how far an estimate may be used.

The worst condition counts. A state worsens at once and improves only after `settle_s` without a worse condition: the
state is the worst that held within the last `settle_s`. docs/live.md prints the table.
"""

from collections import Counter
from dataclasses import dataclass

from bottomlock.kernel import Report
from bottomlock.live.sections import StatesSection
from bottomlock.ports.estimate import Mode, State
from bottomlock.units import ns_from_s

MOST = 40
"""Reasons that are counted apart: some hold words from the line, which may be anything."""


class Reasons(Counter[str]):
    """Counts by reason, for as long as a process runs.

    >>> reasons = Reasons()
    >>> for k in range(50): reasons.add(f"reason {k}")
    >>> len(reasons), reasons["other reasons"]
    (41, 10)
    """

    def add(self, reason: str, count: int = 1) -> None:
        """Counts a reason; beyond `MOST` of them as another one."""
        self[reason if reason in self or len(self) < MOST else "other reasons"] += count


BEAM_SENSORS = ("beams", "velocity")
"""The kernel's names of a DVL's measurements in its reports."""
REFERENCES = {"heading", "attitude", "depth", "acoustic_position", "gps_position"}
"""What measures where the vehicle is and how it is turned: where one contradicts the estimate, either is wrong."""


@dataclass(frozen=True)
class Contradiction:
    """Readings of a sensor that were rejected one after another: how many, and for how long, ns."""

    sensor: str
    readings: int
    lasted_ns: int

    @property
    def words(self) -> str:
        """The sensor in words."""
        return self.sensor.replace("_", " ")

    def __str__(self) -> str:
        return f"{self.words} has contradicted the estimate for {self.lasted_ns * 1e-9:.0f} s"


def contradicts(
    longest: Contradiction | None, limits: StatesSection, *, is_lasting: bool
) -> tuple[str, str] | None:
    """What contradicts the estimate beside rejected pings, and the sentence; None where nothing does.

    Args:
        longest: rejected readings, which may be chance, or be shorter than a state takes to settle.
        limits: of the states.
        is_lasting: whether the mean of pings does.
    """
    if is_lasting:
        return "the mean of pings", "the mean of pings contradicts the estimate"
    if (
        longest is None
        or longest.readings < limits.rejected_pings
        or longest.lasted_ns < ns_from_s(limits.settle_s)
    ):
        return None
    return longest.words, str(longest)


class Contradictions:
    """Runs of rejected readings of each of `REFERENCES`; one that is not rejected ends its run.

    Attributes:
        lasting: the mean of the pings up to the last one shows an error of the estimate that no gate sees.
    """

    def __init__(self) -> None:
        self._runs: dict[str, tuple[int, int, int]] = {}
        self._is_ping_rejected = False
        self.lasting = False

    def take(self, report: Report) -> None:
        """Counts a report; those of other sensors and revised ones do not count."""
        if report.revised:
            return
        if report.sensor in BEAM_SENSORS:
            # What is charged after pings that were rejected is theirs.
            self.lasting = report.inflation is not None and not self._is_ping_rejected
            self._is_ping_rejected = report.verdict == "rejected"
        if report.sensor not in REFERENCES:
            return
        if report.verdict == "rejected":
            since_ns, count, _ = self._runs.get(report.sensor, (report.time_ns, 0, 0))
            self._runs[report.sensor] = since_ns, count + 1, report.time_ns
        else:
            self._runs.pop(report.sensor, None)

    @property
    def longest(self) -> Contradiction | None:
        """The run that has lasted longest; None without any."""
        runs = [
            Contradiction(sensor, count, last - since) for sensor, (since, count, last) in self._runs.items()
        ]
        return max(runs, key=lambda run: run.lasted_ns, default=None)


ORDER: tuple[State, ...] = ("OK", "PARTIAL", "WATER", "COASTING", "UNSAFE")
"""From the best to the worst; INITIALISING stands apart."""


@dataclass(frozen=True)
class Facts:
    """What is known at one time; ages and periods in ns, None for what has not come yet.

    Attributes:
        now_ns: host's clock.
        mode: "velocity" or "navigation".
        waiting_for: what the start still lacks; "" once the estimate exists.
        ping_age_ns: since a beam was last used.
        ping_period_ns: expected time between pings.
        rank: directions that the used beams of the last ping determine; 0 if the gate rejected it.
        imu_age_ns: since an inertial reading was last used (mode navigation).
        imu_period_ns: expected time between readings.
        velocity_sd_mps: largest 1 sigma of a velocity axis; None in mode velocity.
        rejected: pings in a row that the gate has rejected.
        lasting: the mean of the pings up to the last one shows an error of the estimate that no gate sees.
        closure_ratio: scatter of the beams' closure over the claimed one; None where it is not known.
        own_ratio: scatter of the beams about the instrument's own velocity over the claimed one; None likewise.
        stepped: a clock has been set since the facts before.
        fault: why the estimate cannot be used at all; "" if it can.
        water_age_ns: since all directions of the velocity through the water were last measured; None without such.
        imu_fault: why the last inertial reading was rejected; "" if it was not.
        contradiction: the longest of another sensor, as `Contradictions.longest`.
    """

    now_ns: int
    mode: Mode
    waiting_for: str
    ping_age_ns: int | None
    ping_period_ns: int
    rank: int
    imu_age_ns: int | None
    imu_period_ns: int
    velocity_sd_mps: float | None
    rejected: int
    stepped: bool
    lasting: bool = False
    closure_ratio: float | None = None
    own_ratio: float | None = None
    water_age_ns: int | None = None
    fault: str = ""
    imu_fault: str = ""
    contradiction: Contradiction | None = None


def judge(facts: Facts, limits: StatesSection) -> tuple[State, str]:
    """The state that these facts alone ask for, and the condition in words."""
    if facts.waiting_for:
        return "INITIALISING", f"waiting for {facts.waiting_for}"
    if facts.fault:
        return "UNSAFE", facts.fault
    navigating = facts.mode == "navigation"
    if navigating and _silent(facts.imu_age_ns, facts.imu_period_ns, limits):
        why = f": the last one was rejected, {facts.imu_fault}" if facts.imu_fault else ""
        return "UNSAFE", f"no inertial readings{_for(facts.imu_age_ns)}{why}"
    if facts.velocity_sd_mps is not None and not facts.velocity_sd_mps <= limits.velocity_sd_mps:
        return "UNSAFE", (
            f"velocity is uncertain by {facts.velocity_sd_mps:.2g} m/s, limit {limits.velocity_sd_mps:g} m/s"
        )
    for words in contradictions(facts.rejected, facts.closure_ratio, facts.own_ratio, limits):
        return "UNSAFE", words
    without_beams: State = "COASTING" if navigating else "UNSAFE"
    if facts.stepped:
        return without_beams, "the clock of a source was set"
    if _silent(facts.ping_age_ns, facts.ping_period_ns, limits):
        why = f"no usable beam{_for(facts.ping_age_ns)}"
        if navigating and not _silent(facts.water_age_ns, facts.ping_period_ns, limits):
            return "WATER", f"{why}: velocity through the water and the last current"
        return without_beams, why
    if facts.rank == 0:
        return without_beams, "the last ping contradicts the estimate"
    if facts.rank < 3:
        return "PARTIAL", f"beams determine {facts.rank} of 3 directions"
    contradiction = contradicts(facts.contradiction, limits, is_lasting=facts.lasting)
    if contradiction is not None:
        return "PARTIAL", contradiction[1]
    return "OK", "beams determine the whole velocity"


def contradictions(
    rejected: int, closure_ratio: float | None, own_ratio: float | None, limits: StatesSection
) -> list[str]:
    """What speaks against the estimate or its beams, a sentence each, the gravest first; empty where they fit.

    Args:
        rejected: pings in a row that the gate rejected.
        closure_ratio, own_ratio: of the last complete pings, against one another and the instrument's own velocity.
        limits: of the states.
    """
    found: tuple[tuple[float | None, str, str], ...] = (
        (closure_ratio, "disagree with one another", "raise dvl.beam_noise_mps, or see whether the geometry is"),
        (
            own_ratio, "differ from the instrument's own velocity",
            "are dvl.geometry and the order of the beams",
        ),
    )  # fmt: skip
    words = [
        f"beams {of} by {ratio:.2g} times their claimed noise: {advice} this instrument's (bottomlock audit)"
        for ratio, of, advice in found
        if ratio is not None and ratio > limits.closure_ratio
    ]
    row = [f"{rejected} pings in a row contradict the estimate"] if rejected >= limits.rejected_pings else []
    return row + words[:1]


def _silent(age_ns: int | None, period_ns: int, limits: StatesSection) -> bool:
    return age_ns is None or age_ns > max(limits.silent_periods * period_ns, ns_from_s(limits.silent_least_s))


def _for(age_ns: int | None) -> str:
    # To a tenth of a second, so that the words do not change with every reading.
    return "" if age_ns is None else f" for {age_ns * 1e-9:.1f} s"


class StateMachine:
    """The state with its hysteresis: the worst that was judged within the last `settle_s`.

    After pings that contradicted the estimate it stays UNSAFE for `agree_s`: what all beams read for seconds may be a
    shoal or a vessel, and the filter follows it once its gate opens. After the mean of pings or another sensor
    contradicted it, it stays PARTIAL as long.

    Attributes:
        state: now.
        why: the condition that asked for it last, in words.
        since_ns: when it was entered; None before the first update.
    """

    def __init__(self, limits: StatesSection) -> None:
        self.limits = limits
        self.state: State = "INITIALISING"
        self.why = "nothing has come yet"
        self.since_ns: int | None = None
        self._last: dict[State, tuple[int, str]] = {}
        self._contradicted: dict[State, tuple[int, str]] = {}

    def update(self, facts: Facts) -> State:
        """Judges the facts, whose times never fall, and returns the state."""
        asked, why = judge(facts, self.limits)
        if asked == "INITIALISING":
            self._last.clear()
            self._contradicted.clear()
            self._enter("INITIALISING", why, facts.now_ns)
            return self.state
        if facts.rejected >= self.limits.rejected_pings:
            self._contradicted["UNSAFE"] = facts.now_ns, "pings"
        contradiction = contradicts(facts.contradiction, self.limits, is_lasting=facts.lasting)
        if contradiction is not None:
            self._contradicted["PARTIAL"] = facts.now_ns, contradiction[0]
        for state, (at_ns, who) in self._contradicted.items():
            is_recent = facts.now_ns - at_ns < ns_from_s(self.limits.agree_s)
            if is_recent and ORDER.index(state) > ORDER.index(asked):
                within = f"within the last {self.limits.agree_s:g} s"
                asked, why = state, f"{who} contradicted the estimate {within}"
        self._last[asked] = facts.now_ns, why
        worst = max(
            (
                state
                for state, (at_ns, _) in self._last.items()
                if state == asked or facts.now_ns - at_ns < ns_from_s(self.limits.settle_s)
            ),
            key=ORDER.index,
        )
        self._enter(worst, self._last[worst][1], facts.now_ns)
        return self.state

    def _enter(self, state: State, why: str, now_ns: int) -> None:
        if state != self.state or self.since_ns is None:
            self.since_ns = now_ns
        self.state, self.why = state, why
