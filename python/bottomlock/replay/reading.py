"""Reads the streams of a case: units to SI, sensor axes to platform axes, clocks to one clock."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bottomlock.errors import DataError, note
from bottomlock.geodesy import Place, tangent_from_geodetic
from bottomlock.io.beam_table import read_beam_table
from bottomlock.io.beams import Instrument, read_beams, read_geometry
from bottomlock.io.columns import column_numbers, is_code
from bottomlock.recordings.axes import (
    from_angles,
    handedness,
    to_platform_axes,
)
from bottomlock.recordings.dvl_sections import DvlStream
from bottomlock.recordings.readings import LOST_SD_MPS
from bottomlock.recordings.rotation import permute_axes
from bottomlock.recordings.stream_sections import (
    ImuFromAttitude,
    ImuStream,
    PositionStream,
    ReferenceStream,
    SensorStream,
)
from bottomlock.recordings.streams import (
    Beams,
    Flags,
    Floats,
    Inertial,
    Positions,
    ReferenceStates,
    Times,
)
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport, row_times
from bottomlock.replay.read_tables import (
    ANGLE_SI,
    FORCE_SI,
    OMEGA_SI,
    SPEED_SI,
    read_stream,
    read_water,
    stream_of,
)
from bottomlock.replay.screen_aiding import moving, screened
from bottomlock.replay.streams import Streams
from bottomlock.replay.vehicle_motion import inertial_of, with_vehicle_motion


def read_streams(case: Case) -> Streams:
    """Reads every stream of a case, in SI and on one clock.

    Raises:
        ScenarioError: for a geometry file with a fault.
        DataError: naming file, row, column or time: for a file that cannot be read, rows out of order or IMU gaps that
            are not declared, and latitudes without an origin.
    """
    clocks: dict[str, ClockReport] = {}
    notes: list[str] = []
    inertial = None if isinstance(case.imu, ImuFromAttitude) else _inertial(case.imu, clocks, notes)
    noise = {key: getattr(case.dvl, key) for key in ("beam_noise_mps", "beam_noise_mps_per_m")}
    instrument = read_geometry(case.dvl.geometry, **noise)
    beams, stood = moving(_beams(case, instrument, clocks, notes))
    water, water_counts = (
        (None, None) if case.water_file is None else read_water(case, case.water_file, instrument, clocks)
    )
    placed = {
        key: _coordinates(stream, key, clocks)
        for key in type(case).model_fields
        if isinstance(stream := getattr(case, key), PositionStream)
    }
    origin = _origin(case, placed)
    aiding: dict[str, Any] = {
        key: _positions(getattr(case, key), time_ns, table, origin)
        for key, (time_ns, table) in placed.items()
        if key != "reference"
    }
    latitude_deg = case.origin.latitude_deg
    latitude = origin.latitude_rad if origin is not None else np.deg2rad(latitude_deg or 0.0)
    if origin is None and latitude_deg is None:
        raise DataError(
            "is missing",
            key="origin.latitude_deg",
            expected="it in a case without geodetic positions: gravity and the Earth's rate depend on it",
        )
    for key in type(case).model_fields:
        if isinstance(section := getattr(case, key), SensorStream):
            values, timed, _ = read_stream(section, section.columns)
            clocks[key] = timed.report
            aiding[key] = stream_of(section, timed.time_ns, values)
    if isinstance(case.imu, ImuFromAttitude):
        inertial = inertial_of(case.imu, aiding["attitude"], clocks["attitude"], float(latitude), notes)
    assert inertial is not None  # read above, or made of the attitude
    left_out = (*stood, *screened(aiding, inertial, made=isinstance(case.imu, ImuFromAttitude)))
    notes += [one.words for one in left_out]
    notes += _beside_the_dive(aiding, inertial)
    aiding |= {} if water is None else {"water_track": water}
    reference = None
    if case.reference is not None:
        reference = _reference(case.reference, placed["reference"], origin, inertial)
    streams = Streams(
        inertial=inertial,
        beams=beams,
        instrument=instrument,
        aiding=aiding,
        reference=reference,
        origin=origin,
        latitude_rad=float(latitude),
        water_counts=water_counts,
        clocks=clocks,
        left_out=left_out,
        notes=tuple(notes),
    )
    return with_vehicle_motion(case, streams)


def _beside_the_dive(aiding: Mapping[str, Any], inertial: Inertial) -> Iterator[str]:
    """Says of which sensors no reading lies within the times of the inertial ones; each is a note, too."""
    for name, stream in aiding.items():
        if not ((stream.time_ns >= inertial.time_ns[0]) & (stream.time_ns <= inertial.time_ns[-1])).any():
            words = (
                f"{name}: no reading lies within the times of the IMU, so none is used: check {name}.clock"
            )
            note(words)
            yield words


def _inertial(imu: ImuStream, clocks: dict[str, ClockReport], notes: list[str]) -> Inertial:
    names = [*imu.force, *imu.omega, *([imu.interval] if imu.interval is not None else [])]
    values, timed, _ = read_stream(imu, names, optional=False)
    clocks["imu"] = timed.report
    # Increments are in m/s and rad.
    factor = (FORCE_SI | {"m/s": 1.0})[imu.force_unit], (OMEGA_SI | ANGLE_SI)[imu.omega_unit]
    force, omega = values[:, :3] * factor[0], values[:, 3:6] * factor[1]
    if any(imu.increments):
        interval_s = (
            values[:, 6]
            if imu.interval is not None
            else np.full(len(values), 1.0 / (imu.clock.rate_hz or 1.0))
        )
        wrong = np.flatnonzero(~(interval_s > 0.0))
        if wrong.size:
            row = int(timed.rows[wrong[0]])
            raise DataError(
                f"is {interval_s[wrong[0]]:g} s",
                place=f"{imu.file}: row {row}",
                key=f"column '{imu.interval}'",
                expected="more than 0",
            )
        force = force / interval_s[:, None] if imu.increments[0] else force
        omega = omega / interval_s[:, None] if imu.increments[1] else omega
    bridge = 'linear interpolation, or imu.limits.gap = "inflate" to add the uncertainty of longer ones'
    timed.report.refuse_long_gap(imu, str(imu.file), bridge)
    if handedness(imu.axes) < 0:
        notes.append(f"imu: axes {', '.join(imu.axes)} map left-handed sensor axes to forward–right–down")
    if timed.report.gaps.count:
        notes.append(f"imu: gaps bridged by linear interpolation: {timed.report.gaps.text}")
    if timed.report.jumps.count:
        notes.append(f"imu: clock jumps bridged: {timed.report.jumps.text}")
    mounting = imu.mounting_rpy_rad
    return Inertial(
        timed.time_ns,
        to_platform_axes(force, imu.axes, mounting),
        to_platform_axes(omega, imu.axes, mounting),
    )


def _beams(case: Case, instrument: Instrument, clocks: dict[str, ClockReport], notes: list[str]) -> Beams:
    dvl, geometry = case.dvl, instrument.geometry
    late_ns = round(instrument.stated.clock_offset_s * 1e9)
    if late_ns:
        notes.append(f"dvl: {late_ns * 1e-9:+.4g} s added to the stamps, the clock offset of {dvl.geometry}")
    if dvl.source == "beams":
        columns = instrument.columns
        pings = read_beams(dvl.file, beams=geometry.beams, columns=columns)
        timed = row_times(pings.time_ns, len(pings.time_ns), dvl.clock, place=str(dvl.file))
        kept = timed.rows[:: dvl.every]
        clocks["dvl"] = replace(timed.report, kept=len(kept))
        velocity, valid = pings.velocity_mps[kept], pings.valid[kept]
        grows = instrument.beam_sd_mps_per_m > 0.0 and dvl.beam_noise_from == "geometry"
        ranges = read_beam_table(dvl.file).range_m[kept] if grows else None
        sd = np.ascontiguousarray(_noise(dvl, instrument, kept, valid, ranges))
        return Beams(timed.time_ns[:: dvl.every] + late_ns, velocity, valid, sd, range_m=ranges)
    if instrument.beam_sd_mps_per_m > 0.0:
        raise DataError(
            f"is {instrument.beam_sd_mps_per_m:g}",
            place=str(dvl.file),
            key="dvl.beam_noise_mps_per_m",
            expected='0: beams that are projected from a velocity (source = "velocity") have no range',
        )
    assert dvl.velocity is not None  # validated in DvlStream
    values, timed, table = read_stream(
        dvl, dvl.velocity, lost=lambda read: no_velocity(read * SPEED_SI[dvl.velocity_unit])
    )
    clocks["dvl"] = timed.report
    if timed.report.empty.count:
        notes.append(
            f"dvl: {timed.report.empty.count} rows without a velocity, empty or a code, are left out"
        )
    velocity_d = permute_axes(values * SPEED_SI[dvl.velocity_unit], dvl.axes) / dvl.velocity_scale
    pinged = np.ones(len(velocity_d), dtype=np.bool_)
    if dvl.valid is not None:
        pinged = column_numbers(table, dvl.valid, str(dvl.file), words=True)[timed.rows] == 1.0
    # The geometry holds directions after the mounting; the velocity is in the instrument's frame before it.
    directions_d = from_angles(*instrument.mounting_rpy_rad).inv().apply(geometry.directions_p)
    projected = velocity_d @ directions_d.T
    notes.append(
        f"dvl: {len(velocity_d)} pings of {geometry.beams} beams projected from the velocity (semi-synthetic)"
    )
    valid = np.repeat(pinged[:, None], geometry.beams, axis=1)
    sd = np.broadcast_to(instrument.beam_sd_mps, projected.shape)
    return Beams(timed.time_ns + late_ns, projected, valid, np.ascontiguousarray(sd), velocity_d)


def no_velocity(velocity_mps: Floats) -> Flags:
    """Rows (n,) of codes for "no reading": 0 on every axis, or a velocity that no DVL measures."""
    zero = (velocity_mps == 0.0).all(axis=1)
    return np.asarray(is_code(velocity_mps, zero[:, None]).any(axis=1))


def _noise(
    dvl: DvlStream, instrument: Instrument, rows: Times, valid: Flags, range_m: Floats | None
) -> Floats:
    """(n, B) 1 sigma of each beam: the geometry's, or the instrument's figure of merit; 1 m/s of a lost one without."""
    key, column = "beam_noise_mps_per_m", "range_m"
    if dvl.beam_noise_from == "recording":
        key, column = 'beam_noise_from = "recording"', "sd_mps"
        given = sd = read_beam_table(dvl.file).sd_mps[rows]
    elif range_m is None:
        return np.broadcast_to(instrument.beam_sd_mps, valid.shape)
    else:
        given, sd = range_m, instrument.noise_mps(range_m)
    wrong = np.argwhere(valid & ~(sd > 0.0))
    if wrong.size:
        row, beam = (int(index) for index in wrong[0])
        raise DataError(
            f"is {given[row, beam]}",
            place=f"{dvl.file}: row {rows[row]}",
            key=f"column 'beam{beam + 1}_{column}'",
            expected=f"more than 0: dvl.{key} needs it of every valid beam",
        )
    return np.asarray(np.where(sd > 0.0, sd, LOST_SD_MPS))


def _coordinates(
    stream: PositionStream, key: str, clocks: dict[str, ClockReport]
) -> tuple[Times, dict[str, Floats]]:
    """Times and named columns of a stream with positions, in the units of the file."""
    named = {
        part: name
        for part in ("latitude", "longitude", "height", "north", "east", "down", "roll", "pitch", "yaw")
        if isinstance(name := getattr(stream, part, None), str)
    }
    for part in ("velocity_ned", "velocity_body", "sd"):
        triple = getattr(stream, part, None)
        named |= {} if triple is None else {f"{part}.{k}": name for k, name in enumerate(triple)}
    values, timed, _ = read_stream(stream, list(named.values()))
    clocks[key] = timed.report
    return timed.time_ns, {part: values[:, k] for k, part in enumerate(named)}


def _triple(table: dict[str, Floats], part: str) -> Floats | None:
    """(n, 3) columns of a triple, or None where it is not named."""
    if f"{part}.0" not in table:
        return None
    return np.stack([table[f"{part}.{k}"] for k in range(3)], axis=1)


def has_origin(case: Case) -> bool:
    """Whether the origin of the tangent frame is a place on the Earth: stated, or of geodetic positions."""
    stated = case.origin.latitude_deg is not None and case.origin.longitude_deg is not None
    return stated or any(stream is not None and stream.geodetic for stream in (case.reference, case.gps))


def _origin(case: Case, placed: dict[str, tuple[Times, dict[str, Floats]]]) -> Place | None:
    """Origin of the tangent frame: as the case states, else the first geodetic position of reference or GPS."""
    stated = case.origin
    if stated.latitude_deg is not None and stated.longitude_deg is not None:
        return Place(
            float(np.deg2rad(stated.latitude_deg)), float(np.deg2rad(stated.longitude_deg)), stated.height_m
        )
    for key in ("reference", "gps"):
        stream = getattr(case, key)
        if stream is not None and stream.geodetic:
            table, unit = placed[key][1], ANGLE_SI[stream.angle_unit]
            return Place(
                float(table["latitude"][0] * unit), float(table["longitude"][0] * unit), stated.height_m
            )
    return None


def _positions(
    stream: PositionStream, time_ns: Times, table: dict[str, Floats], origin: Place | None
) -> Positions:
    """Positions of a stream; those that are geodetic also as they are."""
    position_t_m = _tangent(stream, table, origin)
    geodetic = None
    if stream.geodetic and origin is not None:
        degrees = (1.0 if stream.angle_unit == "deg" else np.rad2deg(1.0)) * np.stack(
            [table["latitude"], table["longitude"]], axis=1
        )
        geodetic = np.column_stack([degrees, _heights(table, len(degrees), origin)])
    return Positions(time_ns, position_t_m, _triple(table, "sd"), geodetic)


def _heights(table: dict[str, Floats], count: int, origin: Place) -> Floats:
    """(n,) heights, m: that of the origin in a stream without height or down."""
    if "down" in table:
        return origin.height_m - table["down"]
    return table.get("height", np.full(count, origin.height_m))


def _tangent(stream: PositionStream, table: dict[str, Floats], origin: Place | None) -> Floats:
    """(n, 3) positions in the tangent frame, m; down is 0 in a stream without height or down."""
    count = len(next(iter(table.values())))
    if stream.geodetic:
        if origin is None:
            raise DataError(
                "has latitudes, but origin.longitude_deg is missing",
                place=stream.file,
                hint="give it in [origin]",
            )
        unit = ANGLE_SI[stream.angle_unit]
        height = _heights(table, count, origin)
        return tangent_from_geodetic(table["latitude"] * unit, table["longitude"] * unit, height, origin)
    down = table["down"] if "down" in table else -table["height"] if "height" in table else np.zeros(count)
    return np.stack([table["north"], table["east"], down], axis=1)


def _reference(
    stream: ReferenceStream,
    placed: tuple[Times, dict[str, Floats]],
    origin: Place | None,
    inertial: Inertial,
) -> ReferenceStates:
    """Reference states moved over the lever arm from the reference point to the IMU."""
    time_ns, table = placed
    lever = np.array(stream.lever_arm_m)
    attitude = None
    if stream.has_attitude:
        unit = ANGLE_SI[stream.attitude_unit]
        attitude = from_angles(*(table[part] * unit for part in ("roll", "pitch", "yaw")))
    position = _tangent(stream, table, origin) if stream.has_position else None
    velocity = None
    for part in ("velocity_ned", "velocity_body"):
        if f"{part}.0" in table:
            velocity = _triple(table, part)
            if part == "velocity_ned" and attitude is not None:
                velocity = attitude.inv().apply(velocity)
    if lever.any() and attitude is not None:
        position = None if position is None else position - attitude.apply(lever)
        # The next gyro reading; the Earth's rate times a lever arm of metres is below 1 mm/s.
        nearest = np.clip(np.searchsorted(inertial.time_ns, time_ns), 0, len(inertial.time_ns) - 1)
        velocity = None if velocity is None else velocity - np.cross(inertial.omega_p_radps[nearest], lever)
    return ReferenceStates(
        time_ns, position, velocity, attitude, has_down="down" in table or "height" in table
    )
