"""A first case: every stream of the given files, each guess with its reason, each unknown as a question."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bottomlock.errors import DataError, ScenarioError
from bottomlock.files.atomic_write import write_text
from bottomlock.io.columns import column_names
from bottomlock.plant.surroundings import world_magnetic_model
from bottomlock.replay.case import parse_case
from bottomlock.replay.init.axes_part import (
    recorded,
    set_axes,
    set_yaw_by_track,
    track_yaw,
    turns,
    unit_by_attitude,
)
from bottomlock.replay.init.clocks import dvl_offset
from bottomlock.replay.init.draft import Entry, toml_of
from bottomlock.replay.init.dvl_part import (
    ENOUGH_PINGS,
    DvlPart,
    dvl_of_recording,
    dvl_of_velocity,
    set_noise,
)
from bottomlock.replay.init.files import Files
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.imu_part import ImuPart, guess_imu
from bottomlock.replay.init.no_imu import imu_of_attitude, noise_of_pings
from bottomlock.replay.init.other_parts import AttitudePart, guess_attitude, guess_depth
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.positions import PositionPart, choose_positions, guess_positions
from bottomlock.replay.init.sections import draft
from bottomlock.replay.init.sources import Sources, read_sources
from bottomlock.replay.motion.ping_noise import ping_noise

CONFIRMED = 0.5
"""Correlation of the rates on every axis from which an attitude confirms the axes of the IMU."""


@dataclass(frozen=True, eq=False)
class Made:
    """A case as written.

    Attributes:
        case, written: its path, and the tables written beside it.
        words: what the files hold.
        entries: of the case.
    """

    case: Path
    written: list[Path]
    words: list[str]
    entries: list[Entry]

    @property
    def guesses(self) -> int:
        """Number of guesses with their reasons."""
        return sum(bool(one.why) and one.known is True for one in self.entries)

    @property
    def questions(self) -> int:
        """Number of questions that the files leave open."""
        return sum(bool(one.why) and one.known is False for one in self.entries)


def make_case(files: Sequence[Path], out: Path, *, force: bool = False, without: Sequence[str] = ()) -> Made:
    """Looks at recorded files and writes a case that runs at once, with tables beside it where they are needed.

    Args:
        files: logs of a DVL, tables, bags and logs of autopilots.
        out: the case to write.
        force: overwrite files.
        without: topics and messages of logs that are left out.

    Raises:
        DataError: for files without an IMU and an attitude, or without a DVL, or one that cannot be read.
        OutputError: where a file exists already or cannot be written.
    """
    target = Files(out, force, files)
    target.check(out)
    sources = read_sources(files, without)
    parts = choose(sources)
    entries = draft(parts, sources, target)
    text = toml_of(entries)
    written = target.write()
    parse_case(text, place=str(out), folder=out.parent)
    write_text(out, text)
    return Made(out, written, sources.words, entries)


def choose(sources: Sources) -> Parts:
    """The streams of a case, with clocks and axes.

    Raises:
        DataError: where there is neither an IMU nor an attitude, or no DVL.
    """
    own = [one for one in sources.of("attitude") if one.times.time_ns is not None]
    made = _made(sources, own)
    velocities = [one for one in sources.of("velocity") if one.times.time_ns is not None]
    if sources.recording is None and not velocities:
        raise _no_dvl(sources)
    velocities.sort(key=lambda one: "dvl" not in one.table.label)
    found_imu = made.found if made else max(sources.of("imu"), key=lambda one: one.table.frame.height)
    if sources.recording is not None and sources.recording.table.beams:
        dvl = dvl_of_recording(sources.recording)
    elif sources.recording is not None:
        raise DataError(
            "holds velocities without beams",
            place=sources.log,
            hint="convert it with --instrument-only and write the case by hand",
        )
    else:
        dvl = dvl_of_velocity(velocities[0])
    _check_pings(dvl, sources)
    duration_s = _duration_s(sources, dvl)
    imu = guess_imu(found_imu, duration_s) if made is None else made
    dvl.offset = dvl_offset(dvl, imu)
    places = [one for one in sources.of("geodetic", "local") if one.times.time_ns is not None]
    reference, gps = choose_positions(places)
    own.sort(key=lambda one: reference is not None and one.table is reference.table)
    if made is not None:
        own = [made.found]
    attitude = guess_attitude(own[0], imu, dvl) if own else None
    unit = None if imu.made else unit_by_attitude(imu, attitude)
    if unit is not None:
        imu = guess_imu(found_imu, duration_s, unit)
        attitude = guess_attitude(own[0], imu, dvl)
    sensed = [one for one in sources.of("depth", "pressure") if one.times.time_ns is not None]
    sensed.sort(key=lambda one: (one.kind != "depth", "depth" not in one.table.label))
    depth = guess_depth(sensed[0], imu, dvl) if sensed else None
    parts = Parts(imu, dvl, attitude, depth, None, None, [])
    if gps is not None:
        parts.gps = guess_positions(gps, imu, dvl, attitude)
    if reference is not None:
        parts.reference = guess_positions(reference, imu, dvl, attitude)
    if not parts.attitude_of_reference:
        set_declination(attitude, parts.reference or parts.gps)
    if imu.made:
        set_noise(dvl, noise_of_pings(dvl))
        set_yaw_by_track(dvl, attitude, track_yaw(dvl, attitude, parts.reference))
    elif len(dvl.time_ns) > ENOUGH_PINGS:
        _compare(parts)
    else:
        dvl.questions.append(
            f"only {len(dvl.time_ns)} pings give a whole velocity: clock and axes could not be compared"
        )
    used = {
        id(one)
        for one in (
            found_imu, attitude and attitude.found, depth and depth.found, parts.gps and parts.gps.found,
            parts.reference and parts.reference.found, dvl.found,
        )
    }  # fmt: skip
    parts.unused = [one for one in sources.streams if id(one) not in used]
    return parts


def _no_dvl(sources: Sources) -> DataError:
    for one in sources.of("velocity"):
        return DataError(
            f"has a velocity and no column of times ({column_names(one.table.frame)})",
            place=one.table.path,
            hint="name a column time: numbers, or ISO 8601 such as 2024-05-01T12:00:00.5Z",
        )
    return DataError(
        f"no file holds a DVL ({_held(sources)}): name its log, or a table with columns such as vx, vy, vz"
    )


LEAST_RISING = 0.1
"""Part of the pings whose times rise, below which the column is none of times."""


def _check_pings(dvl: DvlPart, sources: Sources) -> None:
    """Raises DataError where hardly a ping has a time after the ping before it."""
    found = dvl.found
    if found is None:
        assert dvl.recording is not None  # one of them
        pings = rows = len(dvl.recording.table.time_ns)
        place = str(sources.log)
    else:
        times = found.times.time_ns
        assert times is not None  # refused without
        pings, rows, place = len(np.unique(np.maximum.accumulate(times))), len(times), str(found.table.path)
    if pings < max(LEAST_RISING * rows, 2):
        raise DataError(
            f"has a time that rises in {pings} of {rows} pings", place=place,
            key="clock of the DVL", expected="a column or field of times that rises from ping to ping",
            hint="stamps of 0, stamps that repeat, or intervals in the place of times?",
        )  # fmt: skip


def _made(sources: Sources, attitudes: list[Found]) -> ImuPart | None:
    """An IMU made from an attitude, where no file holds one; None where one does."""
    if sources.of("imu"):
        return None
    made = imu_of_attitude(attitudes)
    if made is None:
        raise DataError(
            f"no file holds specific force and angular rate ({_held(sources)})",
            hint=(
                "a replay needs both, or an attitude with times: name the table of the IMU, with "
                "columns such as ax, ay, az, wx, wy, wz"
            ),
        )
    return made


def _compare(parts: Parts) -> None:
    """Axes, clock and noise by comparing IMU, DVL and attitude with one another."""
    dvl, attitude = parts.dvl, parts.attitude
    interval_s = float(np.median(np.diff(dvl.time_ns))) * 1e-9
    confirmed = attitude is not None and attitude.match is not None and attitude.match.least > CONFIRMED
    turned = turns(parts.imu, attitude, interval_s, parts.latitude_rad) if confirmed else None
    track = None if parts.attitude_of_reference else track_yaw(dvl, attitude, parts.reference)
    parts.imu = set_axes(dvl, parts.imu, attitude, turned, track)
    if attitude is not None:
        again = guess_attitude(attitude.found, parts.imu, dvl)
        if again is not None:
            again.declination_rad, again.declination_why = attitude.declination_rad, attitude.declination_why
        attitude = parts.attitude = again
    known = turns(parts.imu, attitude, interval_s, parts.latitude_rad)
    parts.gyros = known.gyros
    parts.pings = ping_noise(recorded(parts.imu, dvl, known.omega_p_radps))
    if known.of_attitude and known.gyros is not None and parts.pings is not None:
        # The force is integrated with the gyros' rotation by a filter, too, so that their part in its error counts.
        own = ping_noise(recorded(parts.imu, dvl, parts.imu.omega_p_radps - known.gyros.offset_radps))
        felt = parts.pings.force_mps_rts if own is None else max(own.force_mps_rts, parts.pings.force_mps_rts)
        parts.pings = replace(parts.pings, force_mps_rts=felt)
    set_noise(dvl, parts.pings)


def _held(sources: Sources) -> str:
    return "; ".join(sources.words)


def _duration_s(sources: Sources, dvl: DvlPart) -> float | None:
    """Length of the other streams, s, for an IMU without times."""
    lengths = [(dvl.last_ns - dvl.first_ns) * 1e-9]
    lengths += [
        float(one.times.time_ns[-1] - one.times.time_ns[0]) * 1e-9
        for one in sources.streams
        if one.times.time_ns is not None and len(one.times.time_ns) > 2
    ]
    return float(np.max(lengths)) if max(lengths) > 0.0 else None


YEAR_S = 365.2425 * 86_400.0


def set_declination(attitude: AttitudePart | None, positions: PositionPart | None) -> None:
    """Adds the declination to the yaw of an attitude, which the case asks about; or notes why it is not known.

    Args:
        attitude: as guessed; its yaw is taken to be magnetic.
        positions: any recorded positions, for the place.
    """
    if attitude is None:
        return
    times = attitude.found.times
    if (
        positions is None
        or not math.isfinite(positions.latitude_rad)
        or not times.epoch
        or times.time_ns is None
    ):
        attitude.declination_why = "is the yaw magnetic? Then yaw_offset_deg is the declination"
        return
    year = 1970.0 + float(times.time_ns[0]) * 1e-9 / YEAR_S
    try:
        field = world_magnetic_model(positions.latitude_rad, positions.longitude_rad, year)
    except ScenarioError as error:
        reason = str(error).removeprefix("magnetometer: ")
        attitude.declination_why = (
            f"is the yaw magnetic? Then yaw_offset_deg is the declination. Not found: {reason}"
        )
        return
    attitude.declination_rad = field.declination_rad
    attitude.declination_why = f"declination of {year:.1f} (World Magnetic Model); 0 where the yaw is true"
