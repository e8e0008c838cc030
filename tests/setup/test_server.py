"""`bottomlock live-setup` as a process: set up, started, stopped, killed, asked by whom it should not answer."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import ipaddress
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from bottomlock.live.http_server import Request
from bottomlock.setup.folder import SetupFolder
from bottomlock.setup.form import HEALTH_PORT, SetupForm
from bottomlock.setup.process import LiveProcess
from bottomlock.setup.server import SetupServer
from tests.live.processes import Instruments, free_port
from tests.setup.blueos import ask, detect_service, get, post

pytest.importorskip("mcap", reason="needs mcap (extra live)")
PATIENCE_S = 60.0


@contextlib.contextmanager
def served(folder: Path, *words: str) -> Iterator[int]:
    """The port of a running set-up page; it ends with SIGTERM, and its live process with it."""
    command = [sys.executable, "-m", "bottomlock", "live-setup", str(folder), "--port", "0", *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:
        try:
            assert running.stderr is not None
            line = running.stderr.readline()
            found = re.search(r"set-up page http://\S+:(\d+)/", line)
            assert found, line + running.stderr.read()
            yield int(found[1])
        finally:
            running.terminate()
            _, told = running.communicate(timeout=PATIENCE_S)
            assert "Traceback" not in told, told
    assert running.returncode == 0


@contextlib.contextmanager
def here(folder: Path, host: str = "127.0.0.1", networks: Sequence[str] = ()) -> Iterator[int]:
    """The port of a set-up page that is served by this process."""
    kept, opened, loop = SetupFolder(folder), threading.Event(), asyncio.new_event_loop()
    free = [ipaddress.ip_network(network) for network in networks]
    server = SetupServer(kept, LiveProcess(kept.config, print), host, 0, networks=free)
    running = loop.create_task(server.run(opened.set))

    def run() -> None:
        with contextlib.suppress(asyncio.CancelledError):
            loop.run_until_complete(running)
        loop.close()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert opened.wait(PATIENCE_S)
        yield int(server.url.rstrip("/").rpartition(":")[2])
    finally:
        loop.call_soon_threadsafe(running.cancel)
        thread.join()


def shown(port: int) -> dict[str, Any]:
    code, text = get(port, "/setup")
    assert code == 200
    content: dict[str, Any] = json.loads(text)
    return content


def until(port: int, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """What the page shows once it holds."""
    end_s = time.monotonic() + PATIENCE_S
    while not holds(content := shown(port)):
        assert time.monotonic() < end_s, content
        time.sleep(0.1)
    return content


def measured(port: int) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(get(port, "/health")[1])
    return content


@pytest.fixture
def health_port() -> Iterator[None]:
    """The one port of the live process is free here, and one test at a time has it, of whatever process."""
    with (Path(tempfile.gettempdir()) / "bottomlock_health_port.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with socket.socket() as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                one.bind(("127.0.0.1", HEALTH_PORT))
            except OSError:
                pytest.skip(f"port {HEALTH_PORT} is taken")
        yield


def form(instruments: Instruments, to: int) -> dict[str, Any]:
    return {
        "mode": "velocity",
        "address": f"tcp:127.0.0.1:{instruments.dvl_port}",
        "to": f"udpout:127.0.0.1:{to}",
    }


@pytest.mark.usefixtures("health_port")
def test_set_up_started_stopped_and_downloaded(tmp_path: Path) -> None:
    """From an empty folder to MAVLink of the autopilot, and the raw log with the bytes of the disk."""
    folder = tmp_path / "vehicle"
    with (
        Instruments(90.0) as instruments,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot,
        served(folder) as port,
    ):
        autopilot.bind(("127.0.0.1", 0))
        autopilot.settimeout(PATIENCE_S)
        assert measured(port)["state"] == "STOPPED"
        assert post(port, "/start") == (
            422,
            {"faults": [{"field": "", "words": "there is no configuration yet: save the form first"}]},
        )
        assert post(port, "/save", form(instruments, autopilot.getsockname()[1])) == (200, {"faults": []})
        assert post(port, "/start") == (200, {"faults": []})
        link = ardupilotmega.MAVLink(None)
        kinds: set[str] = set()
        while len(kinds) < 2:
            kinds |= {one.get_type() for one in link.parse_buffer(autopilot.recv(4096))}
        assert kinds == {"DISTANCE_SENSOR", "VISION_POSITION_DELTA"}
        assert measured(port)["state"] == "OK"
        assert b"bottomlock_state" in get(port, "/metrics")[1]
        assert b"Beams of the last ping" in get(port, "/state")[1]
        assert post(port, "/stop") == (200, {"faults": []})
        stopped = until(port, lambda now: not now["process"]["running"])
        assert stopped["process"]["ended"] == "exit code 0"
        assert any("state OK" in line for line in stopped["process"]["lines"])
        (log,) = stopped["logs"]
        code, content = get(port, f"/logs/{log['name']}")
        assert (code, content) == (200, (folder / "logs" / log["name"]).read_bytes())
        assert len(content) == log["bytes"] > 1000
    # Nothing half-written stays, and no process.
    assert not live_processes(folder)
    assert not list(folder.glob(".*"))


@pytest.mark.long
@pytest.mark.usefixtures("health_port")
def test_killed_it_is_started_again_and_saved_it_begins_anew(tmp_path: Path) -> None:
    """A kill of the live process; another form while it runs; a whole start of the vehicle, in which it goes on."""
    with Instruments(120.0) as instruments:
        with served(tmp_path) as port:
            post(port, "/save", form(instruments, free_port(socket.SOCK_DGRAM)))
            post(port, "/start")
            until(port, lambda now: any("raw log" in line for line in now["process"]["lines"]))
            (live,) = live_processes(tmp_path)
            os.kill(live, signal.SIGKILL)
            until(port, lambda now: any("ended: signal SIGKILL" in line for line in now["process"]["lines"]))
            until(port, lambda now: now["process"]["running"] and len(now["logs"]) == 2)
            changed = form(instruments, free_port(socket.SOCK_DGRAM)) | {"name": "second"}
            assert post(port, "/save", changed)[0] == 200
            until(port, lambda now: now["process"]["running"] and len(now["logs"]) == 3)
        with served(tmp_path) as port:
            again = until(port, lambda now: len(now["logs"]) == 4)
            assert again["process"]["wanted"]
            assert again["form"]["name"] == "second"
            end_s = time.monotonic() + PATIENCE_S
            while measured(port).get("name") != "second":
                assert time.monotonic() < end_s
                time.sleep(0.1)


def live_processes(folder: Path) -> list[int]:
    """Processes that run `bottomlock live` in a folder."""
    listed = subprocess.run(
        ["ps", "-ww", "-eo", "pid=,args="], capture_output=True, text=True, check=True
    ).stdout
    wanted = f" -m bottomlock live {folder / 'live.toml'}"
    return [int(line.split(None, 1)[0]) for line in listed.splitlines() if line.endswith(wanted)]


def test_blueos_finds_the_service(tmp_path: Path) -> None:
    """As its helper does: a page, then metadata of its own type; the name that BlueOS makes of it has letters."""
    with here(tmp_path) as port:
        found = detect_service(port)
        assert found is not None
        assert re.sub(r"[^a-z0-9]", "", found.name.lower()) == "bottomlock"
        assert found.icon.startswith("mdi-")
        assert found.works_in_relative_paths
        # Relative, or the page would ask BlueOS itself under /extensionv2/bottomlock/.
        page = get(port, "/")[1].decode()
        assert not re.findall(r"""(?:fetch|EventSource|href|src)[(=]["'`]/""", page)
        assert get(port, "/docs")[0] == 404


def test_other_pages_change_nothing(tmp_path: Path) -> None:
    """A form of another page, one of another origin, a name of the web, a method, a length: each is refused."""
    with here(tmp_path) as port:
        good = {"Content-Type": "application/json"}
        body = json.dumps({"mode": "velocity"})
        for headers, code in (
            ({"Content-Type": "text/plain"}, 415),
            ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
            ({}, 415),
            (good | {"Origin": "http://evil.example"}, 403),
            (good | {"Origin": "null"}, 403),
            (good | {"Host": "evil.example"}, 421),
            (good | {"Host": "rov.local:8770"}, 421),
            (good | {"Host": "blueos.local.evil.example"}, 421),
            (good | {"Content-Length": "99999999999999"}, 413),
            (good | {"Content-Length": "-1"}, 411),
        ):
            assert ask(port, "POST", "/save", body, headers)[0] == code, headers
        for nothing in ("null", "[]", "5", '"x"', '{"latitude_deg": true}', "[" * 60_000):
            assert ask(port, "POST", "/save", nothing, good)[0] == 422, nothing
        # A browser asks for leave before a POST of JSON from another origin: there is none.
        assert ask(port, "OPTIONS", "/save", None, {"Origin": "http://blueos.local"})[0] == 405
        assert get(port, "/save")[0] == 404
        assert not list(tmp_path.iterdir())
    # Through BlueOS' own server, and by the vehicle's name in its network.
    with served(tmp_path, "--host", "0.0.0.0", "--names", ".local", "--networks", "127.0.0.0/8") as port:
        for origin, host in (
            ("http://blueos.local", "127.0.0.1"),
            ("http://192.168.2.2:8770", "rov.local:8770"),
        ):
            assert ask(port, "POST", "/save", body, good | {"Origin": origin, "Host": host})[0] == 200


def test_a_neighbour_needs_the_token(tmp_path: Path) -> None:
    """Beyond the loopback address: no page, no state, no log, no change; with the printed address all of it."""
    with served(tmp_path, "--host", "0.0.0.0") as port:
        token = (tmp_path / "token").read_text()
        assert len(token) > 20
        assert (tmp_path / "token").stat().st_mode & 0o077 == 0
        for path in (
            "/",
            "/setup",
            "/state",
            "/health",
            "/events",
            "/logs/a.mcap",
            "/register_service",
            f"/{token[:-1]}/",
        ):
            assert get(port, path)[0] == 403, path
        for path in ("/start", "/stop", "/save"):
            assert post(port, path)[0] == 403, path
        assert get(port, f"/{token}/setup")[0] == 200
        assert ask(port, "GET", f"/{token}", None, {})[0] == 308
        assert post(port, f"/{token}/save", {"mode": "velocity"}) == (200, {"faults": []})
    with here(tmp_path, "0.0.0.0", ["10.0.0.0/8"]) as port:
        assert get(port, "/setup")[0] == 403
        assert get(port, f"/{token}/setup")[0] == 200


@pytest.mark.parametrize("field", ["address", "imu", "to"])
@pytest.mark.parametrize(
    "address",
    [
        "file:/etc/passwd", "stdin", "stdout", "ros:/imu", "serial:/etc/passwd", "zenoh:tcp/1.1.1.1:7447",
        "serial:/dev/../etc/passwd", "tcp:8.8.8.8:80", "tcp:example.org:80", "udpin:8.8.8.8:80", "udpout:8.8.8.8:80",
    ],
)  # fmt: skip
def test_no_file_and_no_foreign_host_is_named_by_the_page(field: str, address: str, tmp_path: Path) -> None:
    """Whoever reaches the page would read files through the raw log, append to them, or send to the internet."""
    folder = SetupFolder(tmp_path)
    server = SetupServer(folder, LiveProcess(folder.config, print), "127.0.0.1")
    body = json.dumps({"latitude_deg": 1.0, field: address}).encode()
    answer = asyncio.run(server._post(Request("POST", "/save", {}, body)))
    assert b"422" in answer.splitlines()[0]
    assert [one["field"] for one in json.loads(answer.rpartition(b"\r\n\r\n")[2])["faults"]] == [field]
    assert not list(tmp_path.iterdir())


def test_a_configuration_in_the_folder_names_no_file(tmp_path: Path) -> None:
    """Neither started by the page nor, as one that was running, by a start of the vehicle."""
    SetupFolder(tmp_path).save(SetupForm(mode="velocity"))
    config = tmp_path / "live.toml"
    text = config.read_text()
    faults = [
        text.replace(*change)
        for change in (
            ("tcp:192.168.194.95:16171", "file:/etc/passwd"),
            ("tcp:192.168.194.95:16171", "serial:/etc/passwd"),
            ("tcp:127.0.0.1:5777", "file:/tmp/taken"),
        )
    ]
    config.write_text(faults[0])
    SetupFolder(tmp_path).shall_run = True
    with served(tmp_path) as port:
        for faulty, key in zip(faults, ("source.0.address", "source.0.address", "port.0.to"), strict=True):
            assert not shown(port)["process"]["wanted"]
            config.write_text(faulty)
            code, answer = post(port, "/start")
            assert (code, key in answer["faults"][0]["words"]) == (422, True)


NOT_GIVEN = (
    "../live.toml", "..%2Flive.toml", "/etc/passwd", "", ".", "secret.txt", "link.mcap", "folder.mcap",
    "a.mcap/../../x",
)  # fmt: skip


def test_only_raw_logs_are_given(tmp_path: Path) -> None:
    """No path, no other file, no link, no folder."""
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "a.mcap").write_bytes(b"log")
    (logs / "secret.txt").write_bytes(b"secret")
    (tmp_path / "live.toml").write_text("secret")
    (logs / "link.mcap").symlink_to(tmp_path / "live.toml")
    (logs / "folder.mcap").mkdir()
    with here(tmp_path) as port:
        assert get(port, "/logs/a.mcap") == (200, b"log")
        assert [log["name"] for log in shown(port)["logs"]] == ["a.mcap"]
        for name in NOT_GIVEN:
            assert get(port, f"/logs/{name}")[0] == 404, name
