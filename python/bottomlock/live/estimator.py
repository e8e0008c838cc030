"""What the engine asks of an estimator, and the estimator of mode velocity: each ping solved by itself.

No filter tests the beams of that mode: a beam is compared with its own reading before, and the beams of a complete ping
with one another. The limits follow from the claimed noise and from the largest acceleration of the vehicle.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry, VelocityFixes, solve_velocity
from bottomlock.live.config import LiveConfig
from bottomlock.live.doubts import Doubts, closes
from bottomlock.ports.estimate import Estimate, State, VelocityMethod
from bottomlock.recordings.readings import Ping, Reading

JUMP_SD = 4.0
"""Difference of two readings over its 1 sigma that noise does not reach: once in 16,000 readings."""
OLDEST_S = 2.0
"""Age of a reading with which none is compared any more."""
REOPENED = 3
"""Readings in a row that jump: the next is taken, since it is the vehicle that has moved."""


class BeamJumps:
    """Beams of each ping that are no outliers.

    One that changes as no vehicle does is left out, and of a complete ping whose beams disagree the one that changed
    most, if beyond its noise. Of a complete ping with more than one, or with none that is known, nothing is used.

    Args:
        geometry: the beams.
        acceleration_mps2: largest acceleration of the vehicle along a beam.

    Attributes:
        why: what was left out of the last ping; "" if nothing was.
    """

    def __init__(self, geometry: BeamGeometry, acceleration_mps2: float) -> None:
        beams = geometry.beams
        self._geometry, self._acceleration = geometry, acceleration_mps2
        self._before_mps, self._before_ns = np.full(beams, np.nan), np.zeros(beams, dtype=np.int64)
        self._jumped = np.zeros(beams, dtype=np.int64)
        self.why = ""

    def kept(
        self,
        time_ns: int,
        velocity_mps: NDArray[np.float64],
        valid: NDArray[np.bool_],
        sd_mps: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Which beams (n,) of a ping with its claimed noise to use; the next ones are compared with their readings."""
        age_s = np.abs(time_ns - self._before_ns) * 1e-9
        known = valid & np.isfinite(self._before_mps) & (age_s <= OLDEST_S)
        change = np.where(known, np.abs(velocity_mps - self._before_mps), 0.0)
        noise = JUMP_SD * math.sqrt(2.0) * sd_mps
        jumped = known & (change > noise + self._acceleration * age_s) & (self._jumped < REOPENED)
        what = "no vehicle changes its velocity so"
        keep: NDArray[np.bool_] = valid & ~jumped
        if keep.all() and not closes(self._geometry, velocity_mps, sd_mps):
            what = "the beams disagree with one another"
            worst = int(np.argmax(change / sd_mps))
            keep[worst if change[worst] > noise[worst] else slice(None)] = False
        elif valid.all() and np.count_nonzero(jumped) > 1:
            keep[:] = False
        left_out = valid & ~keep
        self._jumped = np.where(left_out, self._jumped + 1, np.where(valid, 0, self._jumped))
        self._before_mps = np.where(keep, velocity_mps, self._before_mps)
        self._before_ns = np.where(keep, time_ns, self._before_ns)
        beams = ", ".join(str(beam + 1) for beam in np.flatnonzero(left_out))
        self.why = f"{what}: beam {beams} left out" if beams else ""
        return keep


Floats = NDArray[np.float64]


@dataclass
class LastPing:
    """The last ping: beams, what was used of them, and how well they fitted.

    Attributes:
        velocity_mps: (n,) of valid beams, NaN elsewhere.
        used: (n,) beams that were used.
        verdict: of the gate, or of the solution, in a word.
        why: why something was rejected; "" if nothing was.
        nis: normalised innovation squared over its degrees of freedom; None without one.
    """

    velocity_mps: Floats
    used: NDArray[np.bool_]
    verdict: str = ""
    why: str = ""
    nis: float | None = None


def solve_ping(geometry: BeamGeometry, ping: Ping, method: VelocityMethod) -> VelocityFixes:
    """The velocity of one ping along the directions that its valid beams determine; its noise is `sd_mps`."""
    return solve_velocity(
        geometry,
        ping.velocity_mps[np.newaxis],
        ping.valid[np.newaxis],
        method=method,
        beam_sd_mps=ping.sd_mps,
    )


def on_host_clock(ping: Ping, time_ns: int) -> Ping:
    """The ping for ports that pass beams on: at a time of the host's clock, NaN where a beam or its range is lost."""
    return replace(
        ping,
        time_ns=time_ns,
        transmission_ns=ping.transmission_ns + time_ns - ping.time_ns,
        velocity_mps=np.where(ping.valid, ping.velocity_mps, np.nan),
        range_m=np.where(ping.range_m > 0.0, ping.range_m, np.nan),
    )


class Estimator:
    """Readings in, at times of the host's clock; estimates out.

    Attributes:
        fault: why the estimate cannot be used at all; "" if it can.
        rank: directions that the used beams of the last ping with a valid beam determine.
        doubts: what speaks against the estimate.
        resets: discontinuities that no measurement explains, since the start.
        ping_used_ns: arrival of what made a beam used the last time; None before the first.
        imu_used_ns: the same of inertial readings, or of attitudes in their place.
        water_used_ns: the same of beams of the water that determine the whole velocity through it.
        last: what is known of the last ping, for the health page.
    """

    def __init__(self, config: LiveConfig) -> None:
        self._config, self._instrument = config, config.instrument()
        self._fixes: VelocityFixes | None = None
        self._beams: Ping | None = None
        self.fault = ""
        self.rank = self.resets = 0
        self.ping_used_ns: int | None = None
        self.imu_used_ns: int | None = None
        self.water_used_ns: int | None = None
        beams = self._instrument.geometry.beams
        self.last = LastPing(np.full(beams, np.nan), np.zeros(beams, dtype=bool))
        self.doubts = Doubts(self._instrument)

    @property
    def imu_fault(self) -> str:
        """Why the last inertial reading was rejected; "" if it was not."""
        return ""

    @property
    def waiting_for(self) -> str:
        """What the start still lacks; "" once there is an estimate."""
        raise NotImplementedError

    @property
    def velocity_sd_mps(self) -> float | None:
        """Largest 1 sigma of a velocity axis, m/s; None where the beams alone give the velocity."""
        return None

    @property
    def time_ns(self) -> int | None:
        """Time of the estimate; None without one."""
        raise NotImplementedError

    def known(self) -> dict[str, Any]:
        """What a status has of the attitude reference and of the water, as `health.status`."""
        return {"reference": {}, "water": None}

    def take(self, time_ns: int, reading: Ping | Reading, arrival_ns: int) -> None:
        """Takes a ping or a reading of a time of validity, and when it came; mode velocity uses pings alone.

        Raises:
            KernelError: as `NavigatorConfig.with_noise`, and of a navigator as `AlignedNavigator.push`.
        """
        raise NotImplementedError

    def estimate(self, state: State, reset_counter: int) -> Estimate | None:
        """The estimate as it is now; None without one."""
        raise NotImplementedError


class VelocityEstimator(Estimator):
    """Mode velocity: what the beams of the last ping determine, and nothing else."""

    def __init__(self, config: LiveConfig) -> None:
        super().__init__(config)
        self._jumps = BeamJumps(self._instrument.geometry, config.velocity.acceleration_mps2)
        self._time_ns: int | None = None
        self._whole = False

    @property
    def waiting_for(self) -> str:
        """A first ping that gives all of the velocity."""
        why = f", {self._jumps.why}" if self._jumps.why else ""
        return "" if self._whole else f"a ping that determines the whole velocity{why}"

    @property
    def time_ns(self) -> int | None:
        """Time of the last ping."""
        return self._time_ns

    def take(self, time_ns: int, reading: Ping | Reading, arrival_ns: int) -> None:
        """Solves a ping."""
        if not isinstance(reading, Ping):
            return
        ping = self._config.with_noise(reading, self._instrument)
        self.doubts.ping(ping)
        velocity_mps = np.where(ping.valid, ping.velocity_mps, np.nan)
        kept = self._jumps.kept(time_ns, ping.velocity_mps, ping.valid, ping.sd_mps)
        ping = replace(ping, valid=kept)
        fixes = solve_ping(self._instrument.geometry, ping, self._config.velocity.method)
        rank = int(fixes.rank[0])
        verdict = f"determines {rank} of 3 directions"
        self.last = LastPing(velocity_mps, fixes.beams_used[0], verdict, self._jumps.why)
        self._fixes = fixes
        self._beams = on_host_clock(ping, time_ns)
        self._time_ns = time_ns
        self._whole |= rank == 3
        if rank:
            self.rank, self.ping_used_ns = rank, arrival_ns

    def estimate(self, state: State, reset_counter: int) -> Estimate | None:
        """What the last ping determines; None if that is nothing."""
        if self._fixes is None or self._time_ns is None or not int(self._fixes.rank[0]):
            return None
        return Estimate.from_fix(
            self._time_ns, self._fixes, state=state, reset_counter=reset_counter, beams=self._beams
        )
