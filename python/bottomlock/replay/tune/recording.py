"""A case as the search takes it: its log without outliers, cut at a time, and what a candidate changes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock.kernel import BeamGeometry, replay_log
from bottomlock.kernel.models import InitialState, Robust
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.replay import rerun
from bottomlock.replay.beforehand import check_files
from bottomlock.replay.case import Case
from bottomlock.replay.model import imu_model, kernel_model, kernel_options
from bottomlock.replay.reading import read_streams
from bottomlock.replay.stream_sections import ImuStream
from bottomlock.replay.tune.parameters import (
    BEAM_NOISE,
    WATER_NOISE,
    Parameter,
    noise_of,
    with_values,
)
from bottomlock.replay.tune.passes import Inputs

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
    check_files(case)
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
