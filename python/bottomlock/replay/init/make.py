"""A first case: every stream of the given files, each guess with its reason, each unknown as a question."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bottomlock.atomic_write import write_text
from bottomlock.errors import DataError
from bottomlock.replay.case import parse_case
from bottomlock.replay.init import sections
from bottomlock.replay.init.dvl_part import (
    ENOUGH_PINGS,
    DvlPart,
    dvl_of_recording,
    dvl_of_velocity,
    set_axes,
    set_clock,
)
from bottomlock.replay.init.files import Files
from bottomlock.replay.init.imu_part import guess_imu
from bottomlock.replay.init.other_parts import (
    guess_attitude,
    guess_depth,
    is_reference,
)
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.sources import Sources, read_sources

CONFIRMED = 0.5
"""Correlation of the rates on every axis from which an attitude confirms the axes of the IMU."""


@dataclass(frozen=True, eq=False)
class Made:
    """A case as written: its path, the tables written beside it, what the files hold, and how many questions it has."""

    case: Path
    written: list[Path]
    words: list[str]
    guesses: int
    questions: int


def make_case(files: Sequence[Path], out: Path, *, force: bool = False) -> Made:
    """Looks at recorded files and writes a case that runs at once, with tables beside it where they are needed.

    Args:
        files: logs of a DVL, tables and bags.
        out: the case to write.
        force: overwrite files.

    Raises:
        DataError: for files without an IMU or a DVL, or one that cannot be read.
        OutputError: where a file exists already or cannot be written.
    """
    target = Files(out, force)
    target.check(out)
    sources = read_sources(files)
    parts = choose(sources)
    text = sections.case_text(parts, sources, target)
    parse_case(text, place=str(out), folder=out.parent)
    write_text(out, text)
    lines = text.splitlines()
    return Made(
        out, target.written, sources.words, sum("# guessed:" in line for line in lines),
        sum("# ?" in line for line in lines),
    )  # fmt: skip


def choose(sources: Sources) -> Parts:
    """The streams of a case, with clocks and axes.

    Raises:
        DataError: where there is no IMU or no DVL.
    """
    imus = sources.of("imu")
    if not imus:
        raise DataError(
            f"no file holds specific force and angular rate ({_held(sources)}); a replay needs both: name the "
            "table of the IMU, "
            "with columns such as ax, ay, az, wx, wy, wz"
        )
    velocities = [one for one in sources.of("velocity") if one.times.time_ns is not None]
    if sources.recording is None and not velocities:
        raise DataError(
            f"no file holds a DVL ({_held(sources)}): name its log, or a table with columns such as vx, vy, vz"
        )
    velocities.sort(key=lambda one: "dvl" not in one.table.path.stem.lower())
    found_imu = max(imus, key=lambda one: one.table.frame.height)
    if sources.recording is not None and sources.recording.table.beams:
        dvl = dvl_of_recording(sources.recording)
    elif sources.recording is not None:
        raise DataError(
            f"{sources.log}: holds velocities without beams; convert it with --instrument-only and write the "
            "case by hand"
        )
    else:
        dvl = dvl_of_velocity(velocities[0])
    imu = guess_imu(found_imu, _duration_s(sources, dvl))
    set_clock(dvl, imu)
    places = [one for one in sources.of("geodetic", "local") if one.times.time_ns is not None]
    reference = next((one for one in places if is_reference(one, len(places))), None)
    gps = next((one for one in places if one is not reference), None)
    attitudes = sources.of("attitude")
    own = [one for one in attitudes if reference is None or one.table is not reference.table] or attitudes
    own = [one for one in own if one.times.time_ns is not None]
    attitude = guess_attitude(own[0], imu, dvl) if own else None
    sensed = [one for one in sources.of("depth", "pressure") if one.times.time_ns is not None]
    sensed.sort(key=lambda one: (one.kind != "depth", "depth" not in one.table.path.stem.lower()))
    depth = guess_depth(sensed[0], imu, dvl) if sensed else None
    if len(dvl.time_ns) > ENOUGH_PINGS:
        confirmed = attitude is not None and attitude.match is not None and attitude.match.least > CONFIRMED
        imu = set_axes(dvl, imu, imu_confirmed=confirmed)
        attitude = guess_attitude(own[0], imu, dvl) if own else None
    else:
        dvl.questions.append(
            f"only {len(dvl.time_ns)} pings give a whole velocity: clock and axes could not be compared"
        )
    used = {
        id(one)
        for one in (found_imu, attitude and attitude.found, depth and depth.found, gps, reference, dvl.found)
    }
    unused = [one for one in sources.streams if id(one) not in used]
    return Parts(imu, dvl, attitude, depth, gps, reference, unused)


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
