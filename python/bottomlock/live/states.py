"""States of live use: what is known now decides, in one table, whether and how far an estimate may be used.

The worst condition counts. A state worsens at once and improves only after `settle_s` without a worse condition: the
state is the worst that held within the last `settle_s`. docs/live.md prints the table.
"""

from dataclasses import dataclass

from bottomlock.live.doubts import Doubt
from bottomlock.live.sections import StatesSection
from bottomlock.ports.estimate import Mode, State
from bottomlock.units import ns_from_s

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
        doubt: what speaks against the estimate.
        stepped: a clock has been set since the facts before.
        fault: why the estimate cannot be used at all; "" if it can.
        water_age_ns: since all directions of the velocity through the water were last measured; None without such.
        imu_fault: why the last inertial reading was rejected; "" if it was not.
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
    doubt: Doubt
    stepped: bool
    water_age_ns: int | None = None
    fault: str = ""
    imu_fault: str = ""


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
    against = facts.doubt.against(limits)
    if against and against[0].state == "UNSAFE":
        return "UNSAFE", against[0].words
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
    if against:
        return against[0].state, against[0].words
    return "OK", "beams determine the whole velocity"


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
        for one in facts.doubt.against(self.limits):
            if one.who:
                self._contradicted[one.state] = facts.now_ns, one.who
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
