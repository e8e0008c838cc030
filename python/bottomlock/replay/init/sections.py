"""The sections of a first case."""

from typing import Any

import numpy as np

from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.files import Files
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import angle_unit, round_up
from bottomlock.replay.init.imu_part import ImuPart, noise_of
from bottomlock.replay.init.other_parts import clock_offset
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.sources import Sources
from bottomlock.replay.init.start import put_start
from bottomlock.replay.init.text import Section, joined

HEAD = (
    "A first case, written from the files below. It runs as it is: bottomlock replay {case} --out DIR",
    '"guessed:" gives the reason of a guess. "?" is a question that the files do not answer: look at each of them.',
)


def case_text(parts: Parts, sources: Sources, files: Files) -> str:
    """The text of a case; tables that a replay cannot read as they are, are written beside it."""
    imu = _imu(parts.imu, files)
    dvl = _dvl(parts.dvl, sources, files)
    others = [
        *_depth(parts, files), *_attitude(parts, files), *_position(parts, files, parts.gps, "gps"),
        *_position(parts, files, parts.reference, "reference"),
    ]  # fmt: skip
    head = Section("", [HEAD[0].format(case=files.case.name), HEAD[1]])
    for words in sources.words:
        head.say(f"  {words}")
    for one in parts.unused:
        head.say(f"  not used: {one.kind} of {one.table.path.name} ({', '.join(one.columns.values())})")
    head.put("name", "".join(c if c.isalnum() or c in "_-" else "_" for c in files.case.stem))
    replay = Section("replay")
    replay.put("methods", ["ins", "lc", "tc"])
    replay.say("every method side by side: leave the line above out")
    start = Section("start")
    put_start(start, parts)
    return joined([head, _origin(parts), imu, *_errors(parts.imu, parts.dvl), dvl, *others, start, replay])


def _origin(parts: Parts) -> Section:
    section = Section("origin")
    geodetic = next(
        (one for one in (parts.reference, parts.gps) if one is not None and one.kind == "geodetic"), None
    )
    if geodetic is not None:
        section.say("the first position of the reference or GPS is the origin")
    else:
        section.put(
            "latitude_deg", 45.0, "where was this? It gives gravity and the Earth's rate", known=False
        )
    return section


def _clock(clock: dict[str, Any], offset_s: float = 0.0) -> dict[str, Any]:
    return clock | ({"offset_s": round(float(offset_s), 6)} if offset_s else {})


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
        times = found.times
        times.time_ns = imu.time_ns if times.time_ns is not None else None
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
        if imu.unordered and "unordered" in clock:
            section.say(f"{imu.unordered} rows repeat a time or go back: they are left out")
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


def _whole_rows(imu: ImuPart) -> bool:
    """Whether every row of the table can be used, but for times out of order, which the clock drops."""
    return len(imu.rows) + imu.unordered == imu.found.table.frame.height


def _errors(imu: ImuPart, dvl: DvlPart) -> list[Section]:
    section = Section("imu.errors")
    accel, gyro = noise_of(imu)
    match = dvl.match
    bias_deg_per_h, bias_why, known = 100.0, "nothing measures it: see the data sheet", False
    accel_mg = 5.0
    if match is not None and match.plausible:
        found = float(np.rad2deg(np.abs(match.part("gyro_bias")[:2]).max()) * 3600.0)
        sd = float(np.rad2deg(match.part_sd("gyro_bias")[:2].max()) * 3600.0)
        bias_deg_per_h, known = round_up(max(2.0 * found, 2.0 * sd, 1.0)), True
        bias_why = f"against the DVL's velocity the level gyros are {found:.3g} deg/h off"
        excess = abs(match.gravity - 9.80665) / 9.80665 * 1e3
        accel_mg = round_up(min(max(excess, 1.0), 50.0))
    section.say("1 sigma; the data sheet of the IMU knows better")
    section.put(
        "accel_bias_mg",
        accel_mg,
        "gravity as integrated differs from 9.807 m/s² by less" if known else "see the data sheet",
        known=known,
    )
    section.put("gyro_bias_deg_per_h", bias_deg_per_h, bias_why, known=known)
    section.put(
        "accel_noise_mps_per_rt_h",
        float(f"{max(accel, 1e-3):.2g}"),
        "scatter from reading to reading, vibration included",
    )
    section.put("gyro_noise_deg_per_rt_h", float(f"{max(gyro, 1e-4):.2g}"), "the same")
    return [section]


def _dvl(dvl: DvlPart, sources: Sources, files: Files) -> Section:
    section = Section("dvl")
    if dvl.recording is not None:
        assert sources.log is not None  # set with the recording
        section.put("file", files.recording(dvl.recording, sources.log), f"converted from {sources.log.name}")
        section.lines[-1] = section.lines[-1].replace("guessed: converted", "converted")
        section.put(
            "clock",
            _clock({"column": "time_ns", "unit": "ns"}, dvl.offset_s),
            dvl.offset_why,
            known=dvl.offset_known,
        )
    else:
        assert dvl.found is not None  # one of the two
        file, clock, names = files.table(dvl.found, "dvl")
        section.put(
            "source",
            "velocity",
            "no beams were recorded: they are projected from the velocity, semi-synthetic",
        )
        section.put("file", file)
        why = "; ".join(word for word in (dvl.found.times.why, dvl.offset_why) if word)
        section.put("clock", _clock(clock, dvl.offset_s), why, known=dvl.offset_known)
        section.put("velocity", [names[f"v{k}"] for k in range(3)])
        section.put("velocity_unit", dvl.unit, dvl.unit_why)
        if "valid" in names:
            section.put("valid", names["valid"])
    name = files.geometry(dvl.geometry_text) if dvl.geometry_text else dvl.geometry
    section.put("geometry", name, dvl.geometry_why, known=dvl.geometry_known)
    if dvl.noise is not None:
        section.put("beam_noise_mps", *dvl.noise)
    for question in [*dvl.questions, *_departures(dvl)]:
        section.ask(question)
    return section


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
    section.put(
        "clock",
        _clock(clock, depth.offset.seconds),
        depth.offset.why or depth.found.times.why,
        known=depth.offset.known,
    )
    section.put("column", next(iter(names.values())))
    section.put("unit", depth.unit.value, depth.unit.why, known=depth.unit.known)
    if depth.up is not None:
        section.put("up", value=True, why=depth.up.why)
    if depth.offset_m is not None:
        section.put("offset_m", float(depth.offset_m.value), depth.offset_m.why)
    section.put("sd_m", depth.sd_m, "twice the scatter from reading to reading")
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
    offset = attitude.offset
    section.put("clock", _clock(clock, offset.seconds), offset.why or found.times.why, known=offset.known)
    for part in ("roll", "pitch", "yaw"):
        section.put(part, names[part])
    section.put("unit", attitude.unit.value, attitude.unit.why, known=attitude.unit.known)
    frame = attitude.frame
    section.put("frame", frame.value, frame.why, known=frame.known)
    section.put(
        "aids", "nothing", 'is it independent of these gyros? Then "heading" or "attitude" helps', known=False
    )
    section.ask(
        "is the yaw magnetic? Then yaw_offset_deg is the declination; yaw_sd_deg is 5, roll_pitch_sd_deg 1 by default"
    )
    return [section]


def _position(parts: Parts, files: Files, found: Found | None, name: str) -> list[Section]:
    if found is None:
        return []
    section = Section(name)
    columns = _rewritten(found)
    file, clock, names = files.table(found, name, columns)
    section.put("file", file)
    assert found.times.time_ns is not None  # chosen so
    offset = clock_offset(found.times.time_ns, parts.imu, parts.dvl)
    if parts.attitude is not None and parts.attitude.found.table is found.table:
        offset = parts.attitude.offset
    section.put("clock", _clock(clock, offset.seconds), offset.why or found.times.why, known=offset.known)
    for part in ("latitude", "longitude", "height", "north", "east", "down"):
        if part in names:
            section.put(part, names[part])
    if found.kind == "geodetic":
        unit = angle_unit(found.values("latitude", "longitude"), found.units.get("latitude", ""))
        degrees = columns is not None or unit.value == "deg"
        section.put("angle_unit", "deg" if degrees else "rad", unit.why, known=unit.known or degrees)
    if name == "gps":
        section.put(
            "aids",
            value=False,
            why="does the vehicle see satellites in this dive? true uses it in the filter",
            known=False,
        )
        return [section]
    own = parts.attitude if parts.attitude is not None and parts.attitude.found.table is found.table else None
    if own is not None and "roll" in own.found.columns and columns is None and own.frame.value == "ned_frd":
        for part in ("roll", "pitch", "yaw"):
            section.put(part, own.found.columns[part])
        section.put("attitude_unit", own.unit.value, own.unit.why)
        if all(f"ned{k}" in names for k in range(3)):
            section.put("velocity_ned", [names[f"ned{k}"] for k in range(3)])
    if all(f"v{k}" in names for k in range(3)) and columns is None:
        section.put("velocity_body", [names[f"v{k}"] for k in range(3)])
    section.ask("is it independent of these sensors? Errors below are measured against it")
    return [section]


def _rewritten(found: Found) -> dict[str, Any] | None:
    """Positions in degrees where they are integers of 1e-7 deg, or rows without a fix are zero; None to leave them."""
    if found.kind != "geodetic":
        return None
    place = found.values("latitude", "longitude")
    none = (place == 0.0).all(axis=1)
    factor = 1e-7 if float(np.nanmax(np.abs(place))) > 1000.0 else 1.0
    if factor == 1.0 and not none.any():
        return None
    place = np.where(none[:, None], np.nan, factor * place)
    return {"latitude": place[:, 0], "longitude": place[:, 1]}
