"""The passes over a recording that a candidate is scored on: all measurements used, and outages of the beams."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry, replay_log
from bottomlock.kernel.models import InitialState, Model, Options, Robust
from bottomlock.recordings.stream_sections import ImuStream
from bottomlock.recordings.streams import Flags, Floats, Times
from bottomlock.replay import rerun
from bottomlock.replay.case import Case
from bottomlock.replay.model import imu_model, kernel_model, kernel_options
from bottomlock.replay.reading import read_streams
from bottomlock.replay.tune.parameters import (
    BEAM_NOISE,
    WATER_NOISE,
    Parameter,
    noise_of,
    with_values,
)

HORIZONS_S = (10.0, 30.0, 100.0)
"""Times after the last beams used at which the beams are predicted."""
RECOVERY_S = 30.0
"""Time with beams between two outages."""
PHASES = 3
"""Passes with outages; each has them a part of a cycle later than the one before."""
OUTAGES = 4
"""Fewest outages of a horizon in a pass; with fewer the horizon is left out."""


METHODS = ("tc",)
"""Methods whose predictions are scored where none are named."""
MEASURED = ("tc", "info", "sway_current")
"""Methods that predict what was measured: no row of theirs has a velocity that they assume."""
LEFT_OUT = "beam left out"
"""Name of the predictions of a beam that is lost while the others are used."""
ASSUMED = ("heave", "sway")
"""Names of the assumptions of `sway_current`, which are no measurements."""
LOST_S = 60.0
"""Time for which a beam is left out."""
EACH_S = 10.0
"""Time between two predictions of it."""


@dataclass(frozen=True, eq=False)
class Pass:
    """A log, and which of its innovations are scored.

    Attributes:
        log: as the kernel takes it, with the flags of withheld pings.
        scored_ns, horizon: times (n,) of the withheld pings that are scored, and the horizon of each, from 1; None
            where every innovation is scored at horizon 0, the one step.
        name: of its predictions.
    """

    log: Mapping[str, Any]
    scored_ns: Times | None
    horizon: NDArray[np.intp] | None
    name: str = "beams"


@dataclass(frozen=True, eq=False)
class Group:
    """Innovations (n, k), their covariances (n, k, k), times (n,) and horizons (n,), of as many rows each."""

    sensor: str
    residual: Floats
    covariance: Floats
    time_ns: Times
    horizon: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Inputs:
    """What a candidate changes.

    Attributes:
        model, options: of the filter.
        beam_sd_factor: on the noise of the beams.
        water_sd_factor: on that of the beams of the water.
    """

    model: Model
    options: Options
    beam_sd_factor: float = 1.0
    water_sd_factor: float = 1.0

    def with_noise(self, log: Mapping[str, Any]) -> Any:  # noqa: ANN401 - as the kernel takes it
        """A log with the noise of the beams of bottom and water."""
        changed = dict(log)
        factors = {"beam_sd_mps": self.beam_sd_factor, "water_track_sd_mps": self.water_sd_factor}
        for key, factor in factors.items():
            if factor != 1.0:
                changed[key] = log[key] * factor
        return changed


def horizons_of(duration_s: float, horizons_s: Sequence[float] = HORIZONS_S) -> tuple[float, ...]:
    """The horizons for which a log is long enough: so many outages of each."""
    return tuple(
        horizon for horizon in horizons_s if duration_s >= OUTAGES * (horizon + min(horizon, RECOVERY_S))
    )


Readings = Callable[[Flags], Mapping[str, Floats]]
"""Inertial readings of a log, which may be made of the beams (n, B) that the filter knows."""


def as_recorded(_: Flags) -> Mapping[str, Floats]:
    """Those of an IMU: they stay as they are in the log."""
    return {}


def passes_of(
    log: Mapping[str, Any], horizons_s: Sequence[float], readings: Readings = as_recorded
) -> list[Pass]:
    """The pass with all measurements, those with outages as long as the longest horizon, one without single beams.

    Without a horizon there is the first alone.
    """
    if not horizons_s:
        return [Pass(log, None, None)]
    outages = [_with_outages(log, horizons_s, phase / PHASES, readings) for phase in range(PHASES)]
    left_out = _beams_left_out(log, readings)
    return [Pass(log, None, None), *outages, *([] if left_out is None else [left_out])]


def _with_outages(
    log: Mapping[str, Any], horizons_s: Sequence[float], phase: float, readings: Readings
) -> Pass:
    """Outages of the beams as long as the longest horizon; the first ping at or after each horizon is predicted."""
    time_ns: Times = log["dvl_time_ns"]
    cycle_s = horizons_s[-1] + min(horizons_s[-1], RECOVERY_S)
    start_s = (time_ns - log["imu_time_ns"][0]) * 1e-9 - phase * cycle_s - RECOVERY_S
    into_s = np.where(start_s < 0.0, np.inf, start_s % cycle_s)
    outage = np.floor(start_s / cycle_s)
    any_beam = np.any(log["beam_valid"], axis=1)
    # With the ping that ends the longest horizon the beams are used again.
    kept = ~(into_s < horizons_s[-1])
    horizon = np.zeros(len(time_ns), dtype=np.intp)
    for place, at_s in enumerate(horizons_s, start=1):
        after = np.flatnonzero((start_s >= 0.0) & any_beam & (into_s >= at_s))
        rows = after[np.unique(outage[after], return_index=True)[1]]
        horizon[rows[(into_s[rows] - at_s) < 0.5 * at_s]] = place
    rows, made = (
        np.flatnonzero(kept | (horizon > 0)),
        readings(log["beam_valid"] & (kept & (horizon == 0))[:, None]),
    )
    return _pass(log, rows, horizon[rows], made)


def _beams_left_out(log: Mapping[str, Any], readings: Readings) -> Pass | None:
    """The pass in which one beam after the other is lost for a minute, and predicted; None with fewer than three beams.

    The lost beam is predicted a nanosecond after the others were used.
    """
    valid = log["beam_valid"]
    count, beams = valid.shape
    if beams < 3:
        return None
    since_s = (log["dvl_time_ns"] - log["dvl_time_ns"][0]) * 1e-9
    cycle_s = LOST_S + RECOVERY_S
    turn = (since_s // cycle_s).astype(np.intp) % beams
    into_s = since_s % cycle_s
    is_lost = (into_s < LOST_S)[:, None] & (np.arange(beams) == turn[:, None])
    # The last ping of each span with the lost beam.
    known = np.flatnonzero((is_lost & valid).any(axis=1))
    span = (since_s[known] // cycle_s) * cycle_s + into_s[known] // EACH_S
    predicted = known[np.append(span[1:] != span[:-1], True)] if known.size else known
    if not predicted.size:
        return None
    rows = np.sort(np.concatenate([np.arange(count), predicted]))
    is_second = np.concatenate([[False], rows[1:] == rows[:-1]])
    left = valid[rows] & (is_lost[rows] == is_second[:, None])
    changed = {
        "dvl_time_ns": log["dvl_time_ns"][rows] + is_second,
        "beam_velocity_mps": np.where(left, log["beam_velocity_mps"][rows], np.nan),
        "beam_valid": left,
    }
    return _pass(log, rows, is_second.astype(np.intp), readings(valid & ~is_lost), changed, LEFT_OUT)


def _pass(
    log: Mapping[str, Any],
    rows: NDArray[np.intp],
    horizon: NDArray[np.intp],
    made: Mapping[str, Floats],
    changed: Mapping[str, Any] | None = None,
    name: str = "beams",
) -> Pass:
    """A pass over pings of a log, of which those with a horizon are withheld.

    Args:
        log: as the kernel takes it.
        rows, horizon: (n,) pings, and the horizon of each, 0 for those that are used.
        made: readings that are made of the beams that are used.
        changed: columns of the pings (n,) that are others than in the log.
        name: of the predictions.
    """
    withheld = horizon > 0
    pings = {key: log[key][rows] for key in ("dvl_time_ns", "beam_velocity_mps", "beam_valid", "beam_sd_mps")}
    pings |= {"dvl_withheld": withheld} | dict(changed or {})
    # Of a log that is cut short the first of them.
    pings |= {key: values[: len(log["imu_time_ns"])] for key, values in made.items()}
    return Pass(dict(log) | pings, pings["dvl_time_ns"][withheld], horizon[withheld], name)


def fly(
    one: Pass,
    geometry: BeamGeometry,
    inputs: Inputs,
    start: InitialState,
    *,
    from_ns: int = 0,
    methods: Sequence[str] = METHODS,
) -> list[Group]:
    """The scored innovations of a candidate along a pass, from a time on, by the methods in their order.

    Raises:
        KernelError: where the filter ends in an error.
    """
    log = inputs.with_noise(one.log)
    result = replay_log(
        geometry, inputs.model, inputs.options, list(methods), log, start,
        sample_time_ns=log["imu_time_ns"][-1:], innovations=one.scored_ns is None,
    )  # fmt: skip
    groups = []
    for innovations in result["innovations"]:
        for sensor, records in innovations.items():
            if sensor in ASSUMED or (one.scored_ns is not None and sensor != "beams"):
                continue
            groups += _groups(one, sensor, records, from_ns)
    return groups


def _groups(one: Pass, sensor: str, records: Mapping[str, Any], from_ns: int) -> list[Group]:
    """The scored innovations of a sensor, those with as many rows together."""
    time_ns = records["time_ns"]
    horizon = np.zeros(len(time_ns), dtype=np.intp)
    chosen = time_ns >= from_ns
    if one.scored_ns is not None:
        assert one.horizon is not None
        chosen &= records["withheld"]
        horizon = one.horizon[np.searchsorted(one.scored_ns, time_ns).clip(max=len(one.scored_ns) - 1)]
    groups = []
    for rows in np.unique(records["rows"][chosen]):
        of = chosen & (records["rows"] == rows)
        groups.append(
            Group(
                sensor if one.scored_ns is None else one.name,
                records["residual"][of, :rows],
                records["covariance"][of, :rows, :rows],
                time_ns[of],
                horizon[of],
            )
        )
    return groups


OUTLIER_GATE = 0.99999
"""Probability with which a good ping passes the tests that leave beams out of the comparison."""
LOOSE = 30.0
"""Factor on the inertial noise with which outliers are looked for: it is not known yet."""
_COLUMNS = {
    "imu_time_ns": ("force_p_mps2", "omega_p_radps"),
    "dvl_time_ns": ("beam_velocity_mps", "beam_valid", "beam_sd_mps"),
}


@dataclass(frozen=True, eq=False)
class Recording:
    """A case, prepared for candidates: every candidate sees the same measurements, with no gate.

    Attributes:
        case: as it was read.
        prepared: streams, start and settings.
        log: from the start on, as the kernel takes it; the beams that are outliers count as lost.
        noise: what may be tuned.
    """

    case: Case
    prepared: rerun.PreparedRun
    log: Mapping[str, Any]
    noise: tuple[Parameter, ...]

    @property
    def geometry(self) -> BeamGeometry:
        """The beams."""
        return self.prepared.streams.instrument.geometry

    @property
    def start(self) -> InitialState:
        """The state at the start."""
        return rerun.kernel_start(self.prepared.alignment)

    def readings(self, valid: Flags) -> dict[str, Floats]:
        """Readings that are made of the beams (n, B) of the first n pings; empty for those of an IMU."""
        if isinstance(self.case.imu, ImuStream):
            return {}
        known = np.zeros_like(self.log["beam_valid"])
        known[: len(valid)] = valid
        log = rerun.kernel_log(self.case, self.prepared, known)
        return {key: log[key] for key in _COLUMNS["imu_time_ns"]}

    def inputs(self, values: Mapping[str, float]) -> Inputs:
        """What other settings change; the filters have no gate, so that all candidates use the same measurements.

        Raises:
            KernelError: for settings that the kernel refuses.
        """
        case, prepared = with_values(self.case, values), self.prepared
        gravity = prepared.model.environment.gravity_mps2
        imu = imu_model(case, prepared.streams)
        model = kernel_model(case, prepared.streams, imu, prepared.model.initial, gravity)
        options = kernel_options(case, prepared.streams.instrument)
        return Inputs(
            model,
            options.replace(gate="off", robust=None, inflate_after_rejections=0),
            beam_sd_factor=self._factor(values, BEAM_NOISE),
            water_sd_factor=self._factor(values, WATER_NOISE),
        )

    def _factor(self, values: Mapping[str, float], key: str) -> float:
        """What another value of a noise is to the one in the log."""
        start = next((one.start for one in self.noise if one.key == key), None)
        return 1.0 if start is None else values.get(key, start) / start


def read_recording(case: Case) -> Recording:
    """A case with its streams read, its start found and what can be tuned of it.

    Raises:
        DataError, ScenarioError: as `read_streams` and `prepare`; where nothing can be tuned.
    """
    rerun.check_files(case)
    streams = read_streams(case)
    prepared = rerun.prepare(case, streams)
    beams = prepared.streams.beams
    log = rerun.kernel_log(case, prepared, beams.valid[prepared.pings])
    return Recording(case, prepared, log, tuple(noise_of(case, streams)))


def without_outliers(recording: Recording) -> dict[str, Any]:
    """The log in which the beams that a filter with `LOOSE` times the inertial noise rejects count as lost."""
    inputs = recording.inputs(
        {one.key: one.start * (LOOSE if one.is_inertial_noise else 1.0) for one in recording.noise}
    )
    robust = Robust(closure_gate=OUTLIER_GATE, beam_gate=OUTLIER_GATE, tail="gaussian")
    log = inputs.with_noise(recording.log)
    result = replay_log(
        recording.geometry, inputs.model, inputs.options.replace(robust=robust), ["tc"], log,
        recording.start, sample_time_ns=log["imu_time_ns"][-1:],
    )  # fmt: skip
    valid = recording.log["beam_valid"] & ~(result["beam_weight"][0] == 0.0)
    velocity = np.where(valid, recording.log["beam_velocity_mps"], np.nan)
    beams = {"beam_valid": valid, "beam_velocity_mps": velocity}
    return dict(recording.log) | beams | recording.readings(valid)


def cut(log: Mapping[str, Any], to_ns: int) -> dict[str, Any]:
    """The rows of a log up to a time."""
    part: dict[str, Any] = {}
    for time_key in (key for key in log if key.endswith("_time_ns")):
        count = int(np.searchsorted(log[time_key], to_ns, side="right"))
        prefix = time_key.removesuffix("time_ns")
        for key in _COLUMNS.get(time_key) or (key for key in log if key.startswith(prefix)):
            part[key] = log[key][:count]
        part[time_key] = log[time_key][:count]
    return part
