"""One pass along a recording: initial alignment, beams removed, every method run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bottomlock.errors import BottomlockError, DataError
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import rejected_imu, replay_log
from bottomlock.kernel.models import ImuModel, InitialModel, InitialState, Model, Options
from bottomlock.plant.beam_loss import scheduled
from bottomlock.recordings.axes import quaternions
from bottomlock.recordings.sensors import SENSORS
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.recordings.streams import Flags, Floats, Inertial, Times
from bottomlock.replay.align import Alignment, align
from bottomlock.replay.case import Case, WhatIf
from bottomlock.replay.model import gravity_mps2, imu_model, kernel_model, kernel_options
from bottomlock.replay.streams import Streams
from bottomlock.replay.vehicle_motion import with_persistence

FEW = 0.01
"""Largest fraction of rejected inertial readings that counts as single faults; more tells of a wrong unit."""


@dataclass(frozen=True, eq=False)
class PreparedRun:
    """A recording up to its end as replayed, and its initial alignment.

    Attributes:
        streams: the recording.
        readings: its inertial readings without the few that the limits reject, for what compares them with other
            instruments; all of them where more than `FEW` are rejected, as they are in a wrong unit.
        alignment: initial state given to the filter.
        model, options: as the kernel takes them.
        sample_time_ns: (T,) times of inertial readings at which the estimates are sampled.
        rows: (T,) rows of the reference to compare with, -1 where it has none; empty without a reference.
    """

    streams: Streams
    readings: Inertial
    alignment: Alignment
    model: Model
    options: Options
    sample_time_ns: Times
    rows: Times

    @property
    def pings(self) -> slice:
        """The pings between the start and the last inertial reading."""
        times, last_ns = self.streams.beams.time_ns, self.streams.inertial.time_ns[-1]
        return slice(*np.searchsorted(times, [self.alignment.time_ns, last_ns + 1]))


@dataclass(frozen=True, eq=False)
class Rerun:
    """Results of every method for one what-if case.

    Attributes:
        prepared: the recording.
        valid: (E, B) validity of the beams given to the filters.
        result: the kernel's dict of the forward pass of every method.
        smoothed_methods: methods with a smoothed pass.
        smoothed: the kernel's dict with their smoothed states.
        reckoned: states of dead reckoning, None where it was not possible (`reckon.reckon`).
    """

    prepared: PreparedRun
    valid: Flags
    result: Mapping[str, Any]
    smoothed_methods: tuple[str, ...]
    smoothed: Mapping[str, Any]
    reckoned: Mapping[str, Floats] | None = None


def prepare(case: Case, streams: Streams) -> PreparedRun:
    """Aligns a recording.

    Args:
        case: the case.
        streams: its recording as read.

    Raises:
        DataError: as `align`, and where the reference has no row between start and end.
    """
    streams = _up_to_duration(case, streams)
    imu, gravity = imu_model(case, streams), gravity_mps2(case, streams)
    good = _with_good_readings(case, streams, imu)
    alignment = align(case, good, imu, gravity)
    initial = InitialModel(
        position_sd_m=alignment.position_sd_m,
        attitude_sd_rad=alignment.attitude_sd_rad,
        velocity_sd_mps=alignment.velocity_sd_mps,
    )
    samples, rows = _sample_times(case, streams, alignment.time_ns)
    return PreparedRun(
        streams=streams,
        readings=(
            good if len(good.inertial.time_ns) >= (1.0 - FEW) * len(streams.inertial.time_ns) else streams
        ).inertial,
        alignment=alignment,
        model=kernel_model(case, streams, imu, initial, gravity),
        options=kernel_options(case, streams.instrument, streams.vehicle_motion),
        sample_time_ns=samples,
        rows=rows,
    )


def _up_to_duration(case: Case, streams: Streams) -> Streams:
    """The recording up to `replay.duration_s` after the first inertial reading."""
    if case.replay.duration_s is None:
        return streams
    times = streams.inertial.time_ns
    count = int(np.searchsorted(times, times[0] + round(case.replay.duration_s * 1e9) + 1))
    return replace(streams, inertial=streams.inertial.rows(slice(count)))


def _with_good_readings(case: Case, streams: Streams, imu: ImuModel) -> Streams:
    """The recording without the inertial readings that the limits reject, whose mean would be that of their faults."""
    inertial = streams.inertial
    rejected = rejected_imu(
        imu,
        kernel_options(case, streams.instrument),
        inertial.time_ns,
        inertial.omega_p_radps,
        inertial.force_p_mps2,
    )
    if not rejected["row"].size:
        return streams
    good = np.delete(np.arange(len(inertial.time_ns)), rejected["row"])
    if not good.size:
        units = "attitude.unit" if isinstance(case.imu, ImuFromAttitude) else "imu.force_unit, imu.omega_unit"
        raise DataError(
            f"every inertial reading is rejected, the first since {rejected['reason'][0]}: check {units}, imu.limits",
            place=case.motion_file,
        )
    return replace(streams, inertial=inertial.rows(good))


def _sample_times(case: Case, streams: Streams, start_ns: int) -> tuple[Times, Times]:
    """Inertial readings at or just after the reference's times, and every `sample_s` where it has none as near."""
    times = streams.inertial.time_ns
    step_ns = round(case.replay.sample_s * 1e9)
    wanted_ns = np.arange(start_ns, int(times[-1]) + 1, step_ns, dtype=np.int64)
    rows = np.zeros(0, dtype=np.int64)
    if streams.reference is not None:
        known_ns = streams.reference.time_ns
        rows = np.flatnonzero((known_ns >= start_ns) & (known_ns <= times[-1]))
        if not rows.size:
            raise DataError(
                "has no row between the start and the end of the inertial readings", key="[reference]"
            )
        known_ns = known_ns[rows]
        # GPS at the surface alone, or slow acoustics: the track goes on without them.
        after = np.searchsorted(known_ns, wanted_ns)
        before_ns = known_ns[np.maximum(after - 1, 0)]
        after_ns = known_ns[np.minimum(after, len(known_ns) - 1)]
        apart_ns = np.minimum(np.abs(wanted_ns - before_ns), np.abs(after_ns - wanted_ns))
        wanted_ns = wanted_ns[apart_ns > step_ns]
        rows = np.concatenate([rows, np.full(len(wanted_ns), -1)])
        wanted_ns = np.concatenate([known_ns, wanted_ns])
        order = np.argsort(wanted_ns, kind="stable")
        wanted_ns, rows = wanted_ns[order], rows[order]
    sample_ns = times[np.searchsorted(times, wanted_ns)]
    # A reference faster than the IMU is sampled once per inertial reading.
    kept = np.concatenate([[True], np.diff(sample_ns) > 0])
    return sample_ns[kept], rows[kept] if rows.size else rows


def kernel_log(case: Case, prepared: PreparedRun, valid: Flags) -> Any:  # noqa: ANN401 - the kernel's dict
    """The log from the start of the navigation on, as the kernel takes it; `valid` (E, B) masks the beams."""
    streams, start_ns = prepared.streams, prepared.alignment.time_ns
    beams = streams.beams
    known = beams.valid.copy()
    known[prepared.pings] = valid
    inertial = with_persistence(case, streams, known)
    imu = slice(int(np.searchsorted(inertial.time_ns, start_ns)), None)
    last_ns = inertial.time_ns[-1]

    def within(times: Times) -> slice:
        return slice(*np.searchsorted(times, [start_ns, last_ns + 1]))

    log: dict[str, Any] = {
        "imu_time_ns": inertial.time_ns[imu],
        "force_p_mps2": inertial.force_p_mps2[imu],
        "omega_p_radps": inertial.omega_p_radps[imu],
        "dvl_time_ns": beams.time_ns[prepared.pings],
        "beam_velocity_mps": np.where(valid, beams.velocity_mps[prepared.pings], np.nan),
        "beam_valid": valid,
        "beam_sd_mps": beams.sd_mps[prepared.pings],
    }
    for sensor in SENSORS:
        section, stream = getattr(case, sensor.name), streams.aiding.get(sensor.name)
        if section is None or stream is None:
            continue
        rows = within(stream.time_ns)
        times = stream.time_ns[rows]
        # The rate of the last inertial reading before it, and none before the first.
        last = np.searchsorted(log["imu_time_ns"], times, side="right")
        omega = np.vstack([np.zeros(3), log["omega_p_radps"]])[last]
        for name, columns in sensor.logged(stream, section, rows, omega).items():
            log |= {f"{name}_time_ns": times, **columns}
    return log


def kernel_start(alignment: Alignment) -> InitialState:
    """The initial state as the kernel takes it, with zero biases."""
    return InitialState(
        time_ns=int(alignment.time_ns),
        position_t_m=alignment.position_t_m,
        attitude_t_p=quaternions(alignment.attitude),
        velocity_p_mps=alignment.velocity_p_mps,
    )


def returned(prepared: PreparedRun, what_if: WhatIf) -> Flags:
    """(E, B) which beams a what-if case lets through.

    Raises:
        DataError: for a what-if case that names a beam that does not exist.
    """
    beams = prepared.streams.beams
    times, count = beams.time_ns[prepared.pings], beams.valid.shape[1]
    return beams_returned(what_if, times, count, start_ns=prepared.alignment.time_ns)


def run_methods(case: Case, prepared: PreparedRun, what_if: WhatIf | None, *, threads: int = 1) -> Rerun:
    """Runs every method of a case along one prepared recording, without the beams that a what-if case loses.

    Args:
        case: the case.
        prepared: recording and initial state.
        what_if: the beam losses; None for the beams as recorded.
        threads: number of threads, 0 for one per core; the results do not depend on it.

    Raises:
        DataError: for a what-if case that names a beam that does not exist.
        KernelError: naming field, row and time.
    """
    beams = prepared.streams.beams
    valid = beams.valid[prepared.pings]
    if what_if is not None:
        valid = valid & returned(prepared, what_if)
    start = kernel_start(prepared.alignment)
    log = kernel_log(case, prepared, valid)

    def filtered(methods: Sequence[str], *, smooth: bool) -> Any:  # noqa: ANN401 - the kernel's dict
        return replay_log(
            prepared.streams.instrument.geometry, prepared.model, prepared.options, methods, log, start,
            sample_time_ns=prepared.sample_time_ns, smooth=smooth, threads=threads,
        )  # fmt: skip

    smoothed_methods = case.replay.filters if case.replay.smooth else ()
    result = filtered(case.replay.filters, smooth=False)
    # Estimates are sampled at the times of good inertial readings.
    sampled_ns = result["sample_time_ns"]
    return Rerun(
        prepared=replace(prepared, sample_time_ns=sampled_ns, rows=prepared.rows[: len(sampled_ns)]),
        valid=valid,
        result=result,
        smoothed_methods=smoothed_methods,
        smoothed=filtered(smoothed_methods, smooth=True) if smoothed_methods else {},
    )


def beams_returned(what_if: WhatIf, time_ns: Times, beams: int, *, start_ns: int) -> Flags:
    """(E, B) validity of the beams at each ping, by every rule of a what-if case.

    Args:
        what_if: the section of the case file.
        time_ns: (E,) times of the pings, from the start of the navigation on.
        beams: number of beams of the instrument.
        start_ns: start of the navigation, from which the section's seconds count.

    Raises:
        DataError: for a beam that does not exist.
    """
    for beam in what_if.beams_named:
        if beam > beams:
            raise DataError(
                f"beam {beam} does not exist", place=f"what_if '{what_if.name}'", expected=f"1 to {beams}"
            )
    return scheduled(time_ns - start_ns, beams, what_if.beams_lost, what_if.outages)


def check_files(case: Case) -> None:
    """Checks that every file of a case is there and that its geometry is right.

    Raises:
        DataError: naming every file at fault and the geometry, a line each.
    """
    files: dict[str, str] = {}
    for section, path in case.files().items():
        if not path.is_file():
            files[str(path)] = f"{files[str(path)]}, [{section}]" if str(path) in files else f"[{section}]"
    faults = [f"{path}: no such file, named in {sections}" for path, sections in files.items()]
    try:
        read_geometry(case.dvl.geometry)
    except BottomlockError as error:
        faults.append(str(error))
    if faults:
        raise DataError("\n".join(faults))


def check_what_ifs(case: Case, prepared: PreparedRun) -> None:
    """Checks the beams of each what-if case.

    Raises:
        DataError: for each what-if case at fault, a line each.
    """
    faults = []
    for what_if in case.what_if:
        try:
            returned(prepared, what_if)
        except DataError as error:
            faults.append(str(error))
    if faults:
        raise DataError("\n".join(faults))
