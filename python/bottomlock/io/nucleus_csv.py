"""Nortek Nucleus1000 as the manufacturer's Python driver logs its packets: `nucleus_log.csv`, a row a packet.

Columns and flags are the fields of the binary records (`nucleus`); a row of another packet leaves them empty.

Source: NortekSupport/nucleus_driver, src/nucleus_driver/_logger.py and _parser.py.
"""

import numpy as np

from bottomlock.io.decoder import Format, TableDecoder
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, WATER_NUCLEUS, name_of
from bottomlock.io.nucleus import LAYOUT, NucleusDecoder
from bottomlock.io.rows import NAN
from bottomlock.io.sentences import number, whole

_BEAMS = (1, 2, 3)
_FLAGS = (
    *(f"status.beam{k}{what}Valid" for what in ("Velocity", "Distance", "Fom") for k in _BEAMS),
    *(f"status.{axis}{what}Valid" for what in ("Velocity", "Fom") for axis in "xyz"),
)
"""In the order of the bits of the status word."""
_TRIPLES = {
    **{of: [f"{what}Beam{k}" for k in _BEAMS]
       for of, what in (("velocity", "velocity"), ("distance", "distance"), ("fom", "fom"), ("delay", "dt"))},
    "axes": [f"velocity{axis}" for axis in "XYZ"],
    "axes_fom": [f"fom{axis}" for axis in "XYZ"],
}  # fmt: skip
"""Columns of the fields of three numbers."""
_SAID = {b"True": 1, b"False": 0, b"1": 1, b"0": 0}


class _Decoder(NucleusDecoder, TableDecoder):
    """A row a packet."""

    needed = (
        "id", "timeStamp", "microSeconds", "flags.posixTime", *_FLAGS, "soundSpeed",
        *(name for names in _TRIPLES.values() for name in names),
    )  # fmt: skip
    what = "a log of Nortek's driver"

    def record(self, position: int, fields: list[bytes], line: bytes) -> bool:
        """Takes a row; of other packets it is counted."""
        del line
        kind, *clock = map(whole, fields[:3])
        if kind is not None and kind not in {BOTTOM_NUCLEUS, WATER_NUCLEUS}:
            self.account.pass_by(name_of(kind), position)
            return True
        first = 3 + len(_FLAGS) + 1
        flags = [flag for one in fields[3:first] if (flag := _SAID.get(one.strip())) is not None]
        values = [v for one in fields[first:] if (v := NAN if one == b"nan" else number(one)) is not None]
        if kind is None or len(flags) + len(values) < len(fields) - 3:
            return False
        if any(one is None or not 0 <= one < 1 << 32 for one in clock):
            return False
        row = np.zeros(1, dtype=LAYOUT.fields)[0]
        row["seconds"], row["micros"] = clock
        row["flags"], row["status"] = flags[0], sum(flag << k for k, flag in enumerate(flags[1:]))
        with np.errstate(over="ignore"):
            row["sound"] = values[0]
            for k, name in enumerate(_TRIPLES):
                row[name] = values[1 + 3 * k : 4 + 3 * k]
        self.track(position, kind, row)
        return True


def _sniff(head: bytes) -> bool:
    first = head.split(b"\n", 1)[0]
    return b"velocityBeam1," in first and b"status.beam1VelocityValid," in first


FORMAT = Format(
    "nucleus-csv", "Nortek Nucleus1000, CSV of its driver", _sniff, _Decoder, live=False, figures=True
)
