"""Logs of an ArduPilot vehicle, by the definitions of ArduPilot (.BIN) and by pymavlink (.tlog); a dive in both."""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.dive import Dive, Floats

GPS_EPOCH_S = 315_964_800
LEAP_S = 18
START_S = 1_700_000_000
"""Unix time of the boot."""

# As LogStructure.h of AP_Logger and of each library has them: type, format, columns, units, factors.
FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "-b---", "-----"),
    "UNIT": (177, "QbZ", "TimeUS,Id,Label", "s--", "F--"),
    "FMTU": (178, "QBNN", "TimeUS,FmtType,UnitIds,MultIds", "s---", "F---"),
    "MULT": (179, "Qbd", "TimeUS,Id,Mult", "s--", "F--"),
    "IMU": (
        129, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz",
        "s#EEEooo--O--zz", "F-000000-----00",
    ),
    "ATT": (
        130, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF", "sddddhhdh-",
        "FBBBBBBBB-",
    ),
    "BARO": (131, "QBffcf", "TimeUS,I,Alt,Press,Temp,CRt", "s#mPOn", "F-00B0"),
    "GPS": (
        132, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
        "s#---SmDUmnhnh-", "F----0BGGB000--",
    ),
    "XKF1": (
        133, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH", "s#ddhnnnnmmmkkkm",
        "F-BBB0000000BBBB",
    ),
    "VISO": (134, "Qffffffff", "TimeUS,dt,AngDX,AngDY,AngDZ,PosDX,PosDY,PosDZ,conf", "ssrrrmmm-", "FF000000-"),
    "VISV": (135, "QQIffffBB", "TimeUS,RTimeUS,CTimeMS,VX,VY,VZ,VErr,Rst,Ign", "sssnnnn--", "FFC0000--"),
}  # fmt: skip
UNITS = {
    "s": "s", "d": "deg", "h": "degheading", "E": "rad/s", "o": "m/s/s", "m": "m", "n": "m/s", "P": "Pa", "r": "rad",
    "D": "deglatitude", "U": "deglongitude", "O": "degC", "k": "deg/s", "z": "Hz", "S": "satellites", "b": "B",
    "#": "instance", "-": "", "?": "UNKNOWN",
}  # fmt: skip
FACTORS = {"-": 0.0, "?": 1.0, "0": 1.0, "B": 1e-2, "C": 1e-3, "F": 1e-6, "G": 1e-7}
PACKED = {
    "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "n": "4s", "N": "16s", "Z": "64s",
    "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip


def record(name: str, *values: Any) -> bytes:  # noqa: ANN401 - numbers and names
    """A record of stored numbers."""
    kind, types, _, _, _ = FORMATS[name]
    return b"\xa3\x95" + bytes([kind]) + struct.pack("<" + "".join(PACKED[c] for c in types), *values)


def head(names: Iterable[str], *, units: bool = True) -> bytes:
    """What a log begins with: the formats of some messages, and their units."""
    names = ["FMT", *(("UNIT", "FMTU", "MULT") if units else ()), *names]
    out = b""
    for name in names:
        kind, types, columns, _, _ = FORMATS[name]
        length = 3 + struct.calcsize("<" + "".join(PACKED[c] for c in types))
        out += record("FMT", kind, length, name.encode(), types.encode(), columns.encode())
    if units:
        for one, label in UNITS.items():
            out += record("UNIT", 1, ord(one), label.encode())
        for one, factor in FACTORS.items():
            out += record("MULT", 1, ord(one), factor)
        for name in names:
            kind, _, _, of, by = FORMATS[name]
            out += record("FMTU", 1, kind, of.encode(), by.encode())
    return out


def gps(
    boot_us: int, north_east_down_m: tuple[float, float, float] = (0.0, 0.0, 0.0), status: int = 3
) -> bytes:
    """A record GPS of instance 0, at 45 degrees north."""
    ms = round(START_S * 1000 + boot_us / 1000) + (LEAP_S - GPS_EPOCH_S) * 1000
    week, ms = divmod(ms, 604_800_000)
    north, east, down = north_east_down_m
    latitude, longitude = 45.0 + north / 111_131.745, 10.0 + east / 78_846.8
    return record(
        "GPS", boot_us, 0, status, ms, week, 12, 80, round(latitude * 1e7), round(longitude * 1e7),
        round(-down * 100), 0.0, 0.0, 0.0, 0.0, 1,
    )  # fmt: skip


@dataclass
class Station:
    """A ground station that logs what a vehicle sends, with a delay."""

    system: int = 1
    component: int = 1
    delay_us: int = 40_000
    signed: bool = False

    def __post_init__(self) -> None:
        """Makes the vehicle's sender."""
        from pymavlink.dialects.v20 import ardupilotmega

        self.library = ardupilotmega
        self.sender = ardupilotmega.MAVLink(None, srcSystem=self.system, srcComponent=self.component)
        if self.signed:
            self.sender.signing.secret_key = bytes(range(32))
            self.sender.signing.sign_outgoing = True
            self.sender.signing.timestamp = 1
            self.sender.signing.link_id = 1

    def log(self, boot_us: int, name: str, *values: Any, version1: bool = False, late_us: int = 0) -> bytes:  # noqa: ANN401
        """A record of the station: its time and the packed message."""
        message = getattr(self.library, f"MAVLink_{name.lower()}_message")(*values)
        packet = bytes(message.pack(self.sender, force_mavlink1=version1))
        return struct.pack(">Q", START_S * 1_000_000 + boot_us + self.delay_us + late_us) + packet

    def heartbeat(self, boot_us: int) -> bytes:
        """Of an ArduSub."""
        return self.log(boot_us, "HEARTBEAT", 12, 3, 81, 0, 4, 3)


BOOT_S = 30.0
SURFACE_PA, HULL_PA = 101_325.0, 99_000.0


def write_bin(
    dive: Dive, path: Path, *, dvl: str = "VISO", surfaced_s: float = 5.0, visv_body: bool = False
) -> Path:
    """The autopilot's own log: two IMUs, two barometers, the estimate, GPS at the surface, the DVL's velocity."""
    names = ["IMU", "ATT", "BARO", "GPS", "XKF1", *([dvl] if dvl else [])]
    rows: list[tuple[int, bytes]] = []
    for k, (second, w, f) in enumerate(zip(dive.imu_s, dive.omega, dive.force, strict=True)):
        us = _us(second)
        rows += [
            (us, record("IMU", us, i, *(w + 0.02 * i), *f, 0, 0, 25.0, 1, 1, 1000, 1000)) for i in range(2)
        ]
        if k % 5 == 0:
            roll, pitch, yaw = np.rad2deg(dive.rpy[k])
            angles = [0, round(100 * roll), 0, round(100 * pitch), 0, round(100 * (yaw % 360.0))]
            rows.append((us, record("ATT", us, *angles, 0, 0, 3)))
            north, east, down = dive.position[k]
            rows.append((us, record("BARO", us, 0, 0.0, HULL_PA + 30.0 * np.sin(second / 40.0), 2500, 0.0)))
            rows.append((us, record("BARO", us, 1, -down, SURFACE_PA + 1025.0 * 9.80665 * down, 1200, 0.0)))
            velocity = Rotation.from_euler("ZYX", dive.rpy[k][::-1]).apply(dive.velocity[k])
            rows.append((us, record("XKF1", us, 0, 0, 0, 0, *velocity, 0.0, north, east, down, 0, 0, 0, 0)))
            if second < surfaced_s:
                rows.append((us, gps(us, (north, east, 0.0))))
    rows += _dvl(dive, dvl, body=visv_body)
    rows.sort(key=lambda one: one[0])
    path.write_bytes(head(names) + b"".join(row for _, row in rows))
    return path


def _us(second: float) -> int:
    return round((second + BOOT_S) * 1e6)


def whole_pings(dive: Dive) -> tuple[Floats, Floats]:
    """Times and body velocities of the pings of four beams."""
    whole = np.isfinite(dive.beams).all(axis=1)
    return dive.ping_s[whole], dive.instrument[whole]


def _dvl(dive: Dive, name: str, *, body: bool) -> list[tuple[int, bytes]]:
    """What a companion computer sends of the DVL: the displacement since the last ping, or the velocity."""
    seconds, velocity = whole_pings(dive)
    times = [_us(one) for one in seconds]
    if name == "VISO":
        dt = np.diff(seconds)
        moved = 0.5 * (velocity[1:] + velocity[:-1]) * dt[:, None]
        sent = zip(times[1:], dt, moved, strict=True)
        return [(us, record("VISO", us, step, 0.0, 0.0, 0.0, *by, 90.0)) for us, step, by in sent]
    if name == "VISV":
        turned = Rotation.from_euler("ZYX", dive.at(seconds, np.unwrap(dive.rpy, axis=0))[:, ::-1])
        moving = velocity if body else turned.apply(velocity)
        return [
            (us, record("VISV", us, us, us // 1000, *v, 0.01, 0, 0))
            for us, v in zip(times, moving, strict=True)
        ]
    return []


def write_tlog(dive: Dive, path: Path, *, imu: str = "HIGHRES_IMU") -> Path:
    """What a ground station logs of the same dive."""
    vehicle, companion = Station(), Station(255, 197)
    rng = np.random.default_rng(1)
    out: list[tuple[int, bytes]] = []

    def log(station: Station, us: int, name: str, *values: Any) -> None:  # noqa: ANN401
        late = int(rng.integers(0, 20_000))
        out.append((us + late, station.log(us, name, *values, late_us=late)))

    for k, (second, w, f) in enumerate(zip(dive.imu_s, dive.omega, dive.force, strict=True)):
        us = _us(second)
        if k % 50 == 0:
            out.append((us, vehicle.heartbeat(us)))
        if imu == "HIGHRES_IMU":
            log(vehicle, us, imu, us, *f, *w, 0, 0, 0, 1013.0, 0, 0, 20.0, 63, 0)
        elif k % 12 == 0:
            counts = [round(1e3 * x / 9.80665) for x in f] + [round(1e3 * x) for x in w]
            log(vehicle, us, imu, us, *counts, 0, 0, 0, 0, 2000)
        if k % 5 == 0:
            log(vehicle, us, "ATTITUDE", us // 1000, *dive.rpy[k], *w)
            down = dive.position[k][2]
            log(vehicle, us, "SCALED_PRESSURE", us // 1000, HULL_PA / 100.0, 0.0, 2500, 0)
            outside = (SURFACE_PA + 1025 * 9.80665 * down) / 100.0
            log(vehicle, us, "SCALED_PRESSURE2", us // 1000, outside, 0, 1200, 0)
            velocity = Rotation.from_euler("ZYX", dive.rpy[k][::-1]).apply(dive.velocity[k])
            log(vehicle, us, "LOCAL_POSITION_NED", us // 1000, *dive.position[k], *velocity)
    seconds, velocity = whole_pings(dive)
    for k in range(1, len(seconds)):
        dt = seconds[k] - seconds[k - 1]
        us = _us(seconds[k])
        moved = [float(x) for x in 0.5 * (velocity[k] + velocity[k - 1]) * dt]
        log(companion, us, "VISION_POSITION_DELTA", us, round(dt * 1e6), [0.0] * 3, moved, 90.0)
    out.sort(key=lambda one: one[0])
    path.write_bytes(b"".join(row for _, row in out))
    return path
