"""Where bytes come from and go to: the addresses of a configuration, written as MAVLink's tools write them."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator

Kind = Literal["tcp", "tcpin", "udpin", "udpout", "serial", "file", "stdin", "stdout"]
_NETWORK = ("tcp", "tcpin", "udpin", "udpout")
SOURCES: tuple[Kind, ...] = ("tcp", "tcpin", "udpin", "serial", "file", "stdin")
SINKS: tuple[Kind, ...] = ("tcp", "tcpin", "udpout", "serial", "file", "stdout")
FORMS = {
    "tcp": "tcp:HOST:PORT (connects)",
    "tcpin": "tcpin:HOST:PORT (listens)",
    "udpin": "udpin:HOST:PORT (listens)",
    "udpout": "udpout:HOST:PORT",
    "serial": "serial:DEVICE:BAUD",
    "file": "file:PATH",
    "stdin": "stdin",
    "stdout": "stdout",
}


@dataclass(frozen=True)
class Address:
    """A parsed address: host and port of a network address, path and baud rate of a serial line, path of a file."""

    kind: Kind
    host: str = ""
    port: int = 0
    path: str = ""
    baud: int = 0


def parse_address(text: str) -> Address:
    """The parts of an address.

    Raises:
        ValueError: with what was expected.

    Examples:
        >>> parse_address("udpin:0.0.0.0:14550")
        Address(kind='udpin', host='0.0.0.0', port=14550, path='', baud=0)
        >>> parse_address("serial:/dev/ttyUSB0:115200").baud
        115200
    """
    word, _, rest = text.partition(":")
    kind: Kind | None = next((known for known in SOURCES + SINKS if known == word), None)
    if kind is None:
        raise ValueError(
            f"'{text}' has no known kind of address, expected one of {', '.join(FORMS.values())}"
        )
    malformed = ValueError(f"'{text}' is no address of this kind, expected {FORMS[kind]}")
    if kind in {"stdin", "stdout"}:
        if rest:
            raise malformed
        return Address(kind)
    if kind == "file":
        if not rest:
            raise malformed
        return Address(kind, path=rest)
    place, _, number = rest.rpartition(":")
    if not place or not number.isdigit():
        raise malformed
    if kind == "serial":
        return Address(kind, path=place, baud=int(number))
    if not 0 < int(number) < 65_536:
        raise ValueError(f"'{text}' has port {number}, expected 1 to 65535")
    return Address(kind, host=place.strip("[]"), port=int(number))


def _of(kinds: tuple[Kind, ...], what: str) -> AfterValidator:
    def check(text: str) -> str:
        if parse_address(text).kind not in kinds:
            known = ", ".join(FORMS[kind] for kind in kinds)
            raise ValueError(f"'{text}' cannot be {what}, expected one of {known}")
        return text

    return AfterValidator(check)


SourceAddress = Annotated[str, _of(SOURCES, "a source")]
SinkAddress = Annotated[str, _of(SINKS, "a target")]
