"""The sections of a first case, each as entries of what was read and compared; nothing is written or changed here."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.atomic_write import write_parquet, write_text
from bottomlock.io.beam_table import Recording, sidecar, water_file, write_recording
from bottomlock.io.beams import geometry_text
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.kernel.models import ImuLimits
from bottomlock.recordings.rotation import UNCHANGED_AXES
from bottomlock.recordings.streams import Integers
from bottomlock.replay.init.attitude_part import AttitudePart
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.entries import FILES, Beside, Entry, questions, remark
from bottomlock.replay.init.errors import attitude_noise, imu_errors, vehicle_prior
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Guess, round_up
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.init.positions import PositionPart
from bottomlock.replay.init.rig import Parts
from bottomlock.replay.init.start import start

HEAD = (
    "A first case, written from the files below. It runs as it is: bottomlock replay CASE --out DIR",
    '"guessed:" gives the reason of a guess. What is "assumed:" is not in the files: change it where it is otherwise.',
    "`assumed` lists these keys: take out what is known. A question (?) decides all keys that it names.",
)
LONG_TERM_PERCENT, LONG_TERM_MPS = 0.5, 0.002
"""Errors of a DVL that last: the caution of what data sheets state."""
RPY = ("roll", "pitch", "yaw")
LONGEST_GAP_S = 1.0 / ImuLimits().gap_rate_sd_radps
"""After which the turn that nobody saw is unknown by a radian: the kernel's limit."""


def entries_of(parts: Parts, words: Sequence[str], case: Path) -> list[Entry]:
    """The entries of a case, of its streams and what its files hold."""
    entries = [
        *_origin(parts), *(_made_imu(parts.imu) if parts.imu.made else [*_imu(parts.imu), *imu_errors(parts)]),
        *_dvl(parts.dvl), *_dvl_errors(), *_depth(parts), *_attitude(parts), *_gps(parts), *_reference(parts),
        *_water(parts.dvl, case), *start(parts), *vehicle_prior(parts), *_methods(),
    ]  # fmt: skip
    return [*_head(parts, words, case.stem, entries), *entries]


def _head(parts: Parts, held: Sequence[str], name: str, entries: list[Entry]) -> Iterator[Entry]:
    """What the files hold, and what they leave open."""
    for words in (*HEAD, *(f"? {one}" for one in questions(entries))):
        yield remark("", words)
    for words in held:
        yield Entry(FILES, why=words, known=None)
    for one in parts.unused:
        of = f"{one.table.part} of " if one.table.part else ""
        yield remark(
            "", f"  not used: {one.kind} of {of}{one.table.path.name} ({', '.join(one.columns.values())})"
        )
    yield Entry("name", "".join(c if c.isalnum() or c in "_-" else "_" for c in name))
    keys = dict.fromkeys(one.key for one in entries if one.known is False and one.why)
    yield Entry("assumed", list(keys))


def _methods() -> Iterator[Entry]:
    yield Entry("replay.methods", ["ins", "lc", "tc"])
    yield remark(
        "replay",
        "tc assumes nothing of the vehicle. Every method side by side: leave the line above out; "
        f"{RECOMMENDED_METHOD}, which README recommends, is for a slender vehicle, and for one with "
        'lateral thrusters (ROV, hovering AUV) with vehicle = "hovering" in [filter.water] (docs/hovering.md)',
    )


def _origin(parts: Parts) -> Iterator[Entry]:
    if any(one is not None and one.unit is not None for one in (parts.reference, parts.gps)):
        yield remark("origin", "the first position of the reference or GPS is the origin")
    else:
        yield Entry("origin.latitude_deg", 45.0, "no position is recorded", known=False, asks="where")


def table(
    found: Found, name: str, columns: dict[str, Any] | None = None
) -> tuple[Path | Beside, dict[str, Any], dict[str, str]]:
    """File, clock and column names of a stream: the user's own table where a replay can read it, else one to write.

    Args:
        found: the stream.
        name: of a table to write, after the case's.
        columns: values by role, which have to be written.
    """
    times, roles = found.times, {**found.columns, **found.extra}
    none = times.time_ns is None
    if found.table.plain and columns is None and (times.column or none):
        clock = {} if none else {"column": times.column, "unit": times.unit}
        even = {} if times.rate_hz is None else {"rate_hz": times.rate_hz, "steady_within_s": times.within_s}
        return found.table.path, clock | (even or _unordered(times.time_ns)), roles
    if columns is None:
        content = {column: found.values(role)[:, 0] for role, column in roles.items() if role != "increments"}
    else:
        content, roles = columns, {role: role for role in columns}
    stamps = {} if none else {"time_ns": times.time_ns}
    frame = pl.DataFrame(stamps | content).with_columns(pl.col(pl.Float64).fill_nan(None))
    # Times that were evened are written as they are used.
    clock = {} if none else {"column": "time_ns", "unit": "ns"} | _unordered(times.time_ns)
    return Beside(name, lambda path: write_parquet(path, frame)), clock, roles


def _unordered(time_ns: Integers | None) -> dict[str, str]:
    """The clock's key for rows that repeat a time or go back."""
    return {} if time_ns is None or (np.diff(time_ns) > 0).all() else {"unordered": "drop"}


def _clock(section: str, clock: dict[str, Any], offset: Guess, why: str = "") -> Entry:
    """The clock of a stream, with the reasons of its times and of its offset."""
    moved = {"offset_s": round(float(offset.value), 6)} if offset.value else {}
    words = "; ".join(filter(None, (why, offset.why)))
    return Entry(f"{section}.clock", clock | moved, words, known=offset.known, asks="dive")


def _made_imu(imu: ImuPart) -> Iterator[Entry]:
    yield Entry("imu.source", "attitude", "no file holds specific force and angular rate (docs/no_imu.md)")
    steps_s = np.diff(imu.time_ns) * 1e-9
    longest = float(steps_s.max())
    if longest > 3.0 * float(np.median(steps_s)):
        why = f"in steps of up to {longest:.3g} s of the attitude the vehicle turns at a constant rate"
        yield Entry("imu.bridge_gaps_s", round_up(longest), why, known=False)


def _imu(imu: ImuPart) -> Iterator[Entry]:
    found, columns = imu.found, None
    if imu.force.factor != 1.0 or len(imu.rows) + imu.unordered != found.table.frame.height:
        # A case needs six numbers in every row of the IMU; times out of order are dropped by the clock.
        roles = [f"{kind}{k}" for kind in ("force", "omega") for k in range(3)]
        columns = {
            role: found.values(role)[imu.rows, 0] * (imu.force.factor if role.startswith("force") else 1.0)
            for role in roles
        }
        if "interval" in found.extra:
            columns["interval"] = found.values("interval")[imu.rows, 0]
        # Another stream of the same table keeps the times of all rows.
        times = found.times
        found = replace(found, times=replace(times, time_ns=None if times.time_ns is None else imu.time_ns))
    file, clock, names = table(found, "imu", columns)
    yield Entry("imu.file", file)
    if imu.even_hz is not None:
        why = "no column of times: rows over the length of the other streams"
        yield Entry("imu.clock", {"rate_hz": imu.even_hz}, why, known=False, asks="dive")
    else:
        yield Entry("imu.clock", clock, found.times.why)
    if imu.unordered and imu.even_hz is None and "unordered" in clock:
        yield remark(
            "imu",
            f"{imu.unordered} rows repeat a time or go back, the first of them row {imu.first_unordered}: they are "
            "left out",
        )
    for words in imu.left_out:
        yield remark("imu", words)
    yield Entry("imu.force", [names[f"force{k}"] for k in range(3)])
    yield Entry("imu.omega", [names[f"omega{k}"] for k in range(3)])
    if imu.increments:
        yield Entry("imu.force_unit", "m/s", f"increments: over the interval {imu.force.why}")
        why = f"increments: {imu.omega.why}"
        yield Entry("imu.omega_unit", "rad", why, known=imu.omega.known, asks="instrument")
        if "interval" in names:
            yield Entry("imu.interval", names["interval"])
    else:
        yield imu.force.entry("imu.force_unit")
        yield imu.omega.entry("imu.omega_unit", "instrument")
    why = imu.axes_why
    if not imu.axes_known:
        why += ": forward, right, down; gravity does not show which axis looks forward"
    if imu.tilted:
        why += f"; {imu.tilted}"
    known = imu.axes_known and not imu.tilted
    yield Entry("imu.axes", imu.axis_names, why, known=known, asks="instrument")
    yield from _gaps(imu)


def _gaps(imu: ImuPart) -> Iterator[Entry]:
    """How long steps between readings are bridged, where some are longer than usual."""
    steps_s = np.diff(imu.time_ns) * 1e-9
    longest = float(steps_s.max())
    if longest > 3.0 * float(np.median(steps_s)):
        why = f"the longest step between readings is {longest:.3g} s"
        yield Entry("imu.bridge_gaps_s", min(round_up(longest), 1.0), why)
        if longest > LONGEST_GAP_S:
            raise DataError(
                f"has no six numbers for {longest:.3g} s, after which an attitude is unknown",
                place=imu.found.table.path, expected=f"gaps of at most {LONGEST_GAP_S:g} s", hint="cut the files there",
            )  # fmt: skip
        if longest > 1.0:
            why = "longer gaps: the filter adds the uncertainty of unseen motion"
            yield Entry("imu.limits", {"gap": "inflate"}, why)


def _dvl(dvl: DvlPart) -> Iterator[Entry]:
    if dvl.recording is not None:
        assert dvl.log is not None  # set with the recording
        yield Entry("dvl.file", _beams(dvl.recording, dvl.log), f"converted from {dvl.log.name}", None)
        yield _clock("dvl", {"column": "time_ns", "unit": "ns"}, dvl.offset)
    else:
        assert dvl.found is not None  # one of the two
        file, clock, names = table(dvl.found, "dvl")
        why = "no beams were recorded: they are projected from the velocity, semi-synthetic"
        yield Entry("dvl.source", "velocity", why)
        yield Entry("dvl.file", file, dvl.found.table.remark, known=None)
        yield _clock("dvl", clock, dvl.offset, dvl.found.times.why)
        yield Entry("dvl.velocity", [names[f"v{k}"] for k in range(3)])
        if dvl.axes != UNCHANGED_AXES:
            yield Entry("dvl.axes", dvl.axes, "the velocity follows the IMU in left-handed axes alone")
        yield dvl.unit.entry("dvl.velocity_unit", "instrument")
        if "valid" in names:
            yield Entry("dvl.valid", names["valid"])
    yield replace(dvl.geometry, value=_geometry(dvl)).entry("dvl.geometry", "instrument")
    if dvl.mounting_why:
        angles = ", ".join(f"{angle:g}" for angle in dvl.mounting_deg)
        yield remark("dvl", f"mounting (roll, pitch, yaw) is {angles} deg: {dvl.mounting_why}")
    if dvl.noise is not None:
        yield dvl.noise.entry("dvl.beam_noise_mps")
    yield from dvl.further
    yield from _departures(dvl)


def _beams(recording: Recording, source: Path) -> Beside:
    """A beam table, its account and the water's beams."""
    return Beside(
        "beams", lambda path: write_recording(recording, path, source=source), further=(sidecar, water_file)
    )


def _dvl_errors() -> Iterator[Entry]:
    sheets = "data sheets state 0.1 to 1 % and 1 to 2 mm/s over long times (Workhorse Navigator, A50)"
    yield Entry("dvl.errors.scale_factor_percent", LONG_TERM_PERCENT, sheets, known=False)
    yield Entry("dvl.errors.beam_bias_mps", LONG_TERM_MPS)


def _geometry(dvl: DvlPart) -> str | Beside:
    """A packaged name, or a file beside the case where directions or mounting are the log's own."""
    if not dvl.geometry_text and not any(dvl.mounting_deg):
        return str(dvl.geometry.value)
    angles = zip(RPY, dvl.mounting_deg, strict=True)
    lines = [f"mounting_{name}_deg = {angle}\n" for name, angle in angles if angle]
    text = "".join(lines) + (dvl.geometry_text or geometry_text(dvl.geometry.value))
    return Beside("dvl", lambda path: write_text(path, text), ".toml")


def _departures(dvl: DvlPart) -> Iterator[Entry]:
    """What the comparison of the velocity with the IMU suggests beyond five standard deviations, and is not applied."""
    match = dvl.match
    if match is None or not match.plausible:
        return
    angles, sds = np.rad2deg(match.part("rotation")), np.rad2deg(match.part_sd("rotation"))
    for axis, angle, sd in zip(RPY, angles, sds, strict=True):
        if abs(angle) > max(5.0 * sd, 2.0):
            why = (
                f"0 in the geometry file; the velocity follows the IMU best with {angle:+.1f} ± {sd:.1g} deg"
            )
            yield Entry(f"dvl.mounting_{axis}_deg", why=why, known=False, asks="instrument")
    lever, sd_m = match.part("lever"), match.part_sd("lever")
    if float(np.linalg.norm(lever)) > 0.2 and (np.abs(lever) > 5.0 * sd_m).any():
        words = ", ".join(f"{x:+.2f} ± {s:.1g}" for x, s in zip(lever, sd_m, strict=True))
        why = f"the DVL moves as if it were at {words} m from the IMU: lever_arms_m of the geometry file"
        yield Entry("dvl.lever_arms_m", why=why, known=False, asks="instrument")


def _depth(parts: Parts) -> Iterator[Entry]:
    depth = parts.depth
    if depth is None:
        return
    file, clock, names = table(depth.found, "depth")
    yield Entry("depth.file", file)
    yield _clock("depth", clock, depth.offset, depth.found.times.why)
    yield Entry("depth.column", next(iter(names.values())))
    asks = "instrument" if depth.found.kind == "pressure" else ""
    yield depth.unit.entry("depth.unit", asks)
    if depth.up is not None:
        yield depth.up.entry("depth.up")
    if depth.offset_m is not None:
        yield depth.offset_m.entry("depth.offset_m")
    yield Entry("depth.sd_m", depth.sd_m, "twice the scatter from reading to reading")
    if depth.waves is not None:
        why = "it moves so with a mean period of some seconds, and the accelerometers do not"
        yield Entry("depth.wave_m", float(f"{depth.waves.sd_m:.2g}"), why)
        yield Entry("depth.wave_period_s", float(f"{depth.waves.period_s:.2g}"))


def _attitude(parts: Parts) -> Iterator[Entry]:
    attitude = parts.attitude
    if attitude is None:
        return
    found = attitude.found
    columns = {name: attitude.rpy_rad[:, k] for k, name in enumerate(RPY)} if "q0" in found.columns else None
    file, clock, names = table(found, "attitude", columns)
    yield Entry("attitude.file", file, found.table.remark, known=None)
    yield _clock("attitude", clock, attitude.offset, found.times.why)
    for part in RPY:
        yield Entry(f"attitude.{part}", names[part])
    yield attitude.unit.entry("attitude.unit", "heading")
    frame = attitude.frame
    if parts.imu.made:
        why = "no gyros tell it: the yaw is clockwise from north, and nose up is positive"
        yield Entry("attitude.frame", "ned_frd", why, known=False, asks="heading")
    else:
        yield frame.entry("attitude.frame", "heading")
    if attitude.quarters:
        why = "the gyros roll and pitch with it when it is turned so"
        yield Entry("attitude.mounting_yaw_deg", 90.0 * attitude.quarters, why)
    if parts.attitude_of_reference:
        yield Entry("attitude.aids", "nothing", "it is the reference's own, which judges the estimate")
        return
    if not (frame.known and attitude.offset.known):
        why = 'its frames or its clock are not known; "attitude" uses it'
        yield Entry("attitude.aids", "nothing", why, known=False)
        return
    if not parts.imu.made:
        why = 'it is of a sensor of its own; "heading" uses its yaw alone, "nothing" the gyros alone'
        yield Entry("attitude.aids", "attitude", why, known=False)
    yield from _declination(attitude, referenced=parts.reference is not None)
    yield from attitude_noise(parts.gyros)


def _declination(attitude: AttitudePart, *, referenced: bool) -> Iterator[Entry]:
    why, offset_deg = attitude.declination.why, round(float(np.rad2deg(attitude.declination.value)), 2)
    if offset_deg or (why and not referenced):
        yield Entry("attitude.yaw_offset_deg", offset_deg, why, known=False, asks="heading")
    elif why:
        yield remark("attitude", f"{why}; the reference judges it")


def _gps(parts: Parts) -> Iterator[Entry]:
    if parts.gps is None:
        return
    entries, _ = _position(parts.gps, "gps")
    yield from entries
    why = "true uses it in the filter, where the vehicle sees satellites in this dive"
    yield Entry("gps.aids", value=False, why=why, known=False)


def _reference(parts: Parts) -> Iterator[Entry]:
    found, own = parts.reference, parts.attitude if parts.attitude_of_reference else None
    if found is None:
        return
    entries, names = _position(found, "reference")
    yield from entries
    as_is = found.columns is None
    if own is not None and "roll" in own.found.columns and as_is and own.frame.value == "ned_frd":
        for part in RPY:
            yield Entry(f"reference.{part}", own.found.columns[part])
        yield Entry("reference.attitude_unit", own.unit.value, own.unit.why)
        if all(f"ned{k}" in names for k in range(3)):
            yield Entry("reference.velocity_ned", [names[f"ned{k}"] for k in range(3)])
    if all(f"v{k}" in names for k in range(3)) and as_is:
        yield Entry("reference.velocity_body", [names[f"v{k}"] for k in range(3)])
    why = f"{found.words}; independent of the other sensors, and judges the estimate: as [gps] it would aid"
    yield Entry("reference.sd_m", found.sd_m, why, known=False)
    if not found.found.table.independent:
        yield Entry("reference.note", f"{found.found.table.part}: {found.found.table.remark}")


def _position(found: PositionPart, section: str) -> tuple[list[Entry], dict[str, str]]:
    """Columns of positions, and their names by role."""
    file, clock, names = table(found.found, section, found.columns)
    entries = [
        Entry(f"{section}.file", file),
        _clock(section, clock, found.offset, found.found.times.why),
    ]
    places = ("latitude", "longitude", "height", "north", "east", "down")
    entries += [Entry(f"{section}.{part}", names[part]) for part in places if part in names]
    if found.unit is not None:
        entries.append(found.unit.entry(f"{section}.angle_unit", "where"))
    return entries, names


def _water(dvl: DvlPart, case: Path) -> Iterator[Entry]:
    """`[water_track]` with the water table beside the beams of the case, or beside the log that they are from."""
    if dvl.recording is None or dvl.log is None:
        return
    own, given = water_file(_beams(dvl.recording, dvl.log).path(case)), water_file(dvl.log)
    is_own = dvl.recording.water is not None or own.is_file()
    if not is_own and not given.is_file():
        return
    file = own if is_own else given
    yield remark(
        "water_track", f"{file.name} has beams that the water returned: the current is a state of the filter"
    )
    if not is_own:
        yield Entry("water_track.file", given)
    why = (
        "the nearest cell is outside of the vehicle's wake; [2, 3] leaves it out (docs/howto/water_track.md)"
    )
    yield Entry("water_track.cells", why=why, known=False)
