"""The health page: what the engine knows, as HTML with server-sent events, as JSON, and as Prometheus text.

Read only, and on the loopback address unless the configuration says otherwise. One page file, nothing from a network.
"""

import asyncio
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import resources
from types import MappingProxyType
from typing import Any

import numpy as np

from bottomlock.files.atomic_write import plain
from bottomlock.live.http_server import HTML, JSON, REQUEST_S, TEXT, HttpServer, Request, reply
from bottomlock.live.runner import Live
from bottomlock.live.states import ORDER
from bottomlock.ports.estimate import Estimate
from bottomlock.recordings.rotation import angles

EVENT_S = 0.25
"""Time between two events of the page."""
_STREAMS = 16
"""Most connections that follow the events at a time."""
_AXES, _ANGLES = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")


def status(live: Live) -> dict[str, Any]:
    """Everything that page, metrics, terminal and diagnostics show: what JSON can hold, None for what is not known.

    Keys:
        name, mode, state, why, state_for_s: of the process; `why` is the condition that asked for the state.
        reset_counter: discontinuities that no measurement explains, modulo 256. internal_errors: of the program.
        velocity_mps, velocity_sd_mps: surge, sway, heave. estimate_age_s: since the time of the estimate.
        attitude_rpy_rad: roll, pitch, yaw; attitude_sd_rad: of a rotation about north, east, down.
        beams: a row a beam of the last ping (velocity_mps, used). rank: directions that its used beams determine.
        ping: verdict of the gate, why, and nis per degree of freedom.
        reference: slow error of the attitude reference by angle (error_rad, sd_rad). gated: rejections by sensor.
        water: the current north and east (current_mps, current_sd_mps), and what became of the cells; None without.
        sources: a row a source: what its connection does, connections, age_s of its last byte, records, readings
            taken, skipped, flagged and refused by reason, bytes_dropped between records, pieces_not_read, clock_steps,
            late.
        ports: a row a port: to, what its target does, messages sent and dropped, and silent_because.
        raw_log: file and bytes; None without.
    """
    engine, now_ns = live.engine, live.clock()
    estimator, machine = engine.estimator, engine.machine
    known = estimator.estimate(engine.state, engine.reset_counter)
    sd = [None] * 3 if known is None else np.sqrt(np.diag(known.covariance_m2ps2))
    attitude, attitude_sd = _attitude(known)
    shown = {
        "name": engine.config.name,
        "mode": engine.config.mode,
        "state": engine.state,
        "why": machine.why,
        "state_for_s": None if machine.since_ns is None else _age_s(now_ns, machine.since_ns),
        "reset_counter": engine.reset_counter,
        "internal_errors": live.faults,
        "velocity_mps": [None] * 3 if known is None else known.velocity_p_mps,
        "velocity_sd_mps": sd,
        "attitude_rpy_rad": attitude,
        "attitude_sd_rad": attitude_sd,
        "estimate_age_s": None if known is None else _age_s(now_ns, known.time_ns),
        "beams": [
            {"velocity_mps": v, "used": used}
            for v, used in zip(estimator.last.velocity_mps, estimator.last.used, strict=True)
        ],
        "rank": estimator.rank,
        "ping": {"verdict": estimator.last.verdict, "why": estimator.last.why, "nis": estimator.last.nis},
        **estimator.known(),
        "gated": dict(estimator.doubts.gated),
        "sources": [_source(live, place, now_ns) for place in range(len(engine.sources))],
        "ports": [_port(live, place) for place in range(len(engine.ports))],
        "raw_log": None if live.log is None else {"file": live.log.path.name, "bytes": live.log.bytes},
    }
    return dict(plain(shown))


def _attitude(known: Estimate | None) -> tuple[Any, Any]:
    """Roll, pitch, yaw of the platform, rad, and 1 sigma of its rotation about north, east, down; None without."""
    if known is None or known.attitude_t_p is None or known.navigation_covariance is None:
        return [None] * 3, [None] * 3
    return angles(known.attitude_t_p), np.sqrt(np.diag(known.navigation_covariance)[3:6])


def _age_s(now_ns: int, then_ns: int) -> float:
    return round(max(now_ns - then_ns, 0) * 1e-9, 3)


def _source(live: Live, place: int, now_ns: int) -> dict[str, Any]:
    one, connection = live.engine.sources[place], live.sources[place]
    return {
        "name": one.section.name,
        "format": one.section.format,
        "connection": connection.state,
        "connections": one.connections,
        "age_s": None if one.last_ns is None else _age_s(now_ns, one.last_ns),
        "records": one.reader.records,
        "taken": one.used,
        "skipped": dict(one.reader.skipped),
        "flagged": dict(one.reader.flagged),
        "refused": dict(one.refused),
        "bytes_dropped": one.reader.framer.dropped,
        "pieces_not_read": connection.not_read,
        "clock_steps": one.clock_steps,
        "late": sum(clock.late for clock in one.clocks.values()),
    }


def _port(live: Live, place: int) -> dict[str, Any]:
    one = live.engine.ports[place]
    sink = live.sinks[place] if live.sinks else None
    return {
        "port": one.name,
        "to": live.config.port[place].to,
        "target": "dry run" if sink is None else sink.state,
        "sent": one.sent if sink is None else sink.written[place],
        "dropped": 0 if sink is None else sink.dropped[place],
        "silent_because": one.silent_because,
    }


_ONE_OF = {"reference": "angle", "gated": "sensor", "skipped": "why", "flagged": "why", "refused": "why"}
"""What the keys of these are, in place of a part of the name."""
_ROWS = {"beams": "beam", "sources": "source", "ports": "port"}
_COUNTERS = (
    "errors", "connections", "records", "taken", "skipped", "flagged", "refused", "dropped", "pieces_not_read",
    "clock_steps", "late", "sent", "gated",
)  # fmt: skip
Leaf = tuple[str, dict[str, str], Any]


def leaves(value: Any, name: str = "", labels: Mapping[str, str] = MappingProxyType({})) -> Iterator[Leaf]:  # noqa: ANN401
    """Every number and text of a status: a name of its keys, labels of what it is one of, and the value."""
    labels = dict(labels)
    if isinstance(value, dict):
        of = _ONE_OF.get(name.rpartition("_")[2])
        for key, one in value.items():
            if of is not None and of not in labels:
                yield from leaves(one, name, labels | {of: key})
            else:
                yield from leaves(one, f"{name}_{key}" if name else key, labels)
    elif name in _ROWS:
        for number, row in enumerate(value, 1):
            label = str(row.get("name") or row.get("port") or number)
            more = {"to": row["to"]} if "to" in row else {}
            yield from leaves(row, _ROWS[name], labels | {_ROWS[name]: label} | more)
    elif isinstance(value, list):
        of = "angle" if name.startswith("attitude") else "axis"
        keys = ("north", "east") if len(value) < len(_AXES) else _ANGLES if of == "angle" else _AXES
        for key, one in zip(keys, value, strict=True):
            yield from leaves(one, name, labels | {of: key})
    elif value is not None:
        yield name, labels, value


def metrics(shown: dict[str, Any]) -> str:
    """The numbers of the status as Prometheus text, and 1 for the state now."""
    found: dict[str, list[str]] = {}
    states: list[Leaf] = [
        ("state", {"state": one}, one == shown["state"]) for one in ("INITIALISING", *ORDER)
    ]
    for name, labels, value in [*states, *leaves(shown)]:
        if isinstance(value, str):
            continue
        is_counter = name.endswith(_COUNTERS)
        text = ",".join(f'{key}="{_escaped(label)}"' for key, label in labels.items())
        full = f"bottomlock_{name}{'_total' if is_counter else ''}"
        head = f"# TYPE {full} {'counter' if is_counter else 'gauge'}"
        found.setdefault(full, [head]).append(
            f"{full}{{{text}}} {value:.9g}" if text else f"{full} {value:.9g}"
        )
    return "\n".join(line for lines in found.values() for line in lines) + "\n"


def _escaped(label: str) -> str:
    return label.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


class HealthServer(HttpServer):
    """Serves the page on the running loop.

    Args:
        show: gives the status; asked once in `EVENT_S` at most, however many clients there are.
        host, port, names, say: see `HttpServer`.
    """

    def __init__(
        self,
        show: Callable[[], dict[str, Any]],
        host: str,
        port: int,
        *,
        names: Sequence[str] = (),
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        super().__init__(host, port, names=names, say=say)
        self._source = show
        self._shown: tuple[float, dict[str, Any]] | None = None
        self._streams = 0

    def _show(self) -> dict[str, Any]:
        now = asyncio.get_running_loop().time()
        if self._shown is None or now - self._shown[0] >= EVENT_S:
            self._shown = now, self._source()
        return self._shown[1]

    async def _answer(self, request: Request, writer: asyncio.StreamWriter) -> None:
        path = request.path
        if path == "/":
            writer.write(reply(200, HTML, page()))
        elif path == "/health":
            shown = self._show()
            good = shown["state"] not in {"UNSAFE", "INITIALISING"}
            writer.write(reply(200 if good else 503, JSON, json.dumps(shown).encode() + b"\n"))
        elif path == "/metrics":
            writer.write(reply(200, "text/plain; version=0.0.4", metrics(self._show()).encode()))
        elif path == "/events" and self._streams >= _STREAMS:
            writer.write(reply(503, TEXT, b"too many clients\n"))
        elif path == "/events":
            self._streams += 1
            try:
                await self._events(writer)
            finally:
                self._streams -= 1
        else:
            writer.write(reply(404, TEXT, b"there are /, /health, /metrics and /events\n"))

    async def _events(self, writer: asyncio.StreamWriter) -> None:
        writer.write(
            b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n"
            b"X-Content-Type-Options: nosniff\r\nX-Accel-Buffering: no\r\nConnection: close\r\n\r\n"
        )
        while not writer.is_closing():
            writer.write(b"data: " + json.dumps(self._show()).encode() + b"\n\n")
            # A client that does not read is not waited for, and does not fill the memory.
            async with asyncio.timeout(REQUEST_S):
                await writer.drain()
            await asyncio.sleep(EVENT_S)


def page() -> bytes:
    """The page, which asks for `events` beside it."""
    return (resources.files("bottomlock.live") / "page.html").read_bytes()
