"""The beam-level EKF with process noise from its own innovations.

Sources: R. K. Mehra, "On the Identification of Variances and Adaptive Kalman Filtering", IEEE Trans. Automatic
Control 15 (1970) 175; the form, A. H. Mohamed and K. P. Schwarz, "Adaptive Kalman Filtering for INS/GPS", J. Geodesy
73 (1999) 193: over a window of N updates Q̂ = K Ĉ Kᵀ, with Ĉ the mean of the innovations' products, which is the mean
of the products of the corrections. So the number of rows may change from update to update, as it does with beams.

Q̂ is the noise between two updates, here by pings. It takes the place of the model's noise of the inertial states,
spread evenly over the time between pings; the noise of the states of DVL and depth sensor stays the model's.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.state import INERTIAL
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]

WINDOW = 30
"""Updates in the window, half a minute of pings; our choice, made before the first run."""


class WindowedNoise:
    """Q̂ = K Ĉ Kᵀ over the last updates; None until the window is full."""

    def __init__(self, window: int) -> None:
        self.window = window
        self.corrections: deque[Floats] = deque(maxlen=window)
        self.mean: Floats | None = None

    def take(self, correction: Floats) -> None:
        """Another correction K ν (n,)."""
        self.corrections.append(correction)
        if len(self.corrections) == self.window:
            corrections = np.array(self.corrections)
            self.mean = corrections.T @ corrections / self.window

    def estimate(self) -> Floats | None:
        """The mean of their products (n, n), of one interval between updates."""
        return self.mean


class AdaptiveFilter(ErrorStateFilter):
    """The beam-level EKF whose process noise is that of a window of its corrections."""

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission)
        self.window = WindowedNoise(WINDOW)
        steps_s = np.diff(mission.pings.time_ns) * 1e-9
        self.ping_interval_s = float(np.median(steps_s)) if len(steps_s) else 1.0

    def process_noise(self, phi: Floats, duration_s: float) -> Floats:
        """The model's until the window is full."""
        q = super().process_noise(phi, duration_s)
        adapted = self.window.estimate()
        if adapted is not None:
            q[:INERTIAL, :INERTIAL] = adapted[:INERTIAL, :INERTIAL] * (duration_s / self.ping_interval_s)
        return q

    def correct(self, kind: str, correction: Floats) -> None:
        """The corrections by pings are kept."""
        if kind == "ping":
            self.window.take(correction)
        super().correct(kind, correction)


def estimate(mission: Mission) -> Estimates:
    """With a window of `WINDOW` pings."""
    return run(AdaptiveFilter(mission), mission)
