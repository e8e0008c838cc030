"""The streams of a recording in SI, on one clock, in platform and tangent axes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bottomlock.geodesy import Place
from bottomlock.io.beams import Instrument
from bottomlock.kernel.models import Motion
from bottomlock.recordings.screen import LeftOut
from bottomlock.recordings.streams import (
    Attitudes,
    Beams,
    Depths,
    Floats,
    Inertial,
    Positions,
    ReferenceStates,
    WaterBeams,
)
from bottomlock.recordings.water_cells import CellCounts
from bottomlock.replay.clock import ClockReport


@dataclass(frozen=True, eq=False)
class VehicleMotion:
    """The velocity along the platform's axes as a mean, a first-order fluctuation and white noise; (3,) each.

    Attributes:
        fluctuation_sd_mps: of the fluctuation, 1 sigma, m/s.
        fluctuation_time_s: its correlation time, s.
        white_sd_mps: of one ping, 1 sigma, m/s: noise of the DVL, and what changes from ping to ping.
        mean_mps: mean over the recording, m/s.
        pings: number of complete pings.
    """

    fluctuation_sd_mps: Floats
    fluctuation_time_s: Floats
    white_sd_mps: Floats
    mean_mps: Floats
    pings: int

    @property
    def prior(self) -> Motion:
        """What a filter is told of the velocity: a mean of the size of the speed, and the fluctuation about it.

        The mean of each axis may be as large as the speed: a mean that was seen to be small, told as such, would be the
        pings once more, and correct the biases of the DVL by them.
        """
        speed = float(np.sqrt((self.mean_mps**2 + self.fluctuation_sd_mps**2).sum()))
        return Motion(
            mean_sd_mps=(speed, speed, speed),
            change_sd_mps=tuple(self.fluctuation_sd_mps.tolist()),
            change_time_s=tuple(self.fluctuation_time_s.tolist()),
        )

    @property
    def accel_noise_mps_per_rt_s(self) -> float:
        """White noise of the accelerations, m/s/√s, the greater of the horizontal axes' (RMS) and the vertical one's.

        A first-order process of sigma σ and time τ departs from its value like a random walk of the density √(2σ²/τ).
        """
        square = 2.0 * self.fluctuation_sd_mps**2 / self.fluctuation_time_s
        return float(np.sqrt(max(square[:2].mean(), square[2])))


@dataclass(frozen=True, eq=False)
class Streams:
    """All streams of a case.

    Attributes:
        inertial: IMU readings.
        beams: pings.
        instrument: geometry and noise of the DVL.
        aiding: the streams of the sensors that aid, by their sections (`recordings.sensors`).
        reference: what errors are computed against, None where absent.
        origin: of the tangent frame, or None where it is not known.
        latitude_rad: for gravity and the Earth's rate.
        vehicle_motion: how the velocity changes, measured where there are no inertial readings; else None.
        water_counts: what became of the cells of the water; None where there are none.
        clocks: statistics and faults of each stream's times.
        left_out: rows of the aiding streams that are no readings.
        notes: what was changed or assumed while reading, a sentence each.
    """

    inertial: Inertial
    beams: Beams
    instrument: Instrument
    aiding: Mapping[str, Any]
    reference: ReferenceStates | None
    origin: Place | None
    latitude_rad: float
    vehicle_motion: VehicleMotion | None = None
    water_counts: CellCounts | None = None
    clocks: dict[str, ClockReport] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def through_water(self) -> tuple[str, ...]:
        """The kernel's sensors of the motion through the water, with which every filter has the current as states."""
        sensors = {"water_track": "water_track", "thrust": "thrust", "effort": "thrust"}
        return tuple(sensor for section, sensor in sensors.items() if section in self.aiding)

    @property
    def depths(self) -> Depths | None:
        """Of [depth]."""
        return self.aiding.get("depth")

    @property
    def attitudes(self) -> Attitudes | None:
        """Of [attitude]."""
        return self.aiding.get("attitude")

    @property
    def gps(self) -> Positions | None:
        """Of [gps]."""
        return self.aiding.get("gps")

    @property
    def water(self) -> WaterBeams | None:
        """Of [water_track]."""
        return self.aiding.get("water_track")
