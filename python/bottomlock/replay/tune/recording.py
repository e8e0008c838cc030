"""A case as the search takes it: its log without outliers, cut at a time, and what a candidate changes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock.io.beams import InstrumentFile, instrument_of, read_instrument_file
from bottomlock.kernel import BeamGeometry, KernelError, replay_log
from bottomlock.kernel.models import InitialState, Robust
from bottomlock.recordings.axes import from_angles, to_angles
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.replay import rerun
from bottomlock.replay.beforehand import check_files
from bottomlock.replay.case import Case
from bottomlock.replay.model import imu_model, kernel_model, kernel_options
from bottomlock.replay.motion.fit import Recorded, fit
from bottomlock.replay.motion.velocity import ping_velocity
from bottomlock.replay.reading import read_streams
from bottomlock.replay.stream_sections import ImuStream
from bottomlock.replay.tune.parameters import (
    ATTITUDE_CLOCK,
    BEAM_NOISE,
    CLOCK_SD_S,
    DVL_CLOCK,
    DVL_FILE,
    MOUNTING,
    MOUNTING_SD_DEG,
    WATER_NOISE,
    Parameter,
    constants_of,
    noise_of,
    sway_of,
    with_values,
)
from bottomlock.replay.tune.passes import Inputs

OUTLIER_GATE = 0.99999
"""Probability with which a good ping passes the tests that leave beams out of the comparison."""
LOOSE = 30.0
"""Factor on the noise with which outliers are looked for before it is known."""
MARGIN_S = 1.0
"""Largest change of a clock, and the time at both ends of a recording that is left for it."""
_FIT_SD = {
    "rotation": float(np.deg2rad(MOUNTING_SD_DEG)), "scale": 0.02, "clock": CLOCK_SD_S, "gyro_bias": 0.05,
    "accel_bias": 0.5, "lever": 1.0,
}  # fmt: skip
"""1 sigma of what the fit of the motion has: rad, 1, s, rad/s, m/s², m."""
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
        instrument: settings of the DVL's own file.
        noise, constants, sway: what may be tuned, together each.
    """

    case: Case
    prepared: rerun.PreparedRun
    log: Mapping[str, Any]
    instrument: InstrumentFile
    noise: tuple[Parameter, ...]
    constants: tuple[Parameter, ...]
    sway: tuple[Parameter, ...]

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
            KernelError: for settings that the kernel refuses, and clocks off by more than `MARGIN_S`.
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
            geometry=self._geometry(values),
            later_ns=self._later_ns(values),
        )

    def _factor(self, values: Mapping[str, float], key: str) -> float:
        """What another value of a noise is to the one in the log."""
        start = next((one.start for one in self.noise if one.key == key), None)
        return 1.0 if start is None else values.get(key, start) / start

    def _geometry(self, values: Mapping[str, float]) -> BeamGeometry | None:
        angles = {key.removeprefix(DVL_FILE): values[key] for key in MOUNTING if key in values}
        if not angles:
            return None
        return instrument_of(self.instrument.model_copy(update=angles), place=self.case.dvl.geometry).geometry

    def _later_ns(self, values: Mapping[str, float]) -> dict[str, int]:
        """What is added to the times of the log's streams."""
        later: dict[str, int] = {}
        for one in self.constants:
            streams = {DVL_CLOCK: ("dvl",), ATTITUDE_CLOCK: ("attitude", "heading")}.get(one.key, ())
            later_s = values.get(one.key, one.start) - one.start
            if streams and abs(later_s) > MARGIN_S:
                raise KernelError(f"{one.key} is {later_s:g} s off", expected=f"at most {MARGIN_S:g} s")
            later |= dict.fromkeys(streams, round(later_s * 1e9))
        return later

    def fitted_constants(self, to_ns: int) -> dict[str, float]:
        """Mounting and clock of the DVL by the fit of its velocity to the integrated readings; empty where it fails."""
        log = cut(self.log, to_ns)
        directions = self.geometry.directions_p
        velocity = ping_velocity(directions, log["dvl_time_ns"], log["beam_velocity_mps"], log["beam_valid"])
        recorded = Recorded(log["imu_time_ns"], log["force_p_mps2"], log["omega_p_radps"], *velocity)
        matched = fit(recorded, _FIT_SD)
        if matched is None or not matched.plausible:
            return {}
        stated = from_angles(
            *np.deg2rad([getattr(self.instrument, key.removeprefix(DVL_FILE)) for key in MOUNTING])
        )
        angles = np.rad2deg(to_angles(matched.rotation * stated))
        values = dict(zip(MOUNTING, angles.tolist(), strict=True))
        clock = next((one for one in self.constants if one.key == DVL_CLOCK), None)
        if clock is not None:
            values[DVL_CLOCK] = clock.start + float(np.clip(matched.part("clock")[0], -MARGIN_S, MARGIN_S))
        keys = {one.key for one in self.constants}
        return {key: value for key, value in values.items() if key in keys}


def read_recording(case: Case) -> Recording:
    """A case with its streams read, its start found and what can be tuned of it.

    Raises:
        DataError, ScenarioError: as `read_streams` and `prepare`; where nothing can be tuned.
    """
    check_files(case)
    streams = read_streams(case)
    prepared = rerun.prepare(case, streams)
    beams = prepared.streams.beams
    log = rerun.kernel_log(case, prepared, beams.valid[prepared.pings])
    instrument = read_instrument_file(case.dvl.geometry)
    return Recording(
        case, prepared, log, instrument,
        tuple(noise_of(case, streams)), tuple(constants_of(case, instrument)), tuple(sway_of(case)),
    )  # fmt: skip


def without_outliers(recording: Recording, values: Mapping[str, float], looseness: float) -> dict[str, Any]:
    """The log in which the beams that a filter with so much more noise rejects count as lost."""
    loose = {one.key: looseness for one in recording.noise if one.is_inertial_noise}
    starts = {one.key: one.start for one in recording.noise} | dict(values)
    inputs = recording.inputs({key: value * loose.get(key, 1.0) for key, value in starts.items()})
    robust = Robust(closure_gate=OUTLIER_GATE, beam_gate=OUTLIER_GATE, tail="gaussian")
    log = inputs.with_noise(recording.log)
    log["dvl_time_ns"] = log["dvl_time_ns"] + inputs.later_ns.get("dvl", 0)
    result = replay_log(
        inputs.geometry or recording.geometry, inputs.model, inputs.options.replace(robust=robust), ["tc"], log,
        recording.start, sample_time_ns=log["imu_time_ns"][-1:],
    )  # fmt: skip
    valid = recording.log["beam_valid"] & ~(result["beam_weight"][0] == 0.0)
    velocity = np.where(valid, recording.log["beam_velocity_mps"], np.nan)
    beams = {"beam_valid": valid, "beam_velocity_mps": velocity}
    return dict(recording.log) | beams | recording.readings(valid)


def cut(log: Mapping[str, Any], to_ns: int, margin_s: float = 0.0) -> dict[str, Any]:
    """The rows of a log up to a time, of the measurements none within a margin of both ends."""
    part: dict[str, Any] = {}
    margin_ns = round(margin_s * 1e9)
    for time_key in (key for key in log if key.endswith("_time_ns")):
        times = log[time_key]
        inner_ns = 0 if time_key == "imu_time_ns" else margin_ns
        begin = int(np.searchsorted(times, log["imu_time_ns"][0] + inner_ns)) if inner_ns else 0
        rows = slice(begin, int(np.searchsorted(times, to_ns - inner_ns, side="right")))
        prefix = time_key.removesuffix("time_ns")
        for key in _COLUMNS.get(time_key) or (key for key in log if key.startswith(prefix)):
            part[key] = log[key][rows]
        part[time_key] = times[rows]
    return part
