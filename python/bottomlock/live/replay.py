"""A raw log played again through the engine, and what it sends compared with what was sent."""

from collections import deque
from dataclasses import dataclass
from pathlib import Path

from bottomlock.live.checkpoint import resume
from bottomlock.live.config import LiveConfig
from bottomlock.live.engine import Engine, Message
from bottomlock.live.raw_log import read_raw_log


@dataclass(frozen=True)
class Replayed:
    """What a raw log gave when it was played again.

    Attributes:
        messages: that the engine sent, by port.
        sent: messages in the log.
        entries: bytes and connections in the log.
        first_difference: in words; "" where all messages are equal to the bit.
        end: where and why the log ends early; "" for one that was closed.
        damaged: whether that is damage, behind which nothing was played.
    """

    messages: list[Message]
    sent: int
    entries: int
    first_difference: str
    end: str
    damaged: bool

    def text(self) -> str:
        """The outcome in a line."""
        what = f"{self.entries} arrivals, {self.sent} messages"
        return f"{what}: {self.first_difference or 'the same bits'}" + (f"; {self.end}" if self.end else "")


def replay_log(config: LiveConfig, path: Path) -> Replayed:
    """Plays a raw log again.

    A log that was cut off may lack the last messages: these are not compared.

    Raises:
        DataError: for a file that is no raw log, or one of another configuration's sources.
    """
    log = read_raw_log(path)
    saved = log.start.get("checkpoint")
    engine = Engine(config) if saved is None else resume(config, saved)
    messages: list[Message] = []
    open_: deque[Message] = deque()
    sent = entries = 0
    difference = ""
    for entry in log.entries:
        if entry.kind == "out":
            sent += 1
            mine = open_.popleft() if open_ else None
            if not difference and mine != Message(entry.place, entry.data):
                difference = f"message {sent} (port {entry.place}, at {entry.time_ns} ns) differs"
            continue
        entries += 1
        if open_ and not difference:
            difference = f"{len(open_)} messages before {entry.time_ns} ns were not sent then"
        open_.clear()
        new = (
            engine.connected(entry.place, entry.time_ns)
            if entry.kind == "connected"
            else engine.arrive(entry.place, entry.time_ns, entry.data)
        )
        messages += new
        open_.extend(new)
    return Replayed(messages, sent, entries, difference, log.end, log.damaged)
