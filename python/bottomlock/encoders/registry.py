"""The encoders by name; the names are those of the readers in `bottomlock.io.formats`.

A new one is a module with `NAME` and `encode(ping, instrument)`, and a line in `FORMATS`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bottomlock.encoders import cerulean, nortek_dvl, nucleus, pd0, waterlinked_json, waterlinked_serial
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.errors import DataError, ScenarioError
from bottomlock.kernel import BeamGeometry
from bottomlock.support.nearest import did_you_mean


@dataclass(frozen=True)
class Format:
    """A maker's record of a ping, and how fine its numbers are.

    Attributes:
        name: as the reader's.
        title: of the instrument.
        beams: that a record holds.
        encode: bytes of a ping.
        time_of: which of a ping's times the record's clock states.
        time_step_ns: step of that clock.
        velocity_step_mps: step of a beam's velocity; 0 for a float.
        range_step_m: step of a beam's range; 0 for a float.
        relative: largest relative error of a float in the record.
    """

    name: str
    title: str
    beams: int
    encode: Callable[[Ping, Instrument], bytes]
    time_of: Literal["validity", "trigger"]
    time_step_ns: int
    velocity_step_mps: float = 0.0
    range_step_m: float = 0.0
    relative: float = 0.0


_SINGLE = 2.0**-23
FORMATS = (
    Format(waterlinked_json.NAME, "Water Linked TCP", 4, waterlinked_json.encode, "validity", 1000),
    Format(
        waterlinked_serial.NAME,
        "Water Linked serial",
        4,
        waterlinked_serial.encode,
        "validity",
        1000,
        1e-3,
        0.01,
    ),
    Format(pd0.NAME, "Teledyne PD0, beams", 4, pd0.encode, "trigger", 10_000_000, 1e-3, 0.01),
    Format(
        nortek_dvl.NAME,
        "Nortek DVL500, DVL1000, DF21",
        4,
        nortek_dvl.encode,
        "trigger",
        100_000,
        relative=_SINGLE,
    ),
    Format(nucleus.NAME, "Nortek Nucleus1000", 3, nucleus.encode, "trigger", 1000, relative=_SINGLE),
    Format(cerulean.NAME, "Cerulean Tracker 650", 3, cerulean.encode, "trigger", 1000, 1e-6, 1e-6),
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
            raise DataError(
                f"ping {ping.number} at {ping.time_ns} ns has {ping.beams} beams, {self.format.name} holds "
                f"{self.format.beams}"
            )
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
