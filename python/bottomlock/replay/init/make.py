"""A first case: every stream of the given files, each guess with its reason, each unknown as a question."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bottomlock.errors import DataError, ScenarioError
from bottomlock.files.atomic_write import write_text
from bottomlock.files.overwriting import check_free
from bottomlock.io.columns import column_names
from bottomlock.plant.surroundings import world_magnetic_model
from bottomlock.replay.case import parse_case
from bottomlock.replay.init.against_imu import clock_offset, dvl_offset, unit_by_attitude
from bottomlock.replay.init.attitude_part import AttitudePart, guess_attitude, imu_of_attitude
from bottomlock.replay.init.depth_part import guess_depth
from bottomlock.replay.init.dvl_part import ENOUGH_PINGS, DvlPart, dvl_of_recording, dvl_of_velocity
from bottomlock.replay.init.entries import FILES, Entry, placed, questions, toml_of
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Guess
from bottomlock.replay.init.imu_part import ImuPart, guess_imu
from bottomlock.replay.init.positions import PositionPart, choose_positions, guess_positions
from bottomlock.replay.init.rig import Parts, by_attitude, by_motion
from bottomlock.replay.init.sections import entries_of
from bottomlock.replay.init.sources import Sources, read_sources

CASE = Path("case.toml")


@dataclass(frozen=True, eq=False)
class Made:
    """A case as written.

    Attributes:
        case, written: its path, and the tables written beside it.
        entries: of the case.
    """

    case: Path
    written: list[Path]
    entries: list[Entry]

    @property
    def words(self) -> list[str]:
        """What the files hold."""
        return [one.why for one in self.entries if one.key == FILES]

    @property
    def guesses(self) -> int:
        """Number of guesses with their reasons."""
        return sum(bool(one.why) and one.known is True for one in self.entries)

    @property
    def questions(self) -> list[str]:
        """Questions that the files leave open."""
        return questions(self.entries)


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
    check_free(out, inputs=files, force=force)
    entries, beside = placed(draft(files, without, out), out, files, force=force)
    text = toml_of(entries)
    for path, file in beside.items():
        file.write(path)
    parse_case(text, place=str(out), folder=out.parent)
    write_text(out, text)
    return Made(out, list(beside), entries)


def draft(files: Sequence[Path], without: Sequence[str] = (), case: Path = CASE) -> list[Entry]:
    """The entries of a first case: every key with its value, why, and whether the files decide it.

    Args:
        files: logs of a DVL, tables, bags and logs of autopilots.
        without: topics and messages of logs that are left out.
        case: where it is to stand, which names it.

    Raises:
        DataError: for files without an IMU and an attitude, or without a DVL, or one that cannot be read.
    """
    sources = read_sources(files, without)
    return entries_of(choose(sources), sources.words, case)


def choose(sources: Sources) -> Parts:
    """The streams of a case, with clocks and axes.

    Raises:
        DataError: where there is neither an IMU nor an attitude, or no DVL.
    """
    attitudes = sources.timed("attitude")
    made = _made(sources, attitudes)
    dvl = _dvl(sources)
    found_imu = made.found if made else max(sources.of("imu"), key=lambda one: one.table.frame.height)
    duration_s = _duration_s(sources, dvl)
    imu = guess_imu(found_imu, duration_s) if made is None else made
    dvl = replace(dvl, offset=dvl_offset(dvl, imu))
    reference, gps = choose_positions(sources.timed("geodetic", "local"))
    if made is not None:
        attitudes = [made.found]
    attitudes.sort(key=lambda one: reference is not None and one.table is reference.table)
    attitude = guess_attitude(attitudes[0], imu, clock_offset(attitudes[0], imu, dvl)) if attitudes else None
    unit = None if imu.made else unit_by_attitude(imu, attitude)
    if unit is not None:
        imu = guess_imu(found_imu, duration_s, unit)
        attitude = guess_attitude(attitudes[0], imu, clock_offset(attitudes[0], imu, dvl))
    sensed = sources.timed("depth", "pressure")
    sensed.sort(key=lambda one: (one.kind != "depth", "depth" not in one.table.label))
    depth = guess_depth(sensed[0], imu, clock_offset(sensed[0], imu, dvl)) if sensed else None
    at_gps, at_reference = (_positions(one, imu, dvl, attitude) for one in (gps, reference))
    parts = Parts(imu, dvl, attitude, depth, at_gps, at_reference)
    if attitude is not None and not parts.attitude_of_reference:
        parts = replace(parts, attitude=with_declination(attitude, parts.reference or parts.gps))
    used = [id(one.found) for one in (imu, dvl, attitude, depth, at_gps, at_reference) if one is not None]
    parts = replace(parts, unused=[one for one in sources.streams if id(one) not in used])
    if imu.made:
        return by_attitude(parts)
    if len(dvl.time_ns) > ENOUGH_PINGS:
        return by_motion(parts)
    why = f"as recorded: only {len(dvl.time_ns)} pings give a whole velocity to compare it with the IMU"
    return replace(parts, dvl=dvl.saying("clock", why))


def _positions(
    found: Found | None, imu: ImuPart, dvl: DvlPart, attitude: AttitudePart | None
) -> PositionPart | None:
    if found is None:
        return None
    shared = attitude is not None and attitude.found.table is found.table
    offset = attitude.offset if attitude is not None and shared else clock_offset(found, imu, dvl)
    return guess_positions(found, dvl.on_imu_ns, offset)


def _dvl(sources: Sources) -> DvlPart:
    """The DVL: the beams of its log, or a velocity.

    Raises:
        DataError: where no file holds either with times.
    """
    recording, velocities = sources.recording, sources.timed("velocity")
    if recording is None and not velocities:
        raise _no_dvl(sources)
    if recording is None:
        dvl = dvl_of_velocity(min(velocities, key=lambda one: "dvl" not in one.table.label))
    elif recording.table.beams:
        dvl = dvl_of_recording(recording, sources.log)
    else:
        raise DataError(
            "holds velocities without beams",
            place=sources.log,
            hint="convert it with --instrument-only and write the case by hand",
        )
    _check_pings(dvl, sources)
    return dvl


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
    if dvl.recording is not None:
        pings = rows = len(dvl.recording.table.time_ns)
        place = str(sources.log)
    else:
        assert dvl.found is not None  # one of them
        times = dvl.found.times.time_ns
        assert times is not None  # refused without
        pings, rows = len(np.unique(np.maximum.accumulate(times))), len(times)
        place = str(dvl.found.table.path)
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
            hint="a replay needs both, or an attitude with times: name the table of the IMU, with columns such as ax, "
            "ay, az, wx, wy, wz",
        )
    return made


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


def with_declination(attitude: AttitudePart, positions: PositionPart | None) -> AttitudePart:
    """The attitude with the declination in its yaw, or with why that is not known.

    Args:
        attitude: as guessed; its yaw is taken to be magnetic.
        positions: any recorded positions, for the place.
    """
    times = attitude.found.times
    unknown = "the yaw is taken to be true; of a magnetic one it is the declination"
    if (
        positions is None
        or not math.isfinite(positions.latitude_rad)
        or not times.epoch
        or times.time_ns is None
    ):
        return replace(attitude, declination=Guess(0.0, unknown))
    year = 1970.0 + float(times.time_ns[0]) * 1e-9 / YEAR_S
    try:
        field = world_magnetic_model(positions.latitude_rad, positions.longitude_rad, year)
    except ScenarioError as error:
        reason = str(error).removeprefix("magnetometer: ")
        return replace(attitude, declination=Guess(0.0, f"{unknown}. Not found: {reason}"))
    why = f"declination of {year:.1f} (World Magnetic Model); 0 where the yaw is true"
    return replace(attitude, declination=Guess(field.declination_rad, why))
