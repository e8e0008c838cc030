"""What a path is like, in figures and in words."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bottomlock.truth.path_check import Peak

_DEG = float(np.rad2deg(1.0))


@dataclass(frozen=True)
class PathSummary:
    """A path at the IMU's rate.

    Attributes:
        place: the file.
        columns: what was read.
        rows: their number.
        duration_s: of what is flown.
        length_m: along the path.
        speed_mps: least, mean, greatest.
        depth_m: least and greatest.
        attitude: where it comes from.
        peaks: greatest "speed" (m/s), "acceleration" (m/s²), "jerk" (m/s³) and "turn rate" (rad/s).
    """

    place: str
    columns: tuple[str, ...]
    rows: int
    duration_s: float
    length_m: float
    speed_mps: tuple[float, float, float]
    depth_m: tuple[float, float]
    attitude: str
    peaks: Mapping[str, Peak]

    def lines(self) -> list[str]:
        """The summary as text."""
        low, mean, high = self.speed_mps

        def at(name: str, unit: str, scale: float = 1.0) -> str:
            peak = self.peaks[name]
            return f"{name} {peak.value * scale:.3g} {unit} (row {peak.row}, {peak.time_s:.1f} s)"

        extent = (
            f"{self.duration_s:.1f} s, {self.length_m:.1f} m, {low:.2f} to {high:.2f} m/s (mean {mean:.2f})"
        )
        return [
            f"{self.place}: {self.rows} rows of {', '.join(self.columns)}",
            f"{extent}, depth {self.depth_m[0]:.1f} to {self.depth_m[1]:.1f} m",
            f"attitude: {self.attitude}",
            f"greatest {at('acceleration', 'm/s²')}, {at('jerk', 'm/s³')}, {at('turn rate', 'deg/s', _DEG)}",
        ]
