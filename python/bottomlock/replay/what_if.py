"""Beam losses of a what-if case: beams lost throughout, and outages."""

from bottomlock.errors import DataError
from bottomlock.plant import beam_loss
from bottomlock.recordings.streams import Flags, Times
from bottomlock.replay.dvl_sections import WhatIf


def beams_returned(what_if: WhatIf, time_ns: Times, beams: int, *, start_ns: int) -> Flags:
    """(E, B) validity of the beams at each ping, by every rule of a what-if case.

    Args:
        what_if: the section of the case file.
        time_ns: (E,) times of the pings, from the start of the navigation on.
        beams: number of beams of the instrument.
        start_ns: start of the navigation, from which the section's seconds count.

    Raises:
        DataError: for a beam that does not exist.
    """
    for beam in what_if.beams_named:
        if beam > beams:
            raise DataError(
                f"beam {beam} does not exist", place=f"what_if '{what_if.name}'", expected=f"1 to {beams}"
            )
    outages = [beam_loss.Outage(outage.beams, outage.from_s, outage.to_s) for outage in what_if.outages]
    throughout = beam_loss.Outage(what_if.beams_lost, 0.0, float("inf"))
    return beam_loss.scheduled(time_ns - start_ns, beams, [throughout, *outages])
