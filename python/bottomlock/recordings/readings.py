"""Readings of instruments one at a time, as they arrive or as a log holds them; SI, times in ns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.errors import KernelError
from bottomlock.recordings.water_cells import CellTable

Triple = tuple[float, float, float]
LOST_SD_MPS = 1.0
"""1 sigma that stands for a lost beam where each has its own: nothing uses it."""
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Ping:
    """A ping of a live DVL.

    Attributes:
        time_ns: instrument's clock: time of validity where the format has it, else of the record.
        transmission_ns: instrument's clock when the report was sent; `time_ns` where the format does not say.
        velocity_mps: (n,) along the beams, towards the bottom positive; NaN where there is none.
        valid: (n,).
        sd_mps: (n,) the instrument's figure of merit of each beam, 1 sigma; NaN where there is none.
        range_m: (n,) along the beam; NaN where there is none.
        instrument_mps: (3,) the instrument's own velocity; NaN where there is none.
        instrument_valid: whether the instrument calls it valid; None without a flag.
        stale: the beams repeat those of the report before; none is valid.
        water: cells of the water, of this ping or measured since the one before; None where there are none.
        instrument_frame: of the instrument's own velocity, "frd" for forward, right, down.
    """

    time_ns: int
    transmission_ns: int
    velocity_mps: NDArray[np.float64]
    valid: NDArray[np.bool_]
    sd_mps: NDArray[np.float64]
    range_m: NDArray[np.float64]
    instrument_mps: NDArray[np.float64]
    instrument_valid: bool | None
    stale: bool = False
    water: CellTable | None = None
    instrument_frame: str = "frd"

    @property
    def own_mps(self) -> NDArray[np.float64]:
        """(3,) the instrument's own velocity, forward, right, down; NaN where none is valid in such axes."""
        is_none = self.instrument_valid is False or self.instrument_frame != "frd"
        return np.full(3, np.nan) if is_none else self.instrument_mps

    @classmethod
    def of_beams(cls, time_ns: int, velocity_mps: ArrayLike, valid: ArrayLike | None = None) -> "Ping":
        """A ping of velocities along the beams (n,), m/s; without `valid` those that are finite are there.

        Raises:
            KernelError: for other shapes.

        >>> Ping.of_beams(0, [0.5, -0.5, float("nan"), 0.0]).valid.tolist()
        [True, True, False, True]
        """
        try:
            velocity = np.asarray(velocity_mps, dtype=np.float64)
            there = np.isfinite(velocity) if valid is None else np.asarray(valid, dtype=np.bool_)
        except (TypeError, ValueError):
            there = velocity = np.empty((0, 0))
        if velocity.ndim != 1 or there.shape != velocity.shape:
            raise KernelError(
                f"velocity_mps is {velocity_mps!r} and valid is {valid!r}"[:200],
                place="Ping.of_beams",
                expected="a number a beam, and as many true or false",
            )
        none = np.full(velocity.shape, np.nan)
        return cls(time_ns, time_ns, velocity, there, none, none, np.full(3, np.nan), None)


@dataclass(frozen=True)
class ImuReading:
    """Angular rate (rad/s) and specific force (m/s²) in the sensor's axes, at a time of its clock."""

    time_ns: int
    omega_radps: Triple
    force_mps2: Triple


@dataclass(frozen=True)
class AttitudeReading:
    """Attitude of the sensor, quaternion, scalar first, to north-east-down, at a time of its clock."""

    time_ns: int
    attitude_t_s: Quaternion


@dataclass(frozen=True)
class DepthReading:
    """Depth, m, at a time of the sensor's clock."""

    time_ns: int
    depth_m: float


@dataclass(frozen=True)
class GpsReading:
    """Position of the antenna, degrees and m, at a time of the receiver's clock."""

    time_ns: int
    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True)
class AcousticPositionReading:
    """Position of the transponder, north, east, down, m, and 1 sigma of each, m, where it is stated."""

    time_ns: int
    position_t_m: Triple
    sd_m: Triple | None


@dataclass(frozen=True)
class ThrustReading:
    """Revolutions of the propeller, 1/s, positive forward."""

    time_ns: int
    revolutions_hz: float


@dataclass(frozen=True)
class EffortReading:
    """Forces of the thrusters along surge, sway and heave, N."""

    time_ns: int
    force_p_n: Triple


@dataclass(frozen=True)
class SpeedReading:
    """Speed through the water along surge, sway and heave that the drives say, m/s; 0 along an axis not driven."""

    time_ns: int
    speed_p_mps: Triple


@dataclass(frozen=True, eq=False)
class WaterReading:
    """Beams that the water returned: (n,) velocities through it, m/s, NaN where lost, 1 sigma; range of the cell, m."""

    time_ns: int
    velocity_mps: NDArray[np.float64]
    valid: NDArray[np.bool_]
    sd_mps: NDArray[np.float64]
    range_m: float


AidingReading = (
    DepthReading | GpsReading | AcousticPositionReading | ThrustReading | EffortReading | WaterReading
)
"""What aids beside pings and attitudes."""
Reading = ImuReading | AttitudeReading | AidingReading
"""What is no ping."""
