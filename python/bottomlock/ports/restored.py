"""Water Linked JSON and Teledyne PD0 with the velocity that the instrument calls invalid: for a receiver of either.

The bytes are those of `bottomlock.encoders`. Both ports need a complete velocity: three axes by the beams, or an
inertial estimate of the rest.
"""

import math
from typing import Any, ClassVar

import numpy as np

from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import encoder
from bottomlock.kernel import BeamGeometry
from bottomlock.kernel.models import Positive
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.over_bound import scalar_bound
from bottomlock.ports.port import Answers, Port, RateHz, incomplete
from bottomlock.ports.ros_dvl import altitude_m

MAX_RATE_HZ = 10.0
"""What readers of a DVL take: the instruments send 4 to 15 reports a second, and a client may read one in 0.1 s."""


class _Restored(Port):
    """Base: the ping of an estimate."""

    format: ClassVar[str]
    limit_key: ClassVar[str]
    """The setting that holds the largest σ that is sent."""
    geometry: BeamGeometry
    """the four beams, in the instrument's order"""
    max_rate_hz: RateHz | None = MAX_RATE_HZ
    """most messages a second; None for every estimate"""

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's
        """Begins with the number of the first report."""
        super().model_post_init(_context)
        self._directions = np.asarray(self.geometry.directions_p)
        self._encoder = encoder(self.format, self.geometry)
        self._limit = getattr(self, self.limit_key)
        commands = self._encoder.format.commands
        self._commands = None if commands is None else commands()
        self._number = 0
        self._since_ns: int | None = None
        """Time of the report before; of the first estimate where there is none."""

    def _refuses(self, estimate: Estimate) -> str | None:
        if reason := incomplete(estimate):
            return reason
        if estimate.beams is not None and len(estimate.beams.velocity_mps) != self.geometry.beams:
            return (
                f"the ping has {len(estimate.beams.velocity_mps)} beams, the geometry {self.geometry.beams}"
            )
        sd = math.sqrt(scalar_bound(estimate.covariance_m2ps2))
        if sd > self._limit:
            return f"σ is {sd:.3f} m/s, above {self.limit_key}, {self._limit}"
        return None

    def _observe(self, estimate: Estimate, *, sent: bool) -> None:
        if sent or self._since_ns is None:
            self._since_ns = estimate.time_ns

    def answers(self) -> Answers | None:
        """The commands of the maker's clients: answered, and without effect on what is sent."""
        return None if self._commands is None else self._commands.client()

    def _beam_velocities(self, estimate: Estimate) -> Floats:
        raise NotImplementedError

    def _message(self, estimate: Estimate) -> bytes:
        beams, time_ns = estimate.beams, estimate.time_ns
        self._number += 1
        ranges = np.full(self.geometry.beams, np.nan) if beams is None else beams.range_m
        altitude = math.nan if beams is None else altitude_m(beams, self._directions)
        sent_ns = time_ns if beams is None else beams.transmission_ns
        since_ns = self._since_ns
        ping = Ping(
            time_ns=time_ns,
            transmission_ns=max(sent_ns, time_ns),
            interval_ns=0 if since_ns is None else time_ns - since_ns,
            number=self._number,
            beam_velocity_mps=self._beam_velocities(estimate),
            range_m=ranges,
            velocity_p_mps=estimate.velocity_p_mps,
            covariance_m2ps2=estimate.covariance_m2ps2,
            fom_mps=math.sqrt(scalar_bound(estimate.covariance_m2ps2)),
            altitude_m=None if math.isnan(altitude) else altitude,
        )
        return self._encoder.encode(ping)


class WaterLinkedJson(_Restored):
    """Water Linked's report with `velocity_valid` true, our velocity, its covariance and its figure of merit.

    The beams are those of the ping: a lost one stays lost. The covariance is whole; a receiver that takes only the
    figure of merit gets the root of its largest eigenvalue. BlueOS' extension takes 0.4 m/s for anything above, so that
    is the limit of what is sent. Times are those of the host. `time` is that since the report before, whatever lies
    between: receivers add up velocity times `time`. The first estimate only begins the first interval.
    """

    name = "waterlinked_json"
    format = "waterlinked-json"
    limit_key = "max_fom_mps"
    max_fom_mps: Positive = 0.4
    """an estimate with a larger σ is not sent"""

    def _waits(self, estimate: Estimate) -> str | None:
        return (
            super()._waits(estimate) if self._since_ns is not None else "no interval yet: the first estimate"
        )

    def _beam_velocities(self, estimate: Estimate) -> Floats:
        lost = np.full(self.geometry.beams, np.nan)
        return lost if estimate.beams is None else estimate.beams.velocity_mps


class Pd0(_Restored):
    """Teledyne's PD0 in beam coordinates, with four beams whichever returned.

    PD0 has no covariance: the receiver uses a σ of its own, and an estimate with a larger σ is not sent. With all
    beams the ping is passed on. With a beam lost, all four are those of our velocity, so that the receiver's solution
    is that velocity; a beam without an echo keeps a range of 0, "none". PD0 cannot mark such a beam.
    """

    name = "pd0"
    format = "pd0"
    limit_key = "receiver_sd_mps"
    receiver_sd_mps: Positive
    """σ per axis that the receiver is set to"""

    def _beam_velocities(self, estimate: Estimate) -> Floats:
        if estimate.beams is not None and bool(estimate.beams.valid.all()):
            return estimate.beams.velocity_mps
        rates = None if estimate.omega_p_radps is None else [estimate.omega_p_radps]
        found: Floats = self.geometry.beam_velocities([estimate.velocity_p_mps], omega_tp_p_radps=rates)
        return np.asarray(found[0])
