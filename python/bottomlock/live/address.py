"""Where bytes come from and go to: the addresses of a configuration, checked when it is read."""

from typing import Annotated

from pydantic import AfterValidator, ValidationInfo

from bottomlock.config.section import in_folder
from bottomlock.ports.address import Address, Kind, parse_address

SOURCES: tuple[Kind, ...] = ("tcp", "tcpin", "udpin", "udpout", "serial", "file", "stdin", "ros")
SINKS: tuple[Kind, ...] = ("tcp", "tcpin", "udpout", "serial", "file", "stdout", "ros")


def source_address(text: str) -> Address:
    """The address of a source.

    Raises:
        ValueError: as `parse_address`.
    """
    return parse_address(text, SOURCES, what="a source")


def sink_address(text: str) -> Address:
    """The address of a target.

    Raises:
        ValueError: as `parse_address`.
    """
    return parse_address(text, SINKS, what="a target")


def _source(text: str, info: ValidationInfo) -> str:
    source_address(text)
    return _in_folder(text, info)


def _sink(text: str, info: ValidationInfo) -> str:
    sink_address(text)
    return _in_folder(text, info)


def _in_folder(text: str, info: ValidationInfo) -> str:
    kind, colon, file = text.partition(":")
    return f"{kind}{colon}{in_folder(file, info)}" if kind == "file" else text


SourceAddress = Annotated[str, AfterValidator(_source)]
SinkAddress = Annotated[str, AfterValidator(_sink)]
