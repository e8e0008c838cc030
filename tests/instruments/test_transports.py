"""What a simulated instrument sends through sockets and terminals arrives, byte for byte."""

import asyncio
import socket
import threading
import time
from collections.abc import Callable

import pytest

from bottomlock.errors import OutputError
from bottomlock.instruments.faults import Faults
from bottomlock.instruments.play import Channel, parse_address, play, sink_of
from bottomlock.instruments.readings import Readings
from bottomlock.instruments.schedule import Record
from bottomlock.instruments.sources import readings_of_scenario
from bottomlock.live.device import Device
from tests.instruments.test_instruments import sent_of, short


@pytest.fixture(scope="module")
def readings() -> Readings:
    """Five pings a second for 12 s."""
    return readings_of_scenario(short(rate_hz=5.0))


def run(sink: Device, sent: list[Record], opened: Callable[[], None], speed: float | None = None) -> None:
    """Plays records, at full speed unless one is given."""
    channel = Channel("dvl", sink, lambda _: iter(sent))
    asyncio.run(play([channel], speed=speed, opened=opened, offset_ns=lambda: 0, sent=lambda *_: None))


class Client(threading.Thread):
    """Reads a TCP server to the end of each connection; `connections` holds what each one brought."""

    def __init__(self, port: int, most: int = 100) -> None:
        super().__init__(daemon=True)
        self._port, self._most = port, most
        self.connections: list[bytes] = []

    def run(self) -> None:
        """Connects again until nobody listens."""
        for _ in range(self._most):
            try:
                with socket.create_connection(("127.0.0.1", self._port), timeout=10) as line:
                    self.connections.append(b"")
                    while part := line.recv(65_536):
                        self.connections[-1] += part
            except OSError:
                return


def test_tcp_brings_the_same_bytes_to_every_client(readings: Readings) -> None:
    """Two clients from the start, one of which leaves early and disturbs nobody."""
    sent = sent_of(readings, Faults(drops=0.1, half_lines=0.1))
    server = sink_of(parse_address("tcpin:0", "--dvl"))
    clients: list[Client] = []

    def opened() -> None:
        port = int(server.where.rpartition(":")[2])
        clients.extend(Client(port, most=1) for _ in range(2))
        for client in clients:
            client.start()
        while not all(client.connections for client in clients):
            time.sleep(0.01)

    # They are accepted one after the other, before the first record is due.
    run(server, [Record(sent[0].due_ns - 2_400_000_000, b""), *sent], opened, speed=24.0)
    for client in clients:
        client.join(10)
        assert client.connections == [b"".join(one.data for one in sent)]


def test_tcp_reconnects_and_loses_nothing_of_a_connection(readings: Readings) -> None:
    """After a reconnect a client that comes back reads whole records; each connection is a part of the stream."""
    sent = sent_of(readings, Faults(reconnects=0.1), seed=3)
    assert sum(one.closes for one in sent) > 2
    server = sink_of(parse_address("tcpin:0", "--dvl"))
    found: list[Client] = []

    def opened() -> None:
        found.append(Client(int(server.where.rpartition(":")[2])))
        found[0].start()

    # A run of 12 s in two: the client needs time to come back.
    run(server, sent, opened, speed=6.0)
    found[0].join(10)
    whole = b"".join(one.data for one in sent)
    parts = found[0].connections
    assert len(parts) > 2
    at = 0
    for part in parts:
        assert part == b"" or part.endswith(b"\n")
        at = whole.index(part, at)


def test_a_port_in_use_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        sink = sink_of(parse_address(f"tcpin:{taken.getsockname()[1]}", "--dvl"))
        with pytest.raises(OutputError, match=r"^--dvl: cannot be opened \(Address already in use"):
            run(sink, [], lambda: None)


def test_udp_sends_a_record_a_datagram(readings: Readings) -> None:
    sent = sent_of(readings, Faults(drops=0.2))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        line.settimeout(10)
        run(
            sink_of(parse_address(f"udpout:127.0.0.1:{line.getsockname()[1]}", "--dvl")),
            sent,
            lambda: None,
        )
        for one in sent:
            if one.data:
                assert line.recv(65_536) == one.data


def test_a_client_that_does_not_read_holds_nobody_up() -> None:
    """In real time: 40 MB leave at once, and the sleeper is dropped."""
    sent = [Record(0, b"x" * (1 << 20)) for _ in range(40)]
    server = sink_of(parse_address("tcpin:0", "--dvl"))
    sleeper = socket.socket()
    begin_s = 0.0

    def opened() -> None:
        nonlocal begin_s
        sleeper.connect(("127.0.0.1", int(server.where.rpartition(":")[2])))
        begin_s = time.monotonic()

    with sleeper:
        run(server, sent, opened, speed=1.0)
    assert time.monotonic() - begin_s < 4.0
    assert not list(server.receivers)
