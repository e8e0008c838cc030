"""Which addresses the set-up page takes: whoever reaches the page chooses them, and `bottomlock live` opens them.

A file would be read into the raw log, which the page hands out, or appended to. So the form knows devices in the
vehicle's own network and serial lines, and a configuration in the folder may not name a file either.
"""

import ipaddress
from pathlib import PurePosixPath
from typing import Annotated

from bottomlock.errors import ScenarioError
from bottomlock.live.config import LiveConfig
from bottomlock.ports.address import Kind, checked_by, parse_address

_SOURCES: tuple[Kind, ...] = ("tcp", "udpin", "udpout", "serial")
_TARGETS: tuple[Kind, ...] = ("tcp", "tcpin", "udpout", "serial")
_BY_HAND = ("tcp:", "tcpin:", "udpin:", "udpout:", "serial:/dev/")
_LOCAL_NAMES = ("localhost", ".local")


def _check(text: str, kinds: tuple[Kind, ...], what: str) -> None:
    """Raises ValueError for another kind, a device that is none, and a host outside the vehicle's network."""
    address = parse_address(text, kinds, what=what)
    if address.kind == "serial":
        device = PurePosixPath(address.path)
        if not device.is_relative_to("/dev") or ".." in device.parts:
            raise ValueError(
                f"'{text}' is no serial device, expected one in /dev, as serial:/dev/ttyUSB0:115200"
            )
        return
    try:
        host = ipaddress.ip_address(address.host)
        near = host.is_private or host.is_loopback or host.is_link_local or host.is_unspecified
    except ValueError:
        near = address.host.lower().endswith(_LOCAL_NAMES)
    if not near:
        raise ValueError(
            f"'{text}' is outside the vehicle's network, expected a private address, as 192.168.2.1, or a name that "
            "ends in .local"
        )


FormSource = Annotated[str, checked_by(lambda text: _check(text, _SOURCES, "a source of the set-up page"))]
FormTarget = Annotated[str, checked_by(lambda text: _check(text, _TARGETS, "a target of the set-up page"))]


def check_by_hand(config: LiveConfig, place: str) -> None:
    """Checks the addresses of a configuration that the page is to run, whoever wrote it.

    Raises:
        ScenarioError: for one that is neither a network address nor a serial line.
    """
    named = [(f"source.{k}.address", one.address) for k, one in enumerate(config.source)]
    named += [(f"port.{k}.to", one.to) for k, one in enumerate(config.port)]
    if config.diagnostics is not None:
        named.append(("diagnostics.to", config.diagnostics.to))
    for key, address in named:
        if not address.startswith(_BY_HAND) or "/../" in address:
            raise ScenarioError(
                f"is '{address}'",
                place=place,
                key=f"'{key}'",
                expected="tcp, udp or a serial line where the set-up page runs it",
                hint="run this one with `bottomlock live`",
            )
