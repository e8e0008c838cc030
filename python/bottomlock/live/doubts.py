"""What speaks against an estimate and its beams: rejected readings, the mean of pings, beams that do not close.

The closure of the last complete pings shows whether the beams agree as well as their noise claims: more than three are
redundant, and the combinations that no velocity causes hold noise alone. A Janus closes whatever its azimuths and its
tilt, so the instrument's own velocity is compared with the beams too.
"""

from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beams import Instrument
from bottomlock.kernel import BeamGeometry, Report
from bottomlock.live.sections import StatesSection
from bottomlock.ports.estimate import State
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.readings import Ping
from bottomlock.recordings.sensors import SENSORS
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


PINGS = 20
"""Complete pings that are judged together."""
OWN_PINGS = 3
"""Those from which on beams are compared with the instrument's own velocity, which has the same noise.

In four recordings of an A50 three pings differ by 2.8 times its packaged noise at most, one by 10.5, `PINGS` by 1.1.
"""
_GAUSSIAN = 0.6745
"""Median of |z| of a standard normal z."""


def _whitened_closure(geometry: BeamGeometry, sd_mps: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, n) combinations of the readings over their claimed noise that no velocity causes, each of variance 1."""
    return closure_rows(geometry.directions_p / sd_mps[:, np.newaxis])


CLOSURE_SD = 3.29
"""Closure of a complete ping over its 1 sigma that noise does not reach: once in 1,000."""


def closes(geometry: BeamGeometry, velocity_mps: NDArray[np.float64], sd_mps: NDArray[np.float64]) -> bool:
    """Whether the beams (n,) of a complete ping agree within their claimed noise; also where none is redundant."""
    closure = _whitened_closure(geometry, sd_mps) @ (velocity_mps / sd_mps)
    return not closure.size or float(np.abs(closure).max()) <= CLOSURE_SD


class Closure:
    """Scatter of the closure, and of the beams about the instrument's own velocity, over what the beams' noise claims.

    Args:
        instrument: the beams, and the mounting of their axes.

    Attributes:
        ratio: of the closure, robust, over the last `PINGS` complete pings; None before there are so many, and with
            three beams. With Gaussian noise as claimed it exceeds 3 once in 400 million sets of pings. A beam that
            drifts is 4 sigma off by then, and the velocity 2: a closer limit would not pass a sound A50, whose closure
            has means of `PINGS` up to 1.9 sigma in turns.
        own_ratio: of the beams less those of the instrument's own velocity, from `OWN_PINGS` on; None where it states
            none.

    Examples:
        >>> from dataclasses import replace
        >>> from bottomlock.io.beams import read_geometry
        >>> a50 = read_geometry("waterlinked_a50")  # claims 4 mm/s
        >>> closure, one = Closure(a50), np.array([0.08, 0.0, 0.0, 0.0])
        >>> pings = [Ping.of_beams(0, sign * one) for sign in [1.0, -1.0] * 10]
        >>> for ping in pings: closure.add(replace(ping, sd_mps=a50.beam_sd_mps))
        >>> round(closure.ratio)
        15
    """

    def __init__(self, instrument: Instrument) -> None:
        self._geometry = instrument.geometry
        # An instrument that knows its mounting states its velocity in the platform's axes, another one in its own.
        mounted = BeamGeometry(np.eye(3), mounting_rpy_rad=instrument.mounting_rpy_rad)
        self._axes = self._geometry.directions_p, self._geometry.directions_p @ mounted.directions_p.T
        self._last: deque[NDArray[np.float64]] = deque(maxlen=PINGS)
        self._own: deque[NDArray[np.float64]] = deque(maxlen=PINGS)
        self.ratio: float | None = None
        self.own_ratio: float | None = None

    def add(self, ping: Ping) -> None:
        """Takes a ping, whose `sd_mps` is the claimed noise of each beam."""
        if not ping.valid.all():
            return
        own_mps = ping.own_mps
        if np.isfinite(own_mps).all():
            apart = [(ping.velocity_mps - axes @ own_mps) / ping.sd_mps for axes in self._axes]
            self._own.append(min(apart, key=lambda one: float(np.abs(one).max())))
            self.own_ratio = _robust(self._own, OWN_PINGS)
        rows = _whitened_closure(self._geometry, ping.sd_mps)
        if rows.size:
            self._last.append(rows @ (ping.velocity_mps / ping.sd_mps))
            self.ratio = _robust(self._last, PINGS)


def _robust(last: Collection[NDArray[np.float64]], least: int) -> float | None:
    return float(np.median(np.abs(list(last))) / _GAUSSIAN) if len(last) >= least else None


BEAM_SENSORS = ("beams", "velocity")
"""The kernel's names of a DVL's measurements in its reports."""
ACCEPTED = ("accepted", "accepted_in_part")
REFERENCES = {"heading", "attitude", "depth", "acoustic_position", "gps_position"}
"""What measures where the vehicle is and how it is turned: where one contradicts the estimate, either is wrong."""
_AIDING = {name for sensor in SENSORS for name in sensor.updates}
"""The kernel's names of all measurements beside the beams."""


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


@dataclass(frozen=True)
class Objection:
    """What speaks against an estimate: the best state with it, a sentence, and who contradicts, "" for no one."""

    state: State
    words: str
    who: str = ""


@dataclass(frozen=True)
class Doubt:
    """What speaks against the estimate at one time.

    Attributes:
        rejected: pings in a row that the gate has rejected.
        lasting: the mean of the pings up to the last one shows an error of the estimate that no gate sees.
        closure_ratio, own_ratio: of the last complete pings, as `Closure` has them.
        longest: rejected readings of another sensor, which may be chance, or be shorter than a state takes to settle.
    """

    rejected: int = 0
    lasting: bool = False
    closure_ratio: float | None = None
    own_ratio: float | None = None
    longest: Contradiction | None = None

    def against(self, limits: StatesSection) -> list[Objection]:
        """What the limits do not allow, the gravest first; empty where all fits."""
        found = []
        if self.rejected >= limits.rejected_pings:
            words = f"{self.rejected} pings in a row contradict the estimate"
            found.append(Objection("UNSAFE", words, "pings"))
        closure, own = (0.0 if ratio is None else ratio for ratio in (self.closure_ratio, self.own_ratio))
        if closure > limits.closure_ratio:
            words = (
                f"beams disagree with one another by {closure:.2g} times their claimed noise: raise "
                "dvl.beam_noise_mps, or see whether the geometry is this instrument's (bottomlock audit)"
            )
            found.append(Objection("UNSAFE", words))
        elif own > limits.closure_ratio:
            words = (
                f"beams differ from the instrument's own velocity by {own:.2g} times their claimed noise: are "
                "dvl.geometry and the order of the beams this instrument's (bottomlock audit)"
            )
            found.append(Objection("UNSAFE", words))
        run = self.longest
        if self.lasting:
            who = "the mean of pings"
            found.append(Objection("PARTIAL", f"{who} contradicts the estimate", who))
        elif run and run.readings >= limits.rejected_pings and run.lasted_ns >= ns_from_s(limits.settle_s):
            found.append(Objection("PARTIAL", str(run), run.words))
        return found


class Doubts:
    """Takes the pings and the navigator's reports, for as long as a process runs.

    Args:
        instrument: the beams, and the mounting of their axes.

    Attributes:
        gated: measurements beside the pings that the gate has rejected, by sensor.
    """

    def __init__(self, instrument: Instrument) -> None:
        self._closure = Closure(instrument)
        self.gated = Reasons()
        self.forget()

    def forget(self) -> None:
        """Of a navigator before."""
        self._runs: dict[str, tuple[int, int, int]] = {}
        self._is_ping_rejected = self._lasting = False
        self._rejected = 0

    def ping(self, ping: Ping) -> None:
        """Takes a ping, whose `sd_mps` is the claimed noise of each beam."""
        self._closure.add(ping)

    def take(self, report: Report) -> None:
        """Counts a report; a revised one is of a measurement that was counted."""
        if report.revised:
            return
        is_rejected = report.verdict == "rejected"
        if report.sensor in BEAM_SENSORS:
            # What is charged after pings that were rejected is theirs.
            self._lasting = report.inflation is not None and not self._is_ping_rejected
            self._is_ping_rejected = is_rejected
            self._rejected = 0 if report.verdict in ACCEPTED else self._rejected + is_rejected
        elif is_rejected and report.sensor in _AIDING:
            self.gated.add(report.sensor)
        if report.sensor not in REFERENCES:
            return
        if is_rejected:
            since_ns, count, _ = self._runs.get(report.sensor, (report.time_ns, 0, 0))
            self._runs[report.sensor] = since_ns, count + 1, report.time_ns
        else:
            self._runs.pop(report.sensor, None)

    @property
    def now(self) -> Doubt:
        """What they say now."""
        runs = [
            Contradiction(sensor, count, last - since) for sensor, (since, count, last) in self._runs.items()
        ]
        longest = max(runs, key=lambda run: run.lasted_ns, default=None)
        return Doubt(self._rejected, self._lasting, self._closure.ratio, self._closure.own_ratio, longest)
