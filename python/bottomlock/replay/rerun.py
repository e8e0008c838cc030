"""One run along a recording: random errors drawn, the start aligned, beams removed, every method run."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import replay_log
from bottomlock.replay import random_errors
from bottomlock.replay.align import Alignment, align
from bottomlock.replay.axes import quaternions, to_angles
from bottomlock.replay.case import Case
from bottomlock.replay.dive import Dive, Flags, Floats, Times
from bottomlock.replay.dvl_sections import WhatIf
from bottomlock.replay.model import gravity_mps2, imu_model, kernel_model, kernel_options
from bottomlock.replay.whatif import read_recorded, returned

UNSMOOTHED = ("consistent",)
"""Methods that choose between filters have no smoother of their own."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """One draw of a recording, aligned and ready to be flown.

    Attributes:
        run: which draw.
        dive: the recording with this draw's noise in it.
        alignment: the start that the filter is given.
        model, options: as the kernel wants them.
        sample_time_ns: (T,) inertial readings at which the estimates are recorded.
        rows: (T,) rows of the reference that they are compared with; empty without a reference.
    """

    run: int
    dive: Dive
    alignment: Alignment
    model: dict[str, Any]
    options: dict[str, Any]
    sample_time_ns: Times
    rows: Times

    @property
    def pings(self) -> slice:
        """The pings that the navigation hears."""
        times, last_ns = self.dive.beams.time_ns, self.dive.inertial.time_ns[-1]
        return slice(*np.searchsorted(times, [self.alignment.time_ns, last_ns + 1]))


@dataclass(frozen=True, eq=False)
class Flight:
    """What the kernel made of one question in one draw: its dicts, and the beams that it had.

    `result` is of the forward pass of every method; `smoothed` has the smoothed states of `smoothed_methods`.
    """

    prepared: Prepared
    valid: Flags
    result: Mapping[str, Any]
    smoothed_methods: tuple[str, ...]
    smoothed: Mapping[str, Any]


def prepare(case: Case, dive: Dive, run: int, residuals: Floats | None = None) -> Prepared:
    """A draw of the recording, aligned.

    Args:
        case: the case.
        dive: its recording as read.
        run: which draw.
        residuals: closure residuals to draw beam noise from, of `noise_residuals`.

    Raises:
        DataError: as `align`; and where nothing is left between start and end.
    """
    key, seed = random_errors.case_key(case.name), case.replay.seed
    dive = _within(case, _with_draws(case, dive, run, residuals))
    imu, gravity = imu_model(case), gravity_mps2(case, dive)
    alignment = align(case, dive, imu, gravity)
    initial = {
        "position_sd_m": alignment.position_sd_m,
        "attitude_sd_rad": alignment.attitude_sd_rad,
        "velocity_sd_mps": alignment.velocity_sd_mps,
    }
    if case.start.draw:
        errors = random_errors.start_errors(
            np.concatenate(list(initial.values())), seed=seed, key=key, run=run
        )
        alignment = replace(
            alignment,
            position_t_m=alignment.position_t_m + errors[:3],
            attitude=Rotation.from_rotvec(errors[3:6]) * alignment.attitude,
            velocity_p_mps=alignment.velocity_p_mps + errors[6:],
        )
    samples, rows = _sample_times(case, dive, alignment.time_ns)
    return Prepared(
        run=run,
        dive=dive,
        alignment=alignment,
        model=kernel_model(case, dive, imu, initial, gravity),
        options=kernel_options(case),
        sample_time_ns=samples,
        rows=rows,
    )


def noise_residuals(case: Case) -> Floats | None:
    """(m,) closure residuals that the case draws beam noise from; None where it draws none.

    Raises:
        DataError: for a recording that cannot be read, or one without pings of all beams or without redundant beams.
    """
    of = case.dvl.noise.of
    if of is None:
        return None
    geometry = read_geometry(of.geometry).geometry
    _, velocity, valid = read_recorded(of)
    if geometry.beams <= geometry.rank or not valid.all(axis=1).any():
        raise DataError(
            f"{of.file}: has no ping with more beams than a velocity has components: no closure to draw noise from"
        )
    return random_errors.closure_residuals(geometry, velocity, valid) * case.dvl.noise.scale


def _with_draws(case: Case, dive: Dive, run: int, residuals: Floats | None) -> Dive:
    keys: dict[str, int] = {"seed": case.replay.seed, "key": random_errors.case_key(case.name), "run": run}
    noise = case.dvl.noise
    shape = dive.beams.velocity_mps.shape
    if noise.kind == "white":
        assert noise.sd_mps is not None  # the section demands it
        added = random_errors.white_beams(shape, noise.sd_mps * noise.scale, **keys)
        dive = replace(dive, beams=replace(dive.beams, velocity_mps=dive.beams.velocity_mps + added))
    elif residuals is not None:
        added = random_errors.resampled_beams(shape, residuals, **keys)
        dive = replace(dive, beams=replace(dive.beams, velocity_mps=dive.beams.velocity_mps + added))
    if case.imu.degrade is not None:
        dive = replace(dive, inertial=random_errors.poorer(dive.inertial, case.imu.degrade, **keys))
    return dive


def _within(case: Case, dive: Dive) -> Dive:
    """The recording up to the end that the case sets, counted from the first inertial reading."""
    if case.replay.duration_s is None:
        return dive
    inertial = dive.inertial
    rows = slice(
        0,
        int(np.searchsorted(inertial.time_ns, inertial.time_ns[0] + round(case.replay.duration_s * 1e9) + 1)),
    )
    shorter = type(inertial)(
        inertial.time_ns[rows], inertial.force_p_mps2[rows], inertial.omega_p_radps[rows]
    )
    return replace(dive, inertial=shorter)


def _sample_times(case: Case, dive: Dive, start_ns: int) -> tuple[Times, Times]:
    """Inertial readings at or just after the reference's times, or every `sample_s` without a reference."""
    times = dive.inertial.time_ns
    if dive.reference is not None:
        asked = dive.reference.time_ns
        rows = np.flatnonzero((asked >= start_ns) & (asked <= times[-1]))
        if not rows.size:
            raise DataError("[reference] has no row between the start and the end of the inertial readings")
        asked = asked[rows]
    else:
        step_ns = round(case.replay.sample_s * 1e9)
        asked = np.arange(start_ns, int(times[-1]) + 1, step_ns, dtype=np.int64)
        rows = np.zeros(0, dtype=np.int64)
    reached = times[np.searchsorted(times, asked)]
    kept = np.concatenate([[True], np.diff(reached) > 0])  # a reference faster than the IMU: once per reading
    return reached[kept], rows[kept] if rows.size else rows


def make_log(case: Case, prepared: Prepared, valid: Flags) -> Any:  # noqa: ANN401 - the kernel's dict
    """The log as the kernel wants it, from the start of the navigation on."""
    dive, start_ns = prepared.dive, prepared.alignment.time_ns
    inertial, beams = dive.inertial, dive.beams
    imu = slice(int(np.searchsorted(inertial.time_ns, start_ns)), None)
    last_ns = inertial.time_ns[-1]

    def heard(times: Times) -> slice:
        return slice(*np.searchsorted(times, [start_ns, last_ns + 1]))

    none, no_times = np.zeros(0), np.zeros(0, dtype=np.int64)
    log: dict[str, Any] = {
        "imu_time_ns": inertial.time_ns[imu],
        "force_p_mps2": inertial.force_p_mps2[imu],
        "omega_p_radps": inertial.omega_p_radps[imu],
        "dvl_time_ns": beams.time_ns[prepared.pings],
        "beam_velocity_mps": np.where(valid, beams.velocity_mps[prepared.pings], np.nan),
        "beam_valid": valid,
        "beam_sd_mps": beams.sd_mps[prepared.pings],
        "depth_time_ns": no_times,
        "depth_m": none,
        "heading_time_ns": no_times,
        "heading_rad": none,
        "attitude_time_ns": no_times,
        "attitude_rpy_rad": np.zeros((0, 3)),
        "gps_time_ns": no_times,
        "gps_position_t_m": np.zeros((0, 3)),
    }
    if dive.depths is not None:
        rows = heard(dive.depths.time_ns)
        log |= {"depth_time_ns": dive.depths.time_ns[rows], "depth_m": dive.depths.depth_m[rows]}
    if dive.attitudes is not None and case.attitude is not None and case.attitude.aids != "nothing":
        rows = heard(dive.attitudes.time_ns)
        angles = to_angles(dive.attitudes.attitude[rows])
        if case.attitude.aids == "attitude":
            log |= {"attitude_time_ns": dive.attitudes.time_ns[rows], "attitude_rpy_rad": angles}
        else:
            log |= {"heading_time_ns": dive.attitudes.time_ns[rows], "heading_rad": angles[:, 2].copy()}
    if dive.positions is not None and case.gps is not None and case.gps.aids:
        rows = heard(dive.positions.time_ns)
        log |= {
            "gps_time_ns": dive.positions.time_ns[rows],
            "gps_position_t_m": dive.positions.position_t_m[rows],
        }
    return log


def fly(case: Case, prepared: Prepared, asked: WhatIf | None, *, threads: int = 1) -> Flight:
    """Every method of a case along one draw of its recording, with the beams that a question leaves.

    Raises:
        DataError: for a question that makes no sense here.
        KernelError: naming field, row and time.
    """
    beams = prepared.dive.beams
    valid = beams.valid[prepared.pings]
    if asked is not None:
        valid = valid & returned(
            asked,
            beams.time_ns[prepared.pings],
            valid.shape[1],
            start_ns=prepared.alignment.time_ns,
            name=case.name,
            seed=case.replay.seed,
            run=prepared.run,
        )
    alignment = prepared.alignment
    start: Any = {
        "time_ns": alignment.time_ns,
        "position_t_m": alignment.position_t_m,
        "attitude_t_p": quaternions(alignment.attitude),
        "velocity_p_mps": alignment.velocity_p_mps,
        "accel_bias_p_mps2": np.zeros(3),
        "gyro_bias_p_radps": np.zeros(3),
    }
    log = make_log(case, prepared, valid)

    def flown(methods: list[str], *, smooth: bool) -> Any:  # noqa: ANN401 - the kernel's dict
        model: Any = prepared.model
        options: Any = prepared.options
        return replay_log(
            prepared.dive.instrument.geometry,
            model,
            options,
            methods,
            log,
            start,
            sample_time_ns=prepared.sample_time_ns,
            smooth=smooth,
            threads=threads,
        )

    smoothed_methods = (
        tuple(method for method in case.replay.methods if method not in UNSMOOTHED)
        if case.replay.smooth
        else ()
    )
    return Flight(
        prepared=prepared,
        valid=valid,
        result=flown(list(case.replay.methods), smooth=False),
        smoothed_methods=smoothed_methods,
        smoothed=flown(list(smoothed_methods), smooth=True) if smoothed_methods else {},
    )
