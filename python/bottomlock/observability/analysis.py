"""Observability of a motion with given beams and sensors: rank, unobservable directions, predicted deviations.

The stacked rows H(t_k) Phi(t_k, t_0) over the window of a truth are judged by their singular values (Klein & Diamant
2015, Eqs 1-3); the covariance analysis gives the filter's own standard deviations.

Examples:
    Level flight on one heading leaves tilt and accelerometer bias mixed, and heading unknown; beams 1 and 2 alone
    leave the sway unobservable as well:

    >>> from bottomlock.simulation.manoeuvres import MANOEUVRES, manoeuvre_truth
    >>> from bottomlock.kernel import BeamGeometry
    >>> truth, janus = manoeuvre_truth(MANOEUVRES["straight"], rate_hz=50.0), BeamGeometry.janus(0.35)
    >>> whole, half = observe(
    ...     truth, janus, [Aiding(beams=(1, 2, 3, 4)), Aiding(beams=(1, 2))], kind="inertial", earth_rate_radps=0.0
    ... )
    >>> whole.rank, half.rank
    (8, 6)
    >>> whole.unobservable[3]
    'tilt north + g·accel bias y'
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.errors import DataError
from bottomlock.kernel import SENSORS
from bottomlock.kernel.models import Environment, Model
from bottomlock.recordings.streams import Flags, Times
from bottomlock.simulation.measurement_schedule import epochs_ns
from bottomlock.text import did_you_mean
from bottomlock.truth import Array, Truth
from bottomlock.units import ns_from_s


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


Kind = Literal["full", "inertial", "paper", "paper_printed"]
"""The filter's 20 states, its first 15, or the 2015 model with the consistent or the printed sign of H."""


@dataclass(frozen=True)
class Aiding:
    """A set of aiding sensors; beams are numbered from 1, lever arms lie in the platform frame (m).

    Speeds through the water are left out: they are relative to a current, which is no state of these models.

    Examples:
        >>> Aiding(beams=(1, 2), depth=True).name
        'beams 12 + depth'
    """

    beams: tuple[int, ...] = ()
    velocity: bool = False
    depth: bool = False
    attitude: bool = False
    heading: bool = False
    gps_position: bool = False
    gps_velocity: bool = False
    acoustic_position: bool = False
    depth_lever_p_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gps_lever_p_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    acoustic_position_lever_p_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def mask(self) -> str:
        """The beams as a word: "12" for beams 1 and 2, "-" for none."""
        return "".join(str(beam) for beam in self.beams) or "-"

    @property
    def name(self) -> str:
        """The sensors in words."""
        others = [name for name in _FLAGS if getattr(self, name)]
        words = [f"beams {self.mask}"] if self.beams else []
        return " + ".join(words + [other.replace("_", " ") for other in others]) or "nothing"

    def kernel_dict(self, beams: int) -> dict[str, Any]:
        """As the kernel takes it, for an instrument of `beams` beams.

        Raises:
            DataError: for a beam that the instrument lacks or one that is named twice.
        """
        for beam in self.beams:
            if not 1 <= beam <= beams:
                raise DataError(f"there is no beam {beam}", place="aiding", expected=f"1 to {beams}")
        if len(set(self.beams)) != len(self.beams):
            raise DataError(f"a beam is named twice in {self.beams}", place="aiding")
        flags = {name: getattr(self, name) for name in _FLAGS}
        levers = {
            "depth_p_m": self.depth_lever_p_m,
            "gps_p_m": self.gps_lever_p_m,
            "acoustic_position_p_m": self.acoustic_position_lever_p_m,
        }
        return flags | {"beams": np.isin(np.arange(beams) + 1, self.beams), "levers": levers}

    @classmethod
    def scheduled(cls, schedule: Schedule) -> "Aiding":
        """Every beam and sensor with at least one measurement in a schedule."""
        beams = tuple(int(beam) + 1 for beam in np.flatnonzero(schedule.beams.any(axis=0)))
        flags: dict[str, Any] = {name: bool(schedule.others[name].any()) for name in _FLAGS}
        return cls(beams=beams, **flags)


_FLAGS = tuple(field.name for field in fields(Aiding) if field.default is False)
"""The sensors beside the beams."""


@dataclass(frozen=True, eq=False)
class Finding:
    """Result of the analysis of a window.

    Attributes:
        states: names of the n states.
        rank: number of singular values above the noise floor.
        decided: true where the gap is at least 1000 and no smaller than any ratio between neighbours among the kept
            ones, and no dropped value stands out of rounding.
        gap: smallest kept over largest dropped singular value (or what rounding can make of a zero).
        singular_values: (n,) of the stack with rows and columns scaled, falling.
        basis: (n - rank, n) unobservable directions in SI, reduced row echelon form.
        pivots: (n - rank,) the state with coefficient 1 in each direction.
        unobservable_fraction: (n,) unobservable fraction of each scaled state: 0 for an observable state.
        scales: (n,) scale of each state.
        gramian: (n, n) Eq. 1 of Klein & Diamant 2015, SI, by the trapezoidal rule.
        rows: (m, n) the stack in SI.
        time_ns: (e,) epochs.
        gravity_mps2: gravity, which names the coefficients.
    """

    states: tuple[str, ...]
    rank: int
    decided: bool
    gap: float
    singular_values: Array
    basis: Array
    pivots: NDArray[np.int64]
    unobservable_fraction: Array
    scales: Array
    gramian: Array
    rows: Array
    time_ns: NDArray[np.int64]
    gravity_mps2: float

    @property
    def unobservable(self) -> tuple[str, ...]:
        """The unobservable directions in words; coefficients in SI, entries below 1e-6 of the largest left out."""
        return tuple(
            describe(row, self.states, self.scales, self.gravity_mps2, pivot=int(pivot))
            for row, pivot in zip(self.basis, self.pivots, strict=True)
        )

    @property
    def observable_states(self) -> tuple[str, ...]:
        """States that are observable by themselves."""
        return tuple(
            name for name, part in zip(self.states, self.unobservable_fraction, strict=True) if part < 1e-6
        )


def describe(
    row: Array, states: Sequence[str], scales: Array, gravity_mps2: float, *, pivot: int | None = None
) -> str:
    """A direction in the state space in words, the pivot first; a coefficient of gravity is written g.

    Examples:
        >>> describe(np.array([-9.8, 1.0]), ["accel bias y", "tilt north"], np.ones(2), 9.8, pivot=1)
        'tilt north - g·accel bias y'
    """
    sizes = np.abs(row / scales)
    kept = [k for k in range(len(row)) if sizes[k] > 1e-6 * sizes.max()]
    kept.sort(key=lambda k: (k != pivot, k))
    words = ""
    for k in kept:
        size = abs(float(row[k]))
        if math.isclose(size, 1.0, rel_tol=1e-6):
            factor = ""
        elif math.isclose(size, gravity_mps2, rel_tol=1e-6):
            factor = "g·"
        else:
            factor = f"{size:.4g}·"
        sign = "-" if row[k] < 0.0 else "+"
        words += f" {sign} {factor}{states[k]}"
    return words.removeprefix(" + ").strip()


def _model(truth: Truth, earth_rate_radps: float) -> Model:
    """A model with the truth's environment; the deviations of the packaged scenario do not matter for a rank."""
    environment = Environment(
        latitude_rad=truth.latitude_rad, gravity_mps2=truth.gravity_mps2, earth_rate_radps=earth_rate_radps
    )
    return load_scenario("straight").kernel_model(truth.gravity_mps2).replace(environment=environment)


def observe(
    truth: Truth,
    geometry: kernel.BeamGeometry,
    aidings: Sequence[Aiding],
    *,
    kind: Kind = "full",
    earth_rate_radps: float = kernel.EARTH_RATE_RADPS,
    period_s: float = 1.0,
    schedule: Schedule | None = None,
    scale: ArrayLike | None = None,
) -> list[Finding]:
    """Judges the window of a truth for each of several aiding sets (Klein & Diamant 2015, Eqs 1-3).

    Args:
        truth: any truth; the window is all of it.
        geometry: the beams.
        aidings: sets of sensors.
        kind: the model; the 2015 model takes velocity and depth alone, without Earth rate.
        earth_rate_radps: Earth rate that the truth was made with; 0 for an Earth at rest.
        period_s: interval between measurements.
        schedule: measurement times in place of the period; a sensor is used where it is in the set and scheduled.
        scale: (n,) factors on the natural scales of the states, as other units would have them, before columns are
            brought to one length; the rank does not depend on them.

    Raises:
        KernelError: for an empty aiding set, a window of one epoch, a motion that is not finite.
        DataError: for a beam that the instrument lacks.
    """
    results: list[Any] = kernel.observe(
        geometry,
        truth.kernel_arrays(),
        _model(truth, earth_rate_radps),
        [aiding.kernel_dict(geometry.beams) for aiding in aidings],
        kind=kind,
        period_ns=ns_from_s(period_s),
        schedule=None if schedule is None else schedule.kernel_dict(),
        scale=scale,
    )
    names = [one.name for one in fields(Finding) if one.name not in {"states", "time_ns", "gravity_mps2"}]
    return [
        Finding(
            states=tuple(found["states"]),
            time_ns=found["epoch_time_ns"],
            gravity_mps2=truth.gravity_mps2,
            **{name: found[name] for name in names},
        )
        for found in results
    ]


@dataclass(frozen=True, eq=False)
class Deviations:
    """A filter's predicted covariance along a truth.

    Attributes:
        states: names of the n states.
        time_ns: (e,) epochs.
        covariance: (e, n, n) after the update of each epoch, SI.
    """

    states: tuple[str, ...]
    time_ns: NDArray[np.int64]
    covariance: Array

    @property
    def sd(self) -> Array:
        """(e, n) standard deviations."""
        variances: Array = np.diagonal(self.covariance, axis1=1, axis2=2).clip(min=0.0)
        return np.asarray(np.sqrt(variances))


def deviations(
    truth: Truth,
    geometry: kernel.BeamGeometry,
    aiding: Aiding,
    model: Model,
    *,
    kind: Kind = "full",
    period_s: float = 1.0,
    schedule: Schedule | None = None,
) -> Deviations:
    """The filter's standard deviations along a truth, by covariance analysis without random errors.

    Args:
        truth: any truth.
        geometry: the beams.
        aiding: sensors.
        model: sensor errors in SI (`Scenario.kernel_model`).
        kind: the model.
        period_s: interval between measurements, all sensors at once.
        schedule: measurement times in place of the period.

    Raises:
        KernelError: as `observe`.

    Examples:
        >>> from bottomlock.simulation.manoeuvres import MANOEUVRES, manoeuvre_truth
        >>> from bottomlock.config.scenario import load_scenario
        >>> truth, janus = manoeuvre_truth(MANOEUVRES["straight"], rate_hz=50.0), kernel.BeamGeometry.janus(0.35)
        >>> model = load_scenario("straight").kernel_model(truth.gravity_mps2)
        >>> sd = deviations(truth, janus, Aiding(beams=(1, 2, 3, 4)), model).sd
        >>> bool(sd[-1, 8] < sd[0, 8])
        True
    """
    history = kernel.covariance_history(
        geometry,
        truth.kernel_arrays(),
        model,
        aiding.kernel_dict(geometry.beams),
        kind=kind,
        period_ns=ns_from_s(period_s),
        schedule=None if schedule is None else schedule.kernel_dict(),
    )
    return Deviations(
        states=tuple(history["states"]), time_ns=history["time_ns"], covariance=history["covariance"]
    )
