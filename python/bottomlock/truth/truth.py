"""A true motion at the IMU's rate: what the sensors of a simulation are drawn from."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """A true motion at the IMU's rate: values at the sample times, not means between them.

    Attributes:
        time_ns: (n,) int64, rising.
        position_t_m: (n, 3) tangent frame (north, east, down).
        attitude_t_p: (n, 4) unit quaternions, scalar first, platform to tangent.
        velocity_p_mps: (n, 3) velocity over ground, platform frame (forward, right, down).
        omega_p_radps: (n, 3) inertial angular rate: what a perfect gyro reads.
        force_p_mps2: (n, 3) specific force: what a perfect accelerometer reads.
        latitude_rad: geodetic latitude that the Earth rate belongs to.
        gravity_mps2: gravity that the specific force belongs to.
    """

    time_ns: NDArray[np.int64]
    position_t_m: Array
    attitude_t_p: Array
    velocity_p_mps: Array
    omega_p_radps: Array
    force_p_mps2: Array
    latitude_rad: float
    gravity_mps2: float

    def __post_init__(self) -> None:
        count = len(self.time_ns)
        if self.time_ns.dtype != np.int64 or self.time_ns.ndim != 1 or count < 2:
            raise DataError("truth time_ns must be a one-dimensional int64 array of at least 2 samples")
        steps = np.flatnonzero(np.diff(self.time_ns) <= 0)
        if steps.size:
            raise DataError(f"truth time_ns does not increase at row {steps[0] + 1}")
        for name, width in (
            ("position_t_m", 3), ("attitude_t_p", 4), ("velocity_p_mps", 3), ("omega_p_radps", 3), ("force_p_mps2", 3),
        ):  # fmt: skip
            values = getattr(self, name)
            if values.shape != (count, width):
                raise DataError(f"truth {name} has shape {values.shape}", expected=f"({count}, {width})")
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if bad.size:
                raise DataError(f"truth {name} is not finite at row {bad[0]}")
        norms = np.linalg.norm(self.attitude_t_p, axis=1)
        bad = np.flatnonzero(np.abs(norms - 1.0) > 1e-6)
        if bad.size:
            raise DataError(
                f"truth attitude_t_p has norm {norms[bad[0]]:.6g} at row {bad[0]}",
                expected="1 (scalar first)",
            )

    def kernel_arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays as the kernel takes them, contiguous and aligned; those of another process may be neither."""
        names = ("time_ns", "position_t_m", "attitude_t_p", "velocity_p_mps", "omega_p_radps", "force_p_mps2")
        return {name: np.require(getattr(self, name), requirements=["C", "A"]) for name in names}


def sample_times_ns(duration_s: float, rate_hz: float) -> NDArray[np.int64]:
    """Sample times from 0 to the duration, rounded to nanoseconds without drift."""
    count = math.floor(duration_s * rate_hz + 1e-9) + 1
    return np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)
