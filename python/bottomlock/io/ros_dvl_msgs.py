"""`dvl_msgs/DVL`, the message of the ROS 2 drivers of Water Linked's A50 and A125, as ROS 2 serialises it.

Fields and signs are those of Water Linked's JSON. The drivers stamp the header when they receive a report. The later
version of the message may state the time of validity on the instrument's clock, in µs; it is used where it is there.
"""

import math
from typing import Any

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.framing import Stream, Whole
from bottomlock.io.ros_messages import LATER_DVL, decode, stamp_ns
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty

NAME = "ros-dvl-msgs"
STREAM = Stream(lambda _: Whole(), repeats=True)
_TYPE = "dvl_msgs/DVL"
_BEAMS = 4


def _decoded(data: bytes) -> Any:  # noqa: ANN401 - as the definition says
    """The message in the version that the bytes hold from their first to their last."""
    try:
        return decode(data, _TYPE)
    except DataError as first:
        try:
            return decode(data, _TYPE, LATER_DVL)
        except DataError:
            raise first from None


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The ping of one message.

    Raises:
        DataError: for bytes that are no such message, and for one without a ping.
    """
    message = _decoded(data)
    validity_us = getattr(message, "time_of_validity", 0)
    account = Account(unit="message", read=1)
    rows = Rows(_BEAMS, account)
    beams = {beam.id: beam for beam in message.beams}
    if len(beams) < len(message.beams) or not beams.keys() <= set(range(_BEAMS)):
        account.skip("beams are not a list with ids 0 to 3", 1)
    else:
        _add(rows, message, [beams.get(k) for k in range(_BEAMS)], validity_us)
    table = rows.finish(negate=options.negate_beams)
    raise_if_empty(account, place, _TYPE)
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="frd",
        clock="the instrument's, µs" if validity_us > 0 else "the message's header, nanoseconds since 1970",
        time_of="validity" if validity_us > 0 else "arrival",
        quality="signal strength rssi as recorded, dBm",
        geometry="waterlinked_a50",
    )


def _add(rows: Rows, message: Any, beams: list[Any], validity_us: int) -> None:  # noqa: ANN401
    """A message to the table; `beams` has None for one that is missing."""
    if None in beams:
        rows.account.flag("transducer missing", 1)
    velocity = [NAN if beam is None else beam.velocity for beam in beams]
    rows.add(
        1,
        1000 * validity_us if validity_us > 0 else stamp_ns(message.header),
        velocity,
        [beam is not None and beam.valid and math.isfinite(beam.velocity) for beam in beams],
        range_m=[NAN if beam is None or beam.distance <= 0.0 else beam.distance for beam in beams],
        quality=[NAN if beam is None else beam.rssi for beam in beams],
        instrument=(message.velocity.x, message.velocity.y, message.velocity.z),
        verdict=int(message.velocity_valid),
        extra={
            "altitude_m": message.altitude if message.altitude > 0.0 else NAN,
            "instrument_sd_mps": message.fom if message.fom > 0.0 else NAN,
        }
        | {f"beam{k + 1}_noise_dbm": NAN if beam is None else beam.nsd for k, beam in enumerate(beams)},
    )
