"""One ping of a DVL, and what is known of the instrument beside it, as every encoder takes them."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Ping:
    """One ping: its times, its beams, and the instrument's own velocity where it states one.

    Beams are in the instrument's order, and positive when the vehicle moves along the beam: y = b . v.

    Attributes:
        time_ns: time of validity, when the ping was reflected by the bottom; ns on the instrument's clock.
        transmission_ns: when its record is sent, ns on the same clock, not before `time_ns`.
        trigger_ns: when the ping left the transducer, ns on the same clock; None for `time_ns`.
        interval_ns: since the ping before; 0 for the first.
        number: counts the pings of an instrument, from 1.
        beam_velocity_mps: (n,); NaN where the beam is lost.
        range_m: (n,) along the beam; NaN where there is none.
        velocity_p_mps: (3,) forward, right, down; None where the instrument calls its velocity invalid.
        covariance_m2ps2: (3, 3) of that velocity; None with it.
        fom_mps: the instrument's figure of merit of that velocity; None for the root of the covariance's largest
            eigenvalue, as Water Linked's documented example has it.
        beam_sd_mps: the figure of merit of each beam, 1 sigma, for the formats that state it.
        altitude_m: distance to the bottom along the instrument's vertical; None where unknown.
        attitude_rad: (3,) roll, pitch, yaw, for the formats that state them; None writes zeros.
        sound_speed_mps: as set in the instrument.
        water_velocity_mps: (n,) what the water returned in a cell; NaN where the beam is lost, None without water.
        water_range_m: along the beams to the middle of that cell.
        water_sd_mps: its figure of merit of each beam, 1 sigma, for the formats that state it.

    Raises:
        DataError: for shapes that do not fit, a time out of order, an infinite beam, a negative range, or a velocity
            without covariance.
    """

    time_ns: int
    transmission_ns: int
    interval_ns: int
    number: int
    beam_velocity_mps: Floats
    range_m: Floats
    trigger_ns: int | None = None
    velocity_p_mps: Floats | None = None
    covariance_m2ps2: Floats | None = None
    fom_mps: float | None = None
    beam_sd_mps: float = 0.01
    altitude_m: float | None = None
    attitude_rad: Floats | None = None
    sound_speed_mps: float = 1500.0
    water_velocity_mps: Floats | None = None
    water_range_m: float = 0.0
    water_sd_mps: float = 0.05

    def __post_init__(self) -> None:
        n, water = len(self.beam_velocity_mps), self.water_velocity_mps
        ranges = np.asarray(self.range_m)
        water = np.full(n, np.nan) if water is None else np.asarray(water)
        shapes = {
            "range_m": (ranges, (n,)),
            "water_velocity_mps": (water, (n,)),
            "velocity_p_mps": (self.velocity_p_mps, (3,)),
            "covariance_m2ps2": (self.covariance_m2ps2, (3, 3)),
        }
        for key, (values, shape) in shapes.items():
            if values is not None and np.shape(values) != shape:
                raise self.fault(f"has shape {np.shape(values)}", key=key, expected=shape)
        if self.transmission_ns < self.time_ns or self.sent_ns > self.time_ns:
            raise self.fault(
                f"trigger_ns {self.sent_ns}, time_ns and transmission_ns {self.transmission_ns} are out of order",
                expected="trigger, reflection, transmission",
            )
        if self.interval_ns < 0 or self.number < 1:
            raise self.fault(
                f"is {self.interval_ns}", key="interval_ns", expected="0 or more, and number from 1 on"
            )
        if not 0.0 <= self.water_range_m < np.inf:
            raise self.fault(f"is {self.water_range_m}", key="water_range_m", expected="0 m or more")
        beams = np.concatenate([self.beam_velocity_mps, water, ranges])
        if np.isinf(beams).any() or (ranges < 0.0).any():
            raise self.fault("a beam is infinite or its range negative", expected="NaN for a lost beam")
        if (self.velocity_p_mps is None) != (self.covariance_m2ps2 is None):
            raise self.fault("a velocity and its covariance come together, got one without the other")
        known = [one for one in (self.velocity_p_mps, self.covariance_m2ps2) if one is not None]
        if not all(np.isfinite(one).all() for one in known):
            raise self.fault(
                "velocity or covariance is not finite", hint="None stands for an invalid velocity"
            )

    def fault(self, what: str, **details: Any) -> DataError:  # noqa: ANN401 - of `DataError`
        """The error of a number of this ping."""
        return DataError(what, place=f"ping {self.number} at {self.time_ns} ns", **details)

    @property
    def of_water(self) -> "Ping | None":
        """The ping with the water in place of the bottom, without a velocity over ground; None without water."""
        if self.water_velocity_mps is None:
            return None
        return replace(
            self,
            beam_velocity_mps=self.water_velocity_mps,
            range_m=np.where(np.isfinite(self.water_velocity_mps), self.water_range_m, np.nan),
            velocity_p_mps=None,
            covariance_m2ps2=None,
            fom_mps=None,
            altitude_m=None,
            beam_sd_mps=self.water_sd_mps,
            water_velocity_mps=None,
        )

    @property
    def of_water_alone(self) -> "Ping | None":
        """`of_water` where no beam has the bottom, for an instrument that reports one or the other; else None."""
        return None if self.valid.any() else self.of_water

    @property
    def beams(self) -> int:
        """Number of beams."""
        return len(self.beam_velocity_mps)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(n,) the beams that returned."""
        return np.isfinite(self.beam_velocity_mps)

    @property
    def sent_ns(self) -> int:
        """When the ping left the transducer."""
        return self.time_ns if self.trigger_ns is None else self.trigger_ns

    @property
    def figure_mps(self) -> float | None:
        """Figure of merit of the velocity; None where there is no velocity."""
        if self.covariance_m2ps2 is None:
            return None
        if self.fom_mps is not None:
            return self.fom_mps
        return math.sqrt(max(float(np.linalg.eigvalsh(self.covariance_m2ps2)[-1]), 0.0))


@dataclass(frozen=True)
class Instrument:
    """The instrument whose records are written.

    Attributes:
        tilt_rad: mean tilt of its beams from the vertical.
        start_ns: when it was switched on, for the formats whose clock counts from there; ns on the pings' clock.
    """

    tilt_rad: float
    start_ns: int = 0
