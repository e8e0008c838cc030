"""Logs of several pings in every format, where every number names its ping: no two pings share one."""

import json
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bottomlock.encoders import framing
from tools import reader_seeds as seeds

PINGS = 8
_EPOCH_US = 1_638_191_471_000_000
_STEP_US = 125_000


@dataclass(frozen=True)
class Log:
    """Records in their order; the last ping is whole when the others are damaged.

    Attributes:
        records: bytes of each record; those of text end with their line end.
        kept: how many records at the beginning (a header) are never damaged.
        last: how many records at the end are never damaged.
        checksum: a changed byte does not pass for a good one.
        length_at: offset of the record's length (u16), None for text.
    """

    records: tuple[bytes, ...]
    kept: int = 0
    last: int = 1
    checksum: bool = True
    length_at: int | None = None


class Numbers:
    """Numbers of which no two are alike, as decimal text or integers.

    The sum of their digits is a multiple of ten: one changed digit makes none of them another.
    """

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._taken: set[int] = set()

    def whole(self, least: int, most: int) -> int:
        """An integer that was not drawn before."""
        while (found := self._rng.randint(least, most)) in self._taken or sum(map(int, str(found))) % 10:
            pass
        self._taken.add(found)
        return found

    def decimal(self, least: float, most: float, digits: int = 4) -> float:
        """A number of so many decimals, the last of them not zero, whose digits were not drawn before.

        With digits cut from its end or its middle it has fewer decimals, and is none of the others.
        """
        scale = 10.0**digits
        while not (found := self.whole(round(least * scale), round(most * scale))) % 10:
            pass
        return found / scale

    def velocities(self, count: int) -> list[float]:
        """Velocities, m/s."""
        return [self.decimal(0.1, 3.0) for _ in range(count)]

    def ranges(self, count: int) -> list[float]:
        """Ranges, m."""
        return [self.decimal(5.0, 50.0) for _ in range(count)]


def waterlinked_serial(numbers: Numbers) -> Log:
    """A `wrz` with its four `wru`, each a record."""
    lines = []
    for j in range(PINGS):
        axes = ",".join(f"{v:.4f}" for v in numbers.velocities(3))
        at = _EPOCH_US + j * _STEP_US
        lines.append(
            f"wrz,{axes},y,{numbers.decimal(5, 50)},0.002,1;0;0;0;1;0;0;0;1,{at},{at + 9000},125.00,0"
        )
        for k, (v, r) in enumerate(zip(numbers.velocities(4), numbers.ranges(4), strict=True)):
            lines.append(f"wru,{k},{v:.4f},{r:.4f},-40,-95")
    return Log(tuple(framing.waterlinked_sentence(line.encode()) for line in lines), last=5)


def waterlinked_json(numbers: Numbers) -> Log:
    """A report a line, with the time of validity."""
    lines = []
    for j in range(PINGS):
        v, r, axes = numbers.velocities(4), numbers.ranges(4), numbers.velocities(3)
        report = json.loads(seeds.a50_report(j, version="json_v3.1"))
        for k, one in enumerate(report["transducers"]):
            one |= {"velocity": v[k], "distance": r[k]}
        report |= dict(zip(("vx", "vy", "vz"), axes, strict=True), altitude=numbers.decimal(5, 50))
        report |= {"time": 125.0, "time_of_validity": _EPOCH_US + j * _STEP_US}
        lines.append(json.dumps(report, separators=(",", ":")).encode() + b"\n")
    return Log(tuple(lines), checksum=False)


def nortek_ascii(numbers: Numbers) -> Log:
    """A line a beam, plain."""
    lines = [
        seeds.pnorbt(k, tagged=False, velocity=numbers.decimal(0.1, 3.0), second=1.0 + 0.125 * j)
        for j in range(PINGS)
        for k in range(1, 5)
    ]
    return Log(tuple(lines), last=4)


def cerulean(numbers: Numbers) -> Log:
    """A sentence a ping."""
    lines = []
    for j in range(PINGS):
        v, r = numbers.velocities(3), numbers.ranges(3)
        cones = [f"[{'ABC'[k]}],60,1000,{r[k]:.4f},80.0,{v[k]:.4f},6.0" for k in range(3)]
        time_s = 10.0 + 0.125 * j
        lines.append(seeds.nmea(f"DVKFC,24577,35060,0.1,{time_s},{','.join(cones)},0x0055AAFF".encode()))
    return Log(tuple(lines))


def cerulean_dvl75(numbers: Numbers) -> Log:
    """A sentence a ping; no sum of some of the intervals is that of others."""
    lines = []
    for j in range(PINGS):
        v, r = (
            ",".join(f"{one:.4f}" for one in drawn) for drawn in (numbers.velocities(4), numbers.ranges(4))
        )
        north, east, up = numbers.velocities(3)
        head = f"DVEXT,T,X,3333,1.0,2.0,3.0,0,{-up:.4f},5.00,{north:.4f},{east:.4f},0.0,0.0,{2**j / 1000}"
        lines.append(seeds.nmea(f"{head},1,0,0,0,19,19,48,25,T,T,T,T,{v},{r},".encode()))
    return Log(tuple(lines))


def nucleus_csv(numbers: Numbers) -> Log:
    """Rows of Nortek's driver, without checksum."""
    header, *rows = seeds.nucleus_csv([(0xB4, 0x7FFF)] * PINGS).splitlines(keepends=True)
    names, lines = header.strip().split(b","), []
    for j, row in enumerate(rows):
        fields = row.strip().split(b",")
        fields[names.index(b"timeStamp")] = b"%d" % (1_690_000_000 + 1111 * j)
        of = {
            "velocityBeam1": numbers.velocities,
            "distanceBeam1": numbers.ranges,
            "velocityX": numbers.velocities,
        }
        for first, draw in of.items():
            at = names.index(first.encode())
            fields[at : at + 3] = [f"{one:.4f}".encode() for one in draw(3)]
        lines.append(b",".join(fields) + b"\r\n")
    return Log((header, *lines), kept=1, checksum=False)


def wayfinder(numbers: Numbers) -> Log:
    """A packet a ping."""
    packets = [
        seeds.wayfinder(j, velocity=numbers.velocities(4), ranges=numbers.ranges(4)) for j in range(PINGS)
    ]
    return Log(tuple(packets), length_at=3)


def linkquest(numbers: Numbers) -> Log:
    """Lines of a ROS log without checksum."""
    header, *_ = seeds.linkquest_log(1).splitlines(keepends=True)
    lines = [header]
    for j in range(PINGS):
        stamp = 1372687208633787539 + j * 350_000_000
        values = [stamp + 800_000, 1245 + j, stamp, 1, 1, 1, 1, *numbers.ranges(4), *numbers.velocities(4)]
        values += [*numbers.velocities(3), 1, numbers.decimal(5, 50), 1500.0]
        lines.append(",".join(map(str, values)).encode() + b"\n")
    return Log(tuple(lines), kept=1, checksum=False)


def pd0(numbers: Numbers) -> Log:
    """Ensembles with both velocities."""
    records = []
    for j in range(PINGS):
        v = [numbers.whole(100, 30_000) for _ in range(4)]
        r = [numbers.whole(100, 60_000) for _ in range(4)]
        fine = [100 * one + numbers.whole(4_000_000, 4_000_000_000) % 100 for one in v]
        records.append(seeds.pd0_ensemble(j + 1, velocity=v, ranges=r, fine=fine))
    return Log(tuple(records), length_at=2)


def nortek_dvl(numbers: Numbers) -> Log:
    """DF21 records."""
    records = [
        framing.nortek_frame(0x1B, seeds.df21(j, velocity=numbers.velocities(4), axes=numbers.velocities(4)))
        for j in range(PINGS)
    ]
    return Log(tuple(records), length_at=4)


def nortek_ad2cp(numbers: Numbers) -> Log:
    """DF20 records."""
    records = [
        framing.nortek_frame(
            0x17, seeds.df20(j, velocity=[numbers.whole(100, 30_000) for _ in range(4)]), 0x10
        )
        for j in range(PINGS)
    ]
    return Log(tuple(records), length_at=4)


def nucleus(numbers: Numbers) -> Log:
    """Bottom-track records of three beams."""
    records = [
        framing.nortek_frame(0xB4, seeds.nucleus(j, velocity=numbers.velocities(3)), 0x20)
        for j in range(PINGS)
    ]
    return Log(tuple(records), length_at=4)


BUILDERS: dict[str, Callable[[Numbers], Log]] = {
    "waterlinked-serial": waterlinked_serial,
    "waterlinked-json": waterlinked_json,
    "nortek-ascii": nortek_ascii,
    "cerulean-dvkfc": cerulean,
    "cerulean-dvext": cerulean_dvl75,
    "nucleus-csv": nucleus_csv,
    "wayfinder": wayfinder,
    "linkquest-csv": linkquest,
    "pd0": pd0,
    "nortek-dvl": nortek_dvl,
    "nortek-ad2cp": nortek_ad2cp,
    "nucleus": nucleus,
}


def build(name: str, seed: int) -> Log:
    """The log of a format; the same seed gives the same one."""
    return BUILDERS[name](Numbers(random.Random(seed)))


def joined(records: Sequence[bytes]) -> bytes:
    """Records as a file holds them."""
    return b"".join(records)
