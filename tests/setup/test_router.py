"""The whole of the form's configuration beside a MAVLink router such as BlueOS has: one TCP port for everything."""

from __future__ import annotations

import select
import socket
import threading
import time
from pathlib import Path
from typing import Self

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from bottomlock.kernel import normal_gravity_mps2
from tests.live.processes import Instruments
from tests.setup.blueos import post
from tests.setup.test_server import PATIENCE_S, health_port, measured, served

pytest.importorskip("mcap", reason="needs mcap (extra live)")
__all__ = ["health_port"]
RATE_HZ = 50


class Router:
    """A router with an ArduSub behind it that sends HIGHRES_IMU and ATTITUDE once it is asked. A context manager.

    Attributes:
        received: the messages of its clients, of any kind.
    """

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._server.getsockname()[1])
        self.received: list[ardupilotmega.MAVLink_message] = []
        self._link = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
        self._clients: dict[socket.socket, ardupilotmega.MAVLink] = {}
        self._asked: set[int] = set()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._force = (0.0, 0.0, -normal_gravity_mps2(0.5))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for one in (self._server, *self._clients):
            one.close()

    def _run(self) -> None:
        begin, k = time.monotonic(), 0
        while not self._stop.is_set():
            self._read()
            k += 1
            boot_s = k / RATE_HZ
            messages = (
                [ardupilotmega.MAVLink_heartbeat_message(12, 3, 81, 0, 4, 3)] if k % RATE_HZ == 1 else []
            )
            if ardupilotmega.MAVLINK_MSG_ID_HIGHRES_IMU in self._asked:
                numbers = (*self._force, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0, 0, 63)
                messages.append(ardupilotmega.MAVLink_highres_imu_message(round(boot_s * 1e6), *numbers))
            if ardupilotmega.MAVLINK_MSG_ID_ATTITUDE in self._asked and k % 5 == 0:
                messages.append(ardupilotmega.MAVLink_attitude_message(round(boot_s * 1e3), 0, 0, 0, 0, 0, 0))
            data = b"".join(bytes(message.pack(self._link)) for message in messages)
            for client in list(self._clients):
                try:
                    client.sendall(data)
                except OSError:
                    self._close(client)
            time.sleep(max(begin + boot_s - time.monotonic(), 0.0))

    def _read(self) -> None:
        for ready in select.select([self._server, *self._clients], [], [], 0.0)[0]:
            if ready is self._server:
                self._clients[ready.accept()[0]] = ardupilotmega.MAVLink(None)
                continue
            try:
                data = ready.recv(65_536)
            except ConnectionResetError:  # it ended with messages of ours unread
                data = b""
            if not data:
                self._close(ready)
                continue
            for message in self._clients[ready].parse_buffer(data) or []:
                self.received.append(message)
                if (
                    message.get_type() == "COMMAND_LONG"
                    and message.command == 511
                    and message.target_system == 1
                ):
                    self._asked.add(int(message.param1))

    def _close(self, client: socket.socket) -> None:
        self._clients.pop(client).parse_buffer(b"")
        client.close()


@pytest.mark.first_cases(1)
@pytest.mark.parametrize(("autopilot", "kind"), [("ardusub", "VISION_POSITION_DELTA"), ("px4", "ODOMETRY")])
@pytest.mark.usefixtures("health_port")
def test_it_navigates_with_what_it_asked_for(tmp_path: Path, autopilot: str, kind: str) -> None:
    """Nothing comes of the autopilot's IMU until it is asked; then navigation starts, and its messages come back."""
    with Instruments(120.0) as instruments, Router() as router, served(tmp_path) as port:
        place = f"tcp:127.0.0.1:{router.port}"
        form = {
            "address": f"tcp:127.0.0.1:{instruments.dvl_port}", "to": place, "imu": place, "autopilot": autopilot,
            "latitude_deg": 28.6,
        }  # fmt: skip
        assert post(port, "/save", form)[0] == 200
        assert post(port, "/start")[0] == 200
        end_s = time.monotonic() + PATIENCE_S
        while len(found := [one for one in router.received if one.get_type() == kind]) < 20:
            assert time.monotonic() < end_s, measured(port)
            time.sleep(0.1)
        shown = measured(port)
    assert shown["mode"] == "navigation"
    commands = {one.param1: one.param2 for one in router.received if one.get_type() == "COMMAND_LONG"}
    assert commands == {105.0: 20_000.0, 30.0: 100_000.0}
    last = found[-1]
    if kind == "ODOMETRY":
        velocity = np.array([last.vx, last.vy, last.vz])
    else:
        velocity = np.array(last.position_delta) / (last.time_delta_usec * 1e-6)
    # The velocity of the instruments' vehicle (tests/live/world.py).
    np.testing.assert_allclose(velocity, [1.0, 0.1, 0.05], atol=0.1)
