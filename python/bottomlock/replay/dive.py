"""A recording in SI: every stream of a case on one clock, in platform and tangent axes, with what was found in it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.io.beams import Instrument
from bottomlock.replay.clock import ClockReport
from bottomlock.replay.geodesy import Place

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Inertial:
    """Specific force and inertial rate, platform axes, (n,) and (n, 3)."""

    time_ns: Times
    force_p_mps2: Floats
    omega_p_radps: Floats


@dataclass(frozen=True, eq=False)
class Beams:
    """Pings (n,), beam velocities (n, B) with NaN where there is none, validity and noise (n, B).

    `velocity_d_mps` (n, 3) is the instrument's velocity that the beams were projected from; None for recorded beams.
    """

    time_ns: Times
    velocity_mps: Floats
    valid: Flags
    sd_mps: Floats
    velocity_d_mps: Floats | None = None


@dataclass(frozen=True, eq=False)
class Depths:
    """Depth below the tangent plane's origin, m, (n,)."""

    time_ns: Times
    depth_m: Floats


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Attitudes of the platform, (n,)."""

    time_ns: Times
    attitude: Rotation


@dataclass(frozen=True, eq=False)
class Fields:
    """Magnetic field in platform axes, (n, 3)."""

    time_ns: Times
    field_p: Floats


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions of the GPS antenna in the tangent frame, (n, 3)."""

    time_ns: Times
    position_t_m: Floats


@dataclass(frozen=True, eq=False)
class Truthlike:
    """What errors are measured against, at the IMU: position, velocity and attitude, each None where it has none."""

    time_ns: Times
    position_t_m: Floats | None
    velocity_p_mps: Floats | None
    attitude: Rotation | None


@dataclass(frozen=True, eq=False)
class Dive:
    """Everything that a case reads.

    Attributes:
        inertial: readings at the IMU's own times.
        beams: pings.
        instrument: geometry and noise of the DVL.
        depths, attitudes, fields, positions, reference: what there is beside them.
        origin: where the tangent plane touches, or None where nothing says.
        latitude_rad: for gravity and the Earth's rate.
        clocks: what was found of the times of each stream.
        notes: what was changed or assumed while reading, in words.
    """

    inertial: Inertial
    beams: Beams
    instrument: Instrument
    depths: Depths | None
    attitudes: Attitudes | None
    fields: Fields | None
    positions: Positions | None
    reference: Truthlike | None
    origin: Place | None
    latitude_rad: float
    clocks: dict[str, ClockReport] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
