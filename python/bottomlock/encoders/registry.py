"""The encoders by name; the names are those of the readers in `bottomlock.io.formats`.

A new one is a module with `encode(ping, instrument)`, and a line in `FORMATS`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bottomlock.encoders import cerulean, nortek, pd0, waterlinked_json, waterlinked_serial
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.errors import ScenarioError
from bottomlock.kernel import BeamGeometry
from bottomlock.text import did_you_mean


@dataclass(frozen=True)
class Format:
    """A maker's record of a ping.

    Attributes:
        name: as the reader's.
        beams: that a record holds.
        encode: bytes of a ping.
        commands: makes what answers the commands of its clients; None where they are not answered.
    """

    name: str
    beams: int
    encode: Callable[[Ping, Instrument], bytes]
    commands: type[waterlinked_json.Commands] | None = None


FORMATS = (
    Format("waterlinked-json", 4, waterlinked_json.encode, waterlinked_json.Commands),
    Format("waterlinked-serial", 4, waterlinked_serial.encode, waterlinked_serial.SerialCommands),
    Format("pd0", 4, pd0.encode),
    Format("nortek-dvl", 4, nortek.dvl),
    Format("nucleus", 3, nortek.nucleus1000),
    Format("cerulean-dvkfc", 3, cerulean.encode),
)
NAMES = tuple(one.name for one in FORMATS)


@dataclass(frozen=True)
class Encoder:
    """Writes the pings of one instrument in one format."""

    format: Format
    instrument: Instrument

    def encode(self, ping: Ping) -> bytes:
        """The record of a ping; for text with its line end.

        Raises:
            DataError: for another number of beams, and a number that the record does not hold.
        """
        if self.format.beams != ping.beams:
            raise ping.fault(f"has {ping.beams} beams, {self.format.name} holds {self.format.beams}")
        return self.format.encode(ping, self.instrument)


def format_named(name: str) -> Format:
    """The format of a name.

    Raises:
        ScenarioError: for an unknown one, with the nearest.
    """
    for one in FORMATS:
        if one.name == name:
            return one
    raise ScenarioError(f"format '{name}' is unknown{did_you_mean(name, NAMES)} (known: {', '.join(NAMES)})")


def encoder(name: str, geometry: BeamGeometry, *, start_ns: int = 0) -> Encoder:
    """The encoder of an instrument with these beams.

    Args:
        name: of the format.
        geometry: the beams.
        start_ns: when the instrument was switched on, for the formats whose clock counts from there.

    Raises:
        ScenarioError: for an unknown format, and one that holds another number of beams.
    """
    found = format_named(name)
    if found.beams != geometry.beams:
        raise ScenarioError(
            f"format {name} holds {found.beams} beams, the geometry has {geometry.beams}",
            hint=f"use another format, or a geometry of {found.beams} beams",
        )
    down = np.clip(np.asarray(geometry.directions_p)[:, 2], -1.0, 1.0)
    return Encoder(found, Instrument(float(np.mean(np.arccos(down))), start_ns))
