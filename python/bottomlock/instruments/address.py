"""Where an instrument sends its bytes: `tcp:PORT`, `udp:HOST:PORT`, `pty:LINK`, `serial:DEVICE:BAUD`, `file:PATH`."""

import difflib
from dataclasses import dataclass
from pathlib import Path

from bottomlock.errors import OutputError

EXPECTED = (
    "tcp:PORT, tcp:HOST:PORT, udp:HOST:PORT, pty, pty:LINK, serial:DEVICE, serial:DEVICE:BAUD or file:PATH"
)
KINDS = ("tcp", "udp", "pty", "serial", "file")
BAUD = 115_200
"""Water Linked's, and the common one of the others."""
_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Attributes:
        kind: one of `KINDS`.
        host: of tcp, where to listen; of udp, where to send.
        port: 0 lets the system choose one for tcp.
        path: of the file, the serial device, or the link to the pty; None for a pty without a link.
        baud: of the serial device.
    """

    kind: str
    host: str = ""
    port: int = 0
    path: Path | None = None
    baud: int = BAUD


def parse_address(text: str, option: str) -> Address:
    """The address in a command's option.

    Raises:
        OutputError: naming the option, for what is none of the forms.

    >>> parse_address("tcp:16171", "--dvl")
    Address(kind='tcp', host='127.0.0.1', port=16171, path=None, baud=115200)
    """
    kind, _, rest = text.partition(":")
    if kind not in KINDS:
        close = difflib.get_close_matches(kind, KINDS, n=1, cutoff=0.4)
        hint = f"did you mean '{close[0]}'? " if close else ""
        raise OutputError(f"{option} is '{text}', {hint}expected {EXPECTED}")
    if kind in {"tcp", "udp"}:
        host, _, digits = rest.rpartition(":")
        host = host.removeprefix("[").removesuffix("]")
        if not digits.isdigit() or int(digits) > 65_535 or (kind == "udp" and not int(digits)):
            raise OutputError(f"{option} is '{text}': '{digits}' is no port, expected {EXPECTED}")
        return Address(kind, host or _LOOPBACK, int(digits))
    if kind == "pty":
        return Address(kind, path=Path(rest) if rest else None)
    path, _, digits = rest.rpartition(":")
    if kind == "serial" and path and digits.isdigit():
        return Address(kind, path=Path(path), baud=int(digits))
    if not rest:
        raise OutputError(f"{option} is '{text}': it names no path, expected {EXPECTED}")
    return Address(kind, path=Path(rest))
