"""Logs of an ArduPilot vehicle, written by the definitions of ArduPilot (.BIN) and by pymavlink (.tlog)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

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


def head(names: Iterable[str], *, units: bool = True, unit_of: dict[str, str] | None = None) -> bytes:
    """What a log begins with: the formats of some messages, and their units."""
    names = ["FMT", *(("UNIT", "FMTU", "MULT") if units else ()), *names]
    out = b""
    for name in names:
        kind, types, columns, _, _ = FORMATS[name]
        length = 3 + struct.calcsize("<" + "".join(PACKED[c] for c in types))
        out += record("FMT", kind, length, name.encode(), types.encode(), columns.encode())
    if units:
        for one, label in (UNITS | (unit_of or {})).items():
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
