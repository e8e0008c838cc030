"""The sections of a first case: the draft."""

from copy import copy
from typing import Any

import numpy as np

from bottomlock.io.beams import geometry_text
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.recordings.rotation import UNCHANGED_AXES
from bottomlock.replay.init.draft import Entry, Section
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.files import Files
from bottomlock.replay.init.guess import Offset, round_up
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.init.no_imu import put_source
from bottomlock.replay.init.other_parts import AttitudePart
from bottomlock.replay.init.other_sections import (
    motion_section,
    put_attitude_noise,
    put_errors,
    put_start,
    water_section,
)
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.positions import PositionPart
from bottomlock.replay.init.sources import Sources

HEAD = (
    "A first case, written from the files below. It runs as it is: bottomlock replay {case} --out DIR",
    '"guessed:" gives the reason of a guess. "?" is a question that the files do not answer: look at each of them.',
)


LONG_TERM_PERCENT, LONG_TERM_MPS = 0.5, 0.002
"""Errors of a DVL that last: the caution of what data sheets state."""


def draft(parts: Parts, sources: Sources, files: Files) -> list[Entry]:
    """The entries of a case; tables that a replay cannot read as they are, are planned beside it."""
    imu = put_source(parts.imu) if parts.imu.made else _imu(parts.imu, files)
    dvl = _dvl(parts.dvl, sources, files)
    others = [
        _dvl_errors(), *_depth(parts, files), *_attitude(parts, files), *_gps(parts, files), *_reference(parts, files),
    ]  # fmt: skip
    head = Section("")
    for words in HEAD:
        head.say(words.format(case=files.case.name))
    for words in sources.words:
        head.say(f"  {words}")
    for one in parts.unused:
        of = f"{one.table.part} of " if one.table.part else ""
        head.say(f"  not used: {one.kind} of {of}{one.table.path.name} ({', '.join(one.columns.values())})")
    head.put("name", "".join(c if c.isalnum() or c in "_-" else "_" for c in files.case.stem))
    replay = Section("replay")
    replay.put("methods", ["ins", "lc", "tc"])
    replay.say(
        "tc assumes nothing of the vehicle. Every method side by side: leave the line above out; "
        f"{RECOMMENDED_METHOD}, which README recommends, is for a slender vehicle, and for one with "
        'lateral thrusters (ROV, hovering AUV) with vehicle = "hovering" in [filter.water] (docs/hovering.md)'
    )
    start = Section("start")
    put_start(start, parts)
    sections = [
        head, _origin(parts), imu, *([] if parts.imu.made else [put_errors(parts)]), dvl, *others,
        *water_section(parts.dvl, sources, files), start, *motion_section(parts), replay,
    ]  # fmt: skip
    return [entry for section in sections for entry in section.entries]


def _origin(parts: Parts) -> Section:
    section = Section("origin")
    geodetic = next(
        (one for one in (parts.reference, parts.gps) if one is not None and one.unit is not None), None
    )
    if geodetic is not None:
        section.say("the first position of the reference or GPS is the origin")
    else:
        section.put(
            "latitude_deg", 45.0, "where was this? It gives gravity and the Earth's rate", known=False
        )
    return section


def _put_clock(section: Section, clock: dict[str, Any], offset: Offset, why: str = "") -> None:
    """The clock of a stream, with the reasons of its times and of its offset."""
    moved = {"offset_s": round(float(offset.seconds), 6)} if offset.seconds else {}
    section.put("clock", clock | moved, "; ".join(filter(None, (why, offset.why))), known=offset.known)


def _imu(imu: ImuPart, files: Files) -> Section:
    section, found = Section("imu"), imu.found
    columns = None
    if imu.force.factor != 1.0 or not _whole_rows(imu):
        # A case needs six numbers in every row of the IMU.
        unit = imu.force.factor
        values = found.values(*(f"{kind}{k}" for kind in ("force", "omega") for k in range(3)))[imu.rows]
        values[:, :3] *= unit
        columns = {
            f"{kind}{k}": values[:, 3 * (kind == "omega") + k]
            for kind in ("force", "omega")
            for k in range(3)
        }
        if "interval" in found.extra:
            columns["interval"] = found.values("interval")[imu.rows, 0]
        # Another stream of the same table keeps the times of all rows.
        found = copy(found)
        found.times = copy(found.times)
        found.times.time_ns = imu.time_ns if found.times.time_ns is not None else None
    file, clock, names = files.table(found, "imu", columns)
    section.put("file", file)
    if imu.even_hz is not None:
        section.put(
            "clock",
            {"rate_hz": imu.even_hz},
            "no column of times: rows over the length of the other streams",
            known=False,
        )
    else:
        section.put("clock", clock, found.times.why)
    _left_out(imu, section, clock)
    section.put("force", [names[f"force{k}"] for k in range(3)])
    section.put("omega", [names[f"omega{k}"] for k in range(3)])
    if imu.increments:
        section.put("force_unit", "m/s", f"increments: over the interval {imu.force.why}")
        section.put("omega_unit", "rad", f"increments: {imu.omega.why}", known=imu.omega.known)
        if "interval" in names:
            section.put("interval", names["interval"])
    else:
        section.put("force_unit", imu.force.value, imu.force.why)
        section.put("omega_unit", imu.omega.value, imu.omega.why, known=imu.omega.known)
    section.put("axes", imu.axis_names, imu.axes_why)
    if not imu.axes_known:
        section.ask(
            "is this forward, right, down? Gravity shows which axis is down, not which one looks forward"
        )
    for note in imu.notes:
        section.ask(note)
    steps_s = np.diff(imu.time_ns) * 1e-9
    longest = float(steps_s.max())
    if longest > 3.0 * float(np.median(steps_s)):
        section.put(
            "bridge_gaps_s",
            min(round_up(longest), 1.0),
            f"the longest step between readings is {longest:.3g} s",
        )
        if longest > 1.0:
            section.put(
                "limits", {"gap": "inflate"}, "longer gaps: the filter adds the uncertainty of unseen motion"
            )
    return section


def _left_out(imu: ImuPart, section: Section, clock: dict[str, Any]) -> None:
    """Says which rows are not used."""
    if imu.unordered and imu.even_hz is None and "unordered" in clock:
        section.say(
            f"{imu.unordered} rows repeat a time or go back, the first of them row {imu.first_unordered}: they are "
            "left out"
        )
    for remark in imu.left_out:
        section.say(remark)


def _whole_rows(imu: ImuPart) -> bool:
    """Whether every row of the table can be used, but for times out of order, which the clock drops."""
    return len(imu.rows) + imu.unordered == imu.found.table.frame.height


def _dvl(dvl: DvlPart, sources: Sources, files: Files) -> Section:
    section = Section("dvl")
    if dvl.recording is not None:
        assert sources.log is not None  # set with the recording
        section.put(
            "file",
            files.recording(dvl.recording, sources.log),
            f"converted from {sources.log.name}",
            known=None,
        )
        _put_clock(section, {"column": "time_ns", "unit": "ns"}, dvl.offset)
    else:
        assert dvl.found is not None  # one of the two
        file, clock, names = files.table(dvl.found, "dvl")
        section.put(
            "source",
            "velocity",
            "no beams were recorded: they are projected from the velocity, semi-synthetic",
        )
        section.put("file", file)
        if dvl.found.table.remark:
            section.say(dvl.found.table.remark)
        _put_clock(section, clock, dvl.offset, dvl.found.times.why)
        section.put("velocity", [names[f"v{k}"] for k in range(3)])
        if dvl.axes != UNCHANGED_AXES:
            section.put("axes", dvl.axes, "the velocity follows the IMU in left-handed axes alone")
        section.put("velocity_unit", dvl.unit, dvl.unit_why)
        if "valid" in names:
            section.put("valid", names["valid"])
    section.put("geometry", _geometry(dvl, files), dvl.geometry_why, known=dvl.geometry_known)
    if dvl.recording is not None and not dvl.geometry_known:
        section.put(
            "geometry_known",
            value=False,
            why="true once it is: until then nothing confirms the beams",
            known=False,
        )
    if dvl.mounting_why:
        angles = ", ".join(f"{angle:g}" for angle in dvl.mounting_deg)
        section.say(f"mounting (roll, pitch, yaw) is {angles} deg: {dvl.mounting_why}")
    if any(dvl.mounting_deg):
        section.ask(
            "is the DVL mounted so? Where positions told it, they judge the heading no longer by themselves"
        )
    if dvl.noise is not None:
        section.put("beam_noise_mps", *dvl.noise)
    for question in [*dvl.questions, *_departures(dvl)]:
        section.ask(question)
    return section


def _dvl_errors() -> Section:
    section = Section("dvl.errors")
    sheets = "of data sheets, which state 0.1 to 1 % and 1 to 2 mm/s over long times (Workhorse Navigator, A50); yours?"
    section.put("scale_factor_percent", LONG_TERM_PERCENT, sheets, known=False)
    section.put("beam_bias_mps", LONG_TERM_MPS)
    return section


def _geometry(dvl: DvlPart, files: Files) -> str:
    """A packaged name, or a file beside the case where directions or mounting are the log's own."""
    if not dvl.geometry_text and not any(dvl.mounting_deg):
        return dvl.geometry
    angles = zip(("roll", "pitch", "yaw"), dvl.mounting_deg, strict=True)
    lines = [f"mounting_{name}_deg = {angle}\n" for name, angle in angles if angle]
    return files.geometry("".join(lines) + (dvl.geometry_text or geometry_text(dvl.geometry)))


def _departures(dvl: DvlPart) -> list[str]:
    """What the comparison of the velocity with the IMU suggests, beyond five standard deviations."""
    match = dvl.match
    if match is None or not match.plausible:
        return []
    found = []
    roll, pitch, yaw = np.rad2deg(match.part("rotation"))
    sds = np.rad2deg(match.part_sd("rotation"))
    for axis, angle, one in zip(("roll", "pitch", "yaw"), (roll, pitch, yaw), sds, strict=True):
        if abs(angle) > max(5.0 * one, 2.0):
            found.append(
                f"the velocity follows the IMU best with a mounting of {angle:+.1f} ± {one:.1g} deg in {axis}: "
                f"mounting_{axis}_deg of the geometry file"
            )
    lever = match.part("lever")
    if float(np.linalg.norm(lever)) > 0.2 and (np.abs(lever) > 5.0 * match.part_sd("lever")).any():
        words = ", ".join(f"{x:+.2f} ± {s:.1g}" for x, s in zip(lever, match.part_sd("lever"), strict=True))
        found.append(
            f"where is the DVL? It moves as if it were at {words} m from the IMU: lever_arms_m of the geometry file"
        )
    return found


def _depth(parts: Parts, files: Files) -> list[Section]:
    depth = parts.depth
    if depth is None:
        return []
    section = Section("depth")
    file, clock, names = files.table(depth.found, "depth")
    section.put("file", file)
    _put_clock(section, clock, depth.offset, depth.found.times.why)
    section.put("column", next(iter(names.values())))
    section.put("unit", depth.unit.value, depth.unit.why, known=depth.unit.known)
    if depth.up is not None:
        section.put("up", value=True, why=depth.up.why)
    if depth.offset_m is not None:
        section.put("offset_m", float(depth.offset_m.value), depth.offset_m.why)
    section.put("sd_m", depth.sd_m, "twice the scatter from reading to reading")
    if depth.waves is not None:
        why = "it moves so with a mean period of some seconds, and the accelerometers do not"
        section.put("wave_m", float(f"{depth.waves.sd_m:.2g}"), why)
        section.put("wave_period_s", float(f"{depth.waves.period_s:.2g}"))
    return [section]


def _attitude(parts: Parts, files: Files) -> list[Section]:
    attitude = parts.attitude
    if attitude is None:
        return []
    section, found = Section("attitude"), attitude.found
    columns = None
    if "q0" in found.columns:
        columns = {name: attitude.rpy_rad[:, k] for k, name in enumerate(("roll", "pitch", "yaw"))}
    file, clock, names = files.table(found, "attitude", columns)
    section.put("file", file)
    if found.table.remark:
        section.say(found.table.remark)
    offset = attitude.offset
    _put_clock(section, clock, offset, found.times.why)
    for part in ("roll", "pitch", "yaw"):
        section.put(part, names[part])
    section.put("unit", attitude.unit.value, attitude.unit.why, known=attitude.unit.known)
    frame = attitude.frame
    if parts.imu.made:
        section.put(
            "frame",
            "ned_frd",
            "no gyros tell it: is the yaw clockwise, and nose up positive?",
            known=False,
        )
    else:
        section.put("frame", frame.value, frame.why, known=frame.known)
    if attitude.quarters:
        section.put(
            "mounting_yaw_deg",
            90.0 * attitude.quarters,
            "the gyros roll and pitch with it when it is turned so",
        )
    if parts.attitude_of_reference:
        section.put("aids", "nothing", "it is the reference's own, which judges the estimate")
        return [section]
    if not (frame.known and offset.known):
        section.put(
            "aids", "nothing", 'its frames or its clock are not known: "attitude" uses it', known=False
        )
        return [section]
    if not parts.imu.made:
        section.put(
            "aids", "attitude", 'is it a reference of its own? "heading" uses its yaw alone, "nothing" the gyros alone',
            known=False,
        )  # fmt: skip
    _put_declination(section, attitude, referenced=parts.reference is not None)
    put_attitude_noise(section, parts.gyros)
    return [section]


def _put_declination(section: Section, attitude: AttitudePart, *, referenced: bool) -> None:
    if attitude.declination_rad:
        section.put(
            "yaw_offset_deg",
            round(float(np.rad2deg(attitude.declination_rad)), 2),
            attitude.declination_why,
            known=False,
        )
    elif attitude.declination_why and not referenced:
        section.put("heading_known", value=False, why=attitude.declination_why, known=False)
    else:
        section.ask(attitude.declination_why)


def _gps(parts: Parts, files: Files) -> list[Section]:
    if parts.gps is None:
        return []
    section, _ = _position(parts.gps, files, "gps")
    section.put(
        "aids",
        value=False,
        why="does the vehicle see satellites in this dive? true uses it in the filter",
        known=False,
    )
    return [section]


def _reference(parts: Parts, files: Files) -> list[Section]:
    found = parts.reference
    if found is None:
        return []
    section, names = _position(found, files, "reference")
    own = parts.attitude if parts.attitude_of_reference else None
    if (
        own is not None
        and "roll" in own.found.columns
        and found.columns is None
        and own.frame.value == "ned_frd"
    ):
        for part in ("roll", "pitch", "yaw"):
            section.put(part, own.found.columns[part])
        section.put("attitude_unit", own.unit.value, own.unit.why)
        if all(f"ned{k}" in names for k in range(3)):
            section.put("velocity_ned", [names[f"ned{k}"] for k in range(3)])
    if all(f"v{k}" in names for k in range(3)) and found.columns is None:
        section.put("velocity_body", [names[f"v{k}"] for k in range(3)])
    section.say(found.words)
    section.put("sd_m", found.sd_m)
    if not found.found.table.independent:
        section.put("note", f"{found.found.table.part}: {found.found.table.remark}")
    section.ask(
        "is it independent of these sensors? Errors below are measured against it; as [gps] it would aid"
    )
    return [section]


def _position(found: PositionPart, files: Files, name: str) -> tuple[Section, dict[str, str]]:
    """Columns of positions, and their names by role."""
    section = Section(name)
    file, clock, names = files.table(found.found, name, found.columns)
    section.put("file", file)
    _put_clock(section, clock, found.offset, found.found.times.why)
    for part in ("latitude", "longitude", "height", "north", "east", "down"):
        if part in names:
            section.put(part, names[part])
    if found.unit is not None:
        section.put("angle_unit", found.unit.value, found.unit.why, known=found.unit.known)
    return section, names
