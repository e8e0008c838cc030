"""Small records of every format, made here: what tests of the readers and the fuzzer start from.

The writers below are the formats' documents turned round. They and the framing of the encoders share no code with the
readers.
"""

import json
import math
import struct
from collections.abc import Sequence

from bottomlock.encoders.framing import nortek_frame, pd0_wrap, waterlinked_sentence

SERIAL = (
    b"wrz,0.120,-0.400,2.000,y,1.30,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1*50\r\n"
    b"wru,0,0.070,1.10,-40,-95*9c\r\n"
    b"wru,1,-0.500,1.25,-62,-104*f0\r\n"
    b"wru,2,2.200,1.40,-56,-98*18\r\n"
    b"wru,3,1.800,1.35,-58,-96*a3\r\n"
)
"""The maker's documented examples of one measurement."""
SERIAL_OLD = b"wrx,112.83,0.007,0.017,0.006,0.000,0.93,y,0*d2\r\nwrt,15.00,15.20,14.90,-1.00*71\r\n"
DVKFC = (
    b"$DVKFC,24577,35060,0.100000,3801.552000,[A],60,1000,0.500000,4.381214,0.000000,6.283185,"
    b"[B],60,1000,0.500000,3.450820,0.000000,6.283185,[C],60,1000,0.500000,3.839504,0.000000,6.283185,0x0055AAFF*2A\r\n"
)
"""The maker's documented example."""
DVEXT = (
    b"$DVPDL,160401000,100000,0.000000,-0.000000,-0.000000,0.000,-0.000,-0.000,0*55\r\n"
    b"$DVEXT,F,X,3330,-1.8,2.4,259.5,-1175,0.000,0.00,-0.000,0.000,0.000000000,0.000000000,0.100,0.091711,0.019853,"
    b"0.017436,-0.995435,25,25,25,25,F,F,F,F,0.0000,0.0000,0.0000,0.0000,-1.000,-1.000,-1.000,-1.000,*54\r\n"
    b"$DVEXT,T,X,0310,89.9,69.3,290.9,0,-0.067,0.35,-0.144,0.295,-0.000427010,0.001465353,0.050,0.500257,-0.290460,"
    b"0.644365,0.500170,19,19,48,25,T,T,F,T,-0.0086,-0.0169,0.0000,-0.0608,0.371,0.391,-1.000,0.371,*65\r\n"
)
"""Sentences of a DVL-75, as two public programs hold them."""
PNORBT0 = b"$PNORBT0,1,040721,131335.3341,23.961,-48.122,-32.76800,10.00000,0.00,0x00000000*48\r\n"
"""A recorded example, of a beam without bottom."""


def nmea(text: bytes) -> bytes:
    """A sentence with `$` and the exclusive or."""
    value = 0
    for byte in text:
        value ^= byte
    return b"$" + text + b"*%02X\r\n" % value


def a50_report(step: int, *, version: str = "json_v1", lost: Sequence[int] = (), **changed: object) -> bytes:
    """One line of the TCP stream; every report differs from the one before."""
    transducers = [
        {
            "id": k, "velocity": 0.0 if k in lost else 0.1 * k + 0.001 * step,
            "distance": -1.0 if k in lost else 2.0 + 0.1 * k, "rssi": -30.0 - k, "nsd": -90.0,
            "beam_valid": k not in lost,
        }
        for k in range(4)
    ]  # fmt: skip
    report: dict[str, object] = {
        "time": 100.0, "vx": 0.5, "vy": -0.25, "vz": 0.125, "fom": 0.002, "altitude": 1.8, "transducers": transducers,
        "velocity_valid": len(lost) < 2, "status": 0, "format": version,
    }  # fmt: skip
    if version != "json_v1":
        report["type"] = "velocity"
    if version.startswith("json_v3"):
        report["time_of_validity"] = 1_638_191_471_563_017 + 100_000 * step
        report["time_of_transmission"] = 1_638_191_471_752_336 + 100_000 * step
    return json.dumps(report | changed, separators=(",", ":")).encode() + b"\n"


def linkquest_log(rows: int = 2) -> bytes:
    """A header as the recording has it, and pings of a + Janus, the second without beam 1."""
    four = range(4)
    names = ["%time", "field.header.seq", "field.header.stamp"]
    names += [f"field.dataGood{k}" for k in four] + [f"field.altitudeBeam{k}" for k in four]
    names += [f"field.bottomVelocityBeam{k}" for k in four] + [f"field.velocityInst{k}" for k in range(3)]
    names += ["field.velocityInstFlag", "field.altitude", "field.soundSpeed"]
    lines = [",".join(names)]
    for row in range(rows):
        good = int(row != 1)
        stamp = 1372687208633787539 + row * 350_000_000
        values = [stamp + 800_000, 1245 + row, stamp, good, 1, 1, 1, 2.0 * good, 2.1, 2.2, 2.3]
        values += [0.1 * good, -0.2, -0.3, 0.4, 0.5, -0.6, 0.07, 1, 2.0, 1500.0]
        lines.append(",".join(map(str, values)))
    return "\n".join(lines).encode() + b"\n"


def pd0_ensemble(
    number: int = 1,
    *,
    frame: int = 0,
    velocity: Sequence[int] = (100, -100, 250, -250),
    ranges: Sequence[int] = (1000, 1010, 1020, 0),
    fine: Sequence[int] | None = None,
    bottom: bool = True,
    century: bool = False,
    cells: Sequence[Sequence[int]] = (),
    layer: Sequence[int] = (),
) -> bytes:
    """An ensemble: leaders, bottom track (mm/s, cm) and perhaps the high-resolution velocity (0.01 mm/s).

    `cells` are velocities of a profile of cells of 2 m, the first at 3.5 m; `layer` that of the water from 8 m to 16 m.
    """
    fixed = bytearray(59)
    struct.pack_into("<BBH", fixed, 9, len(cells), 1, 0)
    struct.pack_into("<H", fixed, 12, 200)
    struct.pack_into("<H", fixed, 32, 350)
    struct.pack_into("<HBBH", fixed, 0, 0x0000, 50, 1, 0x4100 | 0x0B)
    fixed[8], fixed[25], fixed[58] = 4, frame << 3 | 7, 20
    variable = bytearray(65)
    second, hundredth = divmod(number * 50, 100)
    clock = bytes([21, 4, 7, 13, 13, second % 60, hundredth])
    struct.pack_into("<HH", variable, 0, 0x0080, number)
    variable[4:11] = clock
    struct.pack_into("<HHHhh", variable, 14, 1500, 0, 9000, 150, -250)
    if century:
        variable[57:65] = bytes([20]) + clock
    types = [bytes(fixed), bytes(variable)]
    if bottom:
        track = bytearray(81)
        struct.pack_into("<H", track, 0, 0x0600)
        struct.pack_into("<4H4h4B", track, 16, *ranges, *velocity, 200, 201, 202, 203)
        if layer:
            struct.pack_into("<3H4h4B", track, 44, 40, 80, 160, *layer, 90, 91, 92, 93)
        types.append(bytes(track))
    if cells:
        types.append(struct.pack(f"<H{4 * len(cells)}h", 0x0100, *(v for cell in cells for v in cell)))
        types.append(struct.pack(f"<H{4 * len(cells)}B", 0x0200, *(100 + k for k in range(4 * len(cells)))))
    if fine is not None:
        types.append(struct.pack("<H4i", 0x5803, *fine) + bytes(52))
    return pd0_wrap(types)


def df21(
    step: int = 0,
    *,
    velocity: Sequence[float] = (0.1, 0.2, 0.3, 0.4),
    status: int = 0xFFFFF,
    axes: Sequence[float] = (1.0, -0.5, 0.2, 0.3),
) -> bytes:
    """A DVL's bottom-track record: 10 s after midnight on 1 May 2021 and `step` seconds."""
    clock = bytes([121, 4, 1, 0, 0, 10 + step])
    head = struct.pack("<BBI6sHHII3f", 1, 36, 4711, clock, 2500, 4, 0, status, 1500.0, 12.0, 1.5)
    numbers = [*velocity, 10.0, 10.1, 10.2, 10.3, 0.01, 0.02, 0.03, 0.04]
    numbers += [0.013] * 4 + [-0.04] * 4 + [0.002] * 4
    numbers += [*axes, 0.011, 0.012, 0.013, 0.014, *[0.01] * 12]
    return head + struct.pack("<44f", *numbers)


def df20(step: int = 0, *, valid: bool = True, velocity: Sequence[int] = (100, -100, 50, -50)) -> bytes:
    """A profiler's bottom-track record in beam coordinates, of 78 bytes and the beams."""
    head = bytearray(78)
    clock = bytes([121, 4, 1, 0, 0, 10 + step])
    struct.pack_into(
        "<BBHI6sHHhIHhhH", head, 0, 1, 78, 1 << 5 | 1 << 8 | 1 << 9, 4711, clock, 2500, 15000, 1200, 100, 9000, 150,
        -250, 4 << 12 | 2 << 10,
    )  # fmt: skip
    struct.pack_into("<b", head, 60, -3)
    beams = (*velocity, 2000, 2100, 2200, 2300, 5, 6, 7, 8)
    filler = (-10117, -10117, -10117, -10117, -1022, -1022, -1022, -1022, *[65535] * 4)
    return bytes(head) + struct.pack("<4i4i4H", *(beams if valid else filler))


def df3(
    step: int = 0, *, velocity: Sequence[Sequence[int]] = ((100, 200), (-100, 50), (50, 0), (-50, 7))
) -> bytes:
    """A profiler's record of velocities by beam and cell, mm/s: cells of 1 m, blanking 0.5 m, correlations 80 %."""
    cells = len(velocity[0])
    head = bytearray(76)
    clock = bytes([121, 4, 1, 0, 0, 10 + step])
    struct.pack_into(
        "<BBHI6sHHhIHhhHHH", head, 0, 3, 76, 1 << 5 | 1 << 6 | 1 << 7, 4711, clock, 5000, 15000, 1200, 100, 9000, 150,
        -250, 4 << 12 | 2 << 10 | cells, 1000, 500,
    )  # fmt: skip
    struct.pack_into("<b", head, 58, -3)
    numbers = [one for beam in velocity for one in beam]
    amplitude, correlation = bytes([60] * len(numbers)), bytes([80] * len(numbers))
    return bytes(head) + struct.pack(f"<{len(numbers)}h", *numbers) + amplitude + correlation


def water_report(step: int = 0, *, lost: Sequence[int] = ()) -> bytes:
    """What a Water Linked sends on its serial line in water tracking."""
    covariance, sent_us = "1e-07;0;1.4;0;1.2;0;0.2;0;1e+09", 9000 + 500_000 * step
    lines = [f"wrs,0.120,-0.400,2.000,y,1.855,{covariance},{sent_us - 8000},{sent_us},500.00,0"]
    for k in range(4):
        speed, distance = (0.0, -1.0) if k in lost else (0.1 * k - 0.2 + 0.001 * step, 3.1)
        lines.append(f"wru,{k},{speed:.3f},{distance:.2f},-40,-95")
    return b"".join(waterlinked_sentence(line.encode()) for line in lines)


def nucleus(step: int = 0, *, status: int = 0x7FFF, velocity: Sequence[float] = (0.1, 0.2, 0.3)) -> bytes:
    """A Nucleus bottom-track record, `step` seconds after a time of 2023."""
    head = struct.pack(
        "<4B3I2I3f", 2, 36, 1, 0, 1_690_000_000 + step, 250_000, status, 4711, 0, 1500.0, 12.0, 1.5
    )
    numbers = [*velocity, 5.0, 5.1, 5.2, 0.01, 0.02, 0.03, 0.004, 0.005, 0.006, 0.02, 0.021, 0.022]
    return head + struct.pack("<23f", *numbers, 1.0, -0.5, 0.25, 0.011, 0.012, 0.013, 0.005, 0.02)


NUCLEUS_COLUMNS = (
    "sizeHeader", "id", "family", "flags.posixTime", "timeStamp", "microSeconds", "timestampPython",
    *(f"status.beam{k}{what}Valid" for what in ("Velocity", "Distance", "Fom") for k in (1, 2, 3)),
    *(f"status.{axis}{what}Valid" for what in ("Velocity", "Fom") for axis in "xyz"),
    "serialNumber", "soundSpeed",
    *(f"{what}Beam{k}" for what in ("velocity", "distance", "fom", "dt", "timeVel") for k in (1, 2, 3)),
    "velocityX", "velocityY", "velocityZ", "fomX", "fomY", "fomZ", "dtXYZ", "string",
)  # fmt: skip
"""Of the driver's log, those that a bottom track fills."""


def nucleus_csv(kinds: Sequence[tuple[int, int]]) -> bytes:
    """Rows of Nortek's driver of packets of some ids and states, with the numbers of `nucleus`."""
    lines = [",".join(NUCLEUS_COLUMNS)]
    for step, (kind, status) in enumerate(kinds):
        content = nucleus(step, status=status)
        seconds, micros = struct.unpack_from("<2I", content, 4)
        numbers = struct.unpack_from("<21f", content, 36)
        row = dict.fromkeys(NUCLEUS_COLUMNS, "")
        row |= {"sizeHeader": "10", "id": str(kind), "family": "32", "flags.posixTime": "True"}
        row |= {"timeStamp": str(seconds), "microSeconds": str(micros), "timestampPython": f"{seconds + 1}.5"}
        if kind in {0xB4, 0xBE}:
            flags = [name for name in NUCLEUS_COLUMNS if name.startswith("status.")]
            row |= {name: str(bool(status >> k & 1)) for k, name in enumerate(flags)}
            values = NUCLEUS_COLUMNS[NUCLEUS_COLUMNS.index("velocityBeam1") : NUCLEUS_COLUMNS.index("dtXYZ")]
            row |= {name: repr(value) for name, value in zip(values, numbers, strict=True)}
            row["soundSpeed"] = "1500.0"
        lines.append(",".join(row.values()))
    return "\r\n".join(lines).encode() + b"\r\n"


def wayfinder(
    step: int = 0,
    *,
    velocity: Sequence[float] = (0.1, -0.2, 0.3, -0.4),
    ranges: Sequence[float] = (10.0, 10.1, 10.2, 10.3),
    coordinates: int = 0,
    kind: int = 5,
) -> bytes:
    """A packet of a Wayfinder: 20 s after a minute of 2021 and `step` tenths of a second."""
    content = bytearray(87)
    struct.pack_into("<BBI6B", content, 0, 0xAA, 0x11, 87, 76, 0, 1, 2, 3, 4)
    struct.pack_into("<6BHB", content, 12, 21, 5, 1, 12, 30, 20 + step // 10, 100 * (step % 10), coordinates)
    struct.pack_into("<10fH", content, 21, *velocity, *ranges, 10.15, 1500.0, 0)
    struct.pack_into("<H", content, 85, sum(content[:85]) & 0xFFFF)
    packet = struct.pack("<3BH", 0xAA, 0x10, 0x01, 98) + struct.pack("<BBH", 2, kind, 91) + bytes(content)
    return packet + struct.pack("<H", sum(packet) & 0xFFFF)


def pnorbt(beam: int, *, tagged: bool, velocity: float = 0.25, second: float = 35.3341) -> bytes:
    """A Nortek beam line, plain or tagged."""
    values = f"{beam},040721,1313{second:07.4f},23.961,-48.122,{velocity:.5f},0.01,5.0,0x1F".split(",")
    tags = ("BEAM", "DATE", "TIME", "DT1", "DT2", "BV", "FOM", "DIST", "STAT")
    fields = [f"{tag}={value}" for tag, value in zip(tags, values, strict=True)] if tagged else values
    return nmea(f"PNORBT{int(tagged)},{','.join(fields)}".encode())


PD6 = (
    b":SA, -2.31, +0.92,236.59\r\n:TS,21040713133533,35.0,+25.0,   0.0,1500.0,  0\r\n"
    b":BI,   -32,   +22,    +0,   -93,A\r\n:BS,   -32,   +22,    +0,A\r\n:BE,   +19,   +20,   +28,A\r\n"
)
PD6_LOGGED = (
    b"Timestamp(s),SensorID,RawLine,CmdOrNote\r\n"
    b'1762421966.54,DVL,":BI,   -32,   +22,+88888,   -93,V",RESP\r\n'
)
"""As a logger's CSV holds PD6."""


def seeds() -> dict[str, list[bytes]]:
    """Inputs by name of format: good records, a few of each."""
    return {
        "waterlinked-json": [
            a50_report(0) + a50_report(1, lost=[2]),
            a50_report(0, version="json_v3.1") + b'{"ts":49056.8,"x":1.2,"type":"position_local","format":"json_v3"}\n',
            a50_report(0, version="json_v2") + a50_report(0, version="json_v2").rstrip() + a50_report(2),
            a50_report(0, version="json_v3.2", type="velocity_water", tracking_mode="water"),
        ],
        "waterlinked-serial": [
            SERIAL,
            SERIAL + SERIAL_OLD,
            waterlinked_sentence(b"wrp,49056.809,0.41,0.15,1.23,0.4,1,2,3,0") + SERIAL,
            water_report() + SERIAL,
        ],
        "nortek-ascii": [
            PNORBT0,
            b"".join(pnorbt(k, tagged=False) for k in range(1, 5)),
            b"".join(pnorbt(k, tagged=True) for k in range(1, 4)),
        ],
        "cerulean-dvext": [DVEXT, DVEXT + DVEXT],
        "nucleus-csv": [nucleus_csv([(0xB4, 0x7FFF), (0xD2, 0), (0xB4, 0x7FFB), (0xBE, 0x7FFF)])],
        "wayfinder": [
            wayfinder() + wayfinder(1, velocity=(0.1, math.nan, 0.3, 0.4)),
            wayfinder(coordinates=1) + wayfinder(1, kind=4),
        ],
        "cerulean-dvkfc": [DVKFC, DVKFC + nmea(b"DVPDL,373550,1000,200000,0,0,0,0,0,0,0")],
        "linkquest-csv": [linkquest_log()],
        "pd0": [
            pd0_ensemble(1),
            pd0_ensemble(1, fine=(10_000, -10_000, 25_000, -25_000)) + pd0_ensemble(2, bottom=False),
            pd0_ensemble(1, frame=3) + pd0_ensemble(2, frame=3, century=True),
            pd0_ensemble(1, cells=[(1, 2, 3, 4), (5, 6, -32768, 8)]) + pd0_ensemble(2, cells=[(9, 10, 11, 12)]),
            pd0_ensemble(1, layer=(10, 20, -30, 40)),
        ],
        "nortek-dvl": [nortek_frame(0x1B, df21()), nortek_frame(0x1B, df21(1)) + nortek_frame(0x1D, df21(2))],
        "nortek-ad2cp": [
            nortek_frame(0x17, df20(), 0x10),
            nortek_frame(0xA0, b"GETCLOCKSTR", 0x10) + nortek_frame(0x17, df20(valid=False), 0x10),
            nortek_frame(0x15, df3(), 0x10) + nortek_frame(0x17, df20(1), 0x10),
        ],
        "nucleus": [
            nortek_frame(0xB4, nucleus(), 0x20),
            nortek_frame(0xD2, bytes(40), 0x20) + nortek_frame(0xB4, nucleus(1), 0x20),
            nortek_frame(0xBE, nucleus(), 0x20) + nortek_frame(0xB4, nucleus(1), 0x20),
        ],
    }  # fmt: skip
