"""Measurement times of each sensor in an observability analysis: at regular rates, or as in a scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock.errors import DataError
from bottomlock.kernel import SENSORS
from bottomlock.recordings.streams import Flags, Times
from bottomlock.simulation.sensor_times import epochs_ns
from bottomlock.support.nearest import did_you_mean


@dataclass(frozen=True, eq=False)
class Schedule:
    """Measurements available at each epoch.

    Attributes:
        time_ns: (e,) rising.
        beams: (e, n) true where a beam returns.
        others: (e,) for each of `SENSORS`: true where it measures.
    """

    time_ns: Times
    beams: Flags
    others: Mapping[str, Flags]

    @classmethod
    def of(
        cls,
        sample_ns: Times,
        *,
        dvl_time_ns: Times,
        beam_valid: Flags,
        others: Mapping[str, Times] | None = None,
    ) -> "Schedule":
        """From the measurement times of each sensor, moved to the first truth sample at or after them.

        Args:
            sample_ns: (s,) times of the truth.
            dvl_time_ns: (p,) pings.
            beam_valid: (p, n) true where a beam returns.
            others: times of the sensors beside the beams; one that is not named never measures.

        Raises:
            DataError: for a sensor that is unknown, times outside the truth, flags of another length.

        Examples:
            >>> schedule = Schedule.of(
            ...     np.arange(0, 5) * 10**9,
            ...     dvl_time_ns=np.array([1, 2, 3]) * 10**9,
            ...     beam_valid=np.array([[True, True], [True, False], [False, False]]),
            ...     others={"depth": np.array([2, 4]) * 10**9},
            ... )
            >>> (schedule.time_ns // 10**9).tolist(), schedule.others["depth"].tolist()
            ([1, 2, 3, 4], [False, True, False, True])
        """
        others = others or {}
        for name in others:
            if name not in SENSORS:
                hint = did_you_mean(name, SENSORS) or ","
                raise DataError(
                    f"there is no sensor '{name}'{hint} expected {', '.join(SENSORS)}", place="schedule"
                )
        if beam_valid.ndim != 2 or len(beam_valid) != len(dvl_time_ns):
            raise DataError(
                f"has shape {beam_valid.shape}",
                place="schedule",
                key="beam_valid",
                expected=f"({len(dvl_time_ns)}, beams)",
            )
        samples = {name: _samples(sample_ns, times, name) for name, times in others.items()}
        pings = _samples(sample_ns, dvl_time_ns, "dvl")
        epochs = np.unique(np.concatenate([pings, *samples.values()]))
        beams = np.zeros((len(epochs), beam_valid.shape[1]), dtype=np.bool_)
        # Pings closer than a truth sample fall on one epoch: a beam returns there if it does in one of them.
        np.logical_or.at(beams, np.searchsorted(epochs, pings), beam_valid)
        flags = {name: np.isin(epochs, samples.get(name, np.empty(0, dtype=np.int64))) for name in SENSORS}
        return cls(time_ns=sample_ns[epochs], beams=beams, others=flags)

    @classmethod
    def regular(cls, sample_ns: Times, beams: int, rates_hz: Mapping[str, float]) -> "Schedule":
        """Every sensor at its own rate from one interval after the first sample on; `rates_hz["beams"]` is the DVL's.

        Raises:
            DataError: for a sensor that is unknown.
        """

        def times(name: str) -> Times:
            return epochs_ns(int(sample_ns[0]), int(sample_ns[-1]), rates_hz[name])

        pings = times("beams") if "beams" in rates_hz else np.empty(0, dtype=np.int64)
        return cls.of(
            sample_ns,
            dvl_time_ns=pings,
            beam_valid=np.ones((len(pings), beams), dtype=np.bool_),
            others={name: times(name) for name in rates_hz if name != "beams"},
        )

    def kernel_dict(self) -> dict[str, Any]:
        """As the kernel takes it."""
        return {"time_ns": self.time_ns, "beams": self.beams, **self.others}


def _samples(sample_ns: Times, times: Times, name: str) -> Times:
    outside = (times < sample_ns[0]) | (times > sample_ns[-1])
    if outside.any():
        raise DataError(
            f"{name} at {int(times[outside][0])} ns is outside the truth",
            place="schedule",
            expected=f"{int(sample_ns[0])} to {int(sample_ns[-1])} ns",
        )
    return np.searchsorted(sample_ns, times)
