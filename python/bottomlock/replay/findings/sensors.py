"""A row a sensor: how many of its readings were used, left out or rejected, their NIS, and its slow error."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bottomlock.recordings.screen import LeftOut

ASSUMED = ("beams", "sway", "heave", "speed", "motion")
"""Beams, which have their own verdict, and what is assumed and not measured."""
SLOW_ERRORS = {
    "depth_bias_m": "depth", "attitude_error_rad": "attitude", "attitude_deviation_rad": "attitude",
    "heading_error_rad": "heading", "heading_deviation_rad": "heading",
}  # fmt: skip
"""Sensors of the kernel's blocks of slow errors that stay what they are; waves and walks of the motion are none."""


@dataclass(frozen=True)
class SensorRow:
    """What a method made of a sensor.

    Attributes:
        method: the method.
        sensor: as the kernel names its updates.
        left_out: rows that were no readings, and readings left out near the vertical.
        measured: readings that reached the filter.
        rejected: those of which the gate rejected every row.
        inflated: how often they, or the mean of all, inflated the covariance.
        nis, degrees: means over the readings.
        slow_error: largest estimate of its slow errors, in sigmas of what the case states; 0 without such states.
    """

    method: str
    sensor: str
    left_out: int
    measured: int
    rejected: int
    inflated: int
    nis: float
    degrees: float
    slow_error: float

    @property
    def rejected_part(self) -> float:
        """Part of the readings that was rejected."""
        return self.rejected / self.measured

    def words(self) -> str:
        """The numbers in one sentence."""
        slow = (
            f"; its slow error is {self.slow_error:.2g} times what the case states" if self.slow_error else ""
        )
        return (
            f"Of {self.measured} readings of {self.sensor.replace('_', ' ')} {100.0 * self.rejected_part:.3g} % are "
            f"rejected, NIS {self.nis:.2g} of {self.degrees:.2g}{slow}."
        )


def sensor_rows(
    methods: Sequence[str], result: Mapping[str, Any], left_out: Sequence[LeftOut] = ()
) -> list[SensorRow]:
    """A row for each method and each sensor that measured.

    Args:
        methods: of the case.
        result: the kernel's, of all of them.
        left_out: rows that are no readings, by their streams.
    """
    found = []
    for method, sensors, slow in zip(methods, result["sensors"], result["slow_errors"], strict=True):
        largest: dict[str, float] = {}
        for block, sigmas in slow.items():
            if (sensor := SLOW_ERRORS.get(block)) is not None:
                largest[sensor] = max(sigmas, largest.get(sensor, 0.0))
        for sensor, seen in sensors.items():
            screened = sum(one.rows for one in left_out if sensor.startswith(one.stream) and not one.used)
            counted = max(seen["measured"] - seen["left_out"], 1)
            found.append(
                SensorRow(
                    method, sensor, screened + seen["left_out"], seen["measured"], seen["rejected"], seen["inflated"],
                    seen["nis"] / counted, seen["degrees"] / counted, largest.get(sensor, 0.0),
                )
            )  # fmt: skip
    return found
