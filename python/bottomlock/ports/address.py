"""Addresses of bytes, one grammar for `bottomlock live` and `bottomlock simulate-dvl`, as MAVLink's tools write them.

Who connects says `tcp:HOST:PORT`, who listens `tcpin:HOST:PORT`; who sends datagrams `udpout:HOST:PORT`, who receives
them `udpin:HOST:PORT`. Without a host it is the loopback address.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from pydantic import AfterValidator, ValidationInfo

from bottomlock.config.section import in_folder
from bottomlock.text import nearest

Kind = Literal["tcp", "tcpin", "udpin", "udpout", "serial", "file", "stdin", "stdout", "ros"]
FORMS: dict[Kind, str] = {
    "tcp": "tcp:HOST:PORT (connects)",
    "tcpin": "tcpin:HOST:PORT (listens)",
    "udpin": "udpin:HOST:PORT (listens)",
    "udpout": "udpout:HOST:PORT (sends)",
    "serial": "serial:DEVICE:BAUD",
    "file": "file:PATH",
    "stdin": "stdin",
    "stdout": "stdout",
    "ros": "ros:/TOPIC (of the ROS 2 node)",
}
BAUD = 115_200
"""Where none is given: Water Linked's, and the common one of the others."""
_LOOPBACK = "127.0.0.1"
_TOPIC = re.compile(r"(?:/[A-Za-z_][A-Za-z0-9_]*)+")
"""A topic with its whole name, as ROS 2 has it."""
_LIKELY: dict[str, tuple[Kind, ...]] = {
    "tcp": ("tcpin",),
    "tcpin": ("tcp",),
    "tcpout": ("tcp",),
    "udp": ("udpin", "udpout"),
    "udpin": ("udpout",),
    "udpout": ("udpin",),
}
"""What is meant by a word that is none of the kinds, or not at this place."""


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Attributes:
        kind: one of `FORMS`.
        host: of a network address: where to connect or send to, or where to listen.
        port: 0 lets the system choose one for `tcpin`.
        path: of a file or a serial device; the topic.
        baud: of a serial device; 0 elsewhere.
    """

    kind: Kind
    host: str = ""
    port: int = 0
    path: str = ""
    baud: int = 0

    def __str__(self) -> str:
        return ":".join(str(part) for part in (self.kind, self.host, self.port, self.path, self.baud) if part)

    @property
    def device(self) -> tuple[str, str, int]:
        """What is opened once, whatever is read from and written to it."""
        return self.kind, self.host or self.path, self.port


def forms(kinds: tuple[Kind, ...]) -> str:
    """The forms of these kinds, for help and errors."""
    return ", ".join(FORMS[kind] for kind in kinds)


def parse_address(text: str, kinds: tuple[Kind, ...], *, what: str, any_port: bool = False) -> Address:
    """The parts of an address.

    Args:
        text: the address.
        kinds: that can be used here.
        what: what it is used as, for the error: "a source", "a target".
        any_port: whether `tcpin` may have port 0.

    Raises:
        ValueError: with what was expected, and the likely mistake.

    Examples:
        >>> parse_address("udpin:0.0.0.0:14550", ("tcp", "udpin"), what="a source")
        Address(kind='udpin', host='0.0.0.0', port=14550, path='', baud=0)
        >>> parse_address("tcpin:16171", ("tcpin",), what="a target").host
        '127.0.0.1'
        >>> parse_address("serial:/dev/ttyUSB0:9600", ("serial",), what="a source").baud
        9600
    """
    word, colon, rest = text.partition(":")
    kind = next((known for known in kinds if known == word), None)
    if kind is None:
        raise ValueError(f"'{text}' cannot be {what}, {_hint(word, kinds)}expected one of {forms(kinds)}")
    malformed = f"'{text}' is no address of this kind, expected {FORMS[kind]}"
    if kind in {"stdin", "stdout"}:
        if colon:
            raise ValueError(malformed)
        return Address(kind)
    if kind in {"file", "serial"}:
        if not rest or "\0" in rest:
            raise ValueError(malformed)
        return _path(kind, rest)
    if kind == "ros":
        if not _TOPIC.fullmatch(rest):
            raise ValueError(malformed)
        return Address(kind, path=rest)
    host, _, number = rest.rpartition(":")
    if not (number.isascii() and number.isdigit()) or (":" in host.strip("[]") and not host.startswith("[")):
        raise ValueError(malformed)
    checked_host(host.strip("[]"))
    least = 0 if any_port and kind == "tcpin" else 1
    if not least <= int(number) < 65_536:
        raise ValueError(f"'{text}' has port {number}, expected {least} to 65535")
    return Address(kind, host=host.strip("[]") or _LOOPBACK, port=int(number))


def checked_host(host: str) -> str:
    """The same name of a host, or address; "" for one that is to be chosen.

    Raises:
        ValueError: for what no network looks up.
    """
    try:
        is_name = host.isprintable() and host.encode("idna") is not None
    except UnicodeError:
        is_name = False
    if not is_name:
        raise ValueError(
            f"'{host}' is no name of a host, expected parts of 1 to 63 letters, a dot between them"
        )
    return host


def _path(kind: Kind, rest: str) -> Address:
    """A file, or a serial device, whose name may hold colons."""
    device, _, digits = rest.rpartition(":")
    if kind == "serial":
        named = bool(device) and digits.isdigit()
        return Address(kind, path=device if named else rest, baud=int(digits) if named else BAUD)
    return Address(kind, path=rest)


def _hint(word: str, kinds: tuple[Kind, ...]) -> str:
    likely = [FORMS[kind] for kind in _LIKELY.get(word, ()) if kind in kinds]
    if not likely:
        likely = [FORMS[kind] for kind in kinds if kind == nearest(word, kinds)]
    says = f"{FORMS[word]}; " if word in FORMS and word in _LIKELY else ""
    return f"{says}did you mean {' or '.join(likely)}? " if likely else ""


SOURCES: tuple[Kind, ...] = ("tcp", "tcpin", "udpin", "udpout", "serial", "file", "stdin", "ros")
SINKS: tuple[Kind, ...] = ("tcp", "tcpin", "udpout", "serial", "file", "stdout", "ros")


def source_address(text: str) -> Address:
    """The address of a source of `bottomlock live`. Raises ValueError as `parse_address`."""
    return parse_address(text, SOURCES, what="a source")


def sink_address(text: str) -> Address:
    """The address of a target of `bottomlock live`. Raises ValueError as `parse_address`."""
    return parse_address(text, SINKS, what="a target")


def checked_by(check: Callable[[str], object]) -> AfterValidator:
    """A validator of an address; a file is found from the folder of its settings."""

    def validate(text: str, info: ValidationInfo) -> str:
        check(text)
        kind, colon, file = text.partition(":")
        return f"{kind}{colon}{in_folder(file, info)}" if kind == "file" else text

    return AfterValidator(validate)
