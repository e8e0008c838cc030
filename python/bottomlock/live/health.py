"""The health page: what the engine knows, as HTML with server-sent events, as JSON, and as Prometheus text.

Read only, and on the loopback address unless the configuration says otherwise. One page file, nothing from a network.
"""

import asyncio
import contextlib
import json
import math
from collections.abc import Callable
from importlib import resources
from typing import Any

import numpy as np

from bottomlock.live.estimator import Estimator
from bottomlock.live.runner import Live
from bottomlock.live.states import ORDER

EVENT_S = 0.25
"""Time between two events of the page."""
_REQUEST_BYTES, _REQUEST_S, _CLIENTS = 8192, 5.0, 32
_AXES = ("surge", "sway", "heave")


def status(live: Live) -> dict[str, Any]:
    """Everything that is shown, in SI: what JSON can hold, None for what is not known."""
    engine, now_ns = live.engine, live.clock()
    estimator, machine = engine.estimator, engine.machine
    known = estimator.estimate(engine.state, engine.reset_counter)
    sd = [None] * 3 if known is None else [_number(math.sqrt(v)) for v in np.diag(known.covariance_m2ps2)]
    return {
        "name": engine.config.name,
        "mode": engine.config.mode,
        "state": engine.state,
        "why": machine.why,
        "state_for_s": None if machine.since_ns is None else _age_s(now_ns, machine.since_ns),
        "reset_counter": engine.reset_counter,
        "internal_errors": live.faults,
        "velocity_mps": [None] * 3 if known is None else [_number(v) for v in known.velocity_p_mps],
        "velocity_sd_mps": sd,
        "estimate_age_s": None if known is None else _age_s(now_ns, known.time_ns),
        "beams": [
            {"velocity_mps": _number(v), "used": bool(used)}
            for v, used in zip(estimator.last.velocity_mps, estimator.last.used, strict=True)
        ],
        "rank": estimator.rank,
        "ping": {"verdict": estimator.last.verdict, "why": estimator.last.why, "nis": estimator.last.nis},
        "reference": _reference(estimator),
        "gated": dict(estimator.gated),
        "sources": [_source(live, place, now_ns) for place in range(len(engine.sources))],
        "ports": [_port(live, place) for place in range(len(engine.ports))],
        "raw_log": None if live.log is None else {"file": live.log.path.name, "bytes": live.log.bytes},
    }


def _reference(estimator: Estimator) -> dict[str, dict[str, float]]:
    """What was found of the slow error of the attitude or heading, rad, by angle; empty without one."""
    found = estimator.reference_error
    if found is None:
        return {}
    error, sd = found
    names = ("roll", "pitch", "yaw")[-len(sd) :]
    each = zip(names, error.tolist(), sd.tolist(), strict=True)
    return {name: {"error_rad": value, "sd_rad": one} for name, value, one in each}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _age_s(now_ns: int, then_ns: int) -> float:
    return round(max(now_ns - then_ns, 0) * 1e-9, 3)


def _source(live: Live, place: int, now_ns: int) -> dict[str, Any]:
    one, connection = live.engine.sources[place], live.connections[place]
    return {
        "name": one.section.name,
        "format": one.section.format,
        "connection": connection.state,
        "connections": one.connections,
        "age_s": None if one.last_ns is None else _age_s(now_ns, one.last_ns),
        "records": one.reader.records,
        "taken": one.used,
        "skipped": dict(one.reader.skipped),
        "refused": dict(one.refused),
        "bytes_dropped": one.reader.framer.dropped,
        "clock_steps": one.clock.steps,
        "late": one.clock.late,
    }


def _port(live: Live, place: int) -> dict[str, Any]:
    one = live.engine.ports[place]
    sink = live.sinks[place] if live.sinks else None
    return {
        "port": one.name,
        "to": live.config.port[place].to,
        "target": "dry run" if sink is None else sink.state,
        "sent": one.sent,
        "dropped": 0 if sink is None else sink.dropped,
        "silent_because": one.silent_because,
    }


def metrics(shown: dict[str, Any]) -> str:
    """The status as Prometheus text."""
    lines: list[str] = []

    def add(name: str, kind: str, what: str, values: list[tuple[dict[str, str], float | None]]) -> None:
        lines.append(f"# HELP bottomlock_{name} {what}")
        lines.append(f"# TYPE bottomlock_{name} {kind}")
        for labels, value in values:
            if value is not None:
                text = ",".join(f'{key}="{_escaped(label)}"' for key, label in labels.items())
                lines.append(
                    f"bottomlock_{name}{{{text}}} {value:.9g}" if text else f"bottomlock_{name} {value:.9g}"
                )

    states = ("INITIALISING", *ORDER)
    add("state", "gauge", "1 for the state now", [({"state": s}, float(s == shown["state"])) for s in states])
    add("rank", "gauge", "Directions that the beams determine", [({}, shown["rank"])])
    add("reset_counter", "gauge", "Reset counter of the estimates", [({}, shown["reset_counter"])])
    add("internal_errors_total", "counter", "Faults of the program", [({}, shown["internal_errors"])])
    for key, unit in (("velocity_mps", "Velocity"), ("velocity_sd_mps", "1 sigma of the velocity")):
        values = zip(_AXES, shown[key], strict=True)
        add(key, "gauge", f"{unit}, m/s", [({"axis": axis}, value) for axis, value in values])
    add("nis", "gauge", "NIS of the last ping over its degrees of freedom", [({}, shown["ping"]["nis"])])
    beams = enumerate(shown["beams"], 1)
    add(
        "beam_used",
        "gauge",
        "1 for a beam that was used",
        [({"beam": str(k)}, float(b["used"])) for k, b in beams],
    )
    for key, what in (("error_rad", "Slow error found of the reference"), ("sd_rad", "1 sigma of that")):
        found = [({"angle": name}, one[key]) for name, one in shown["reference"].items()]
        add(f"reference_{key}", "gauge", f"{what}, rad", found)
    gated: list[tuple[dict[str, str], float | None]] = [({"sensor": k}, n) for k, n in shown["gated"].items()]
    add("gated_total", "counter", "Measurements beside the pings that the gate rejected", gated)
    for key, kind, what in (
        ("age_s", "gauge", "Seconds since the last byte"),
        ("records", "counter", "Records"),
        ("taken", "counter", "Readings or pings that were taken"),
        ("bytes_dropped", "counter", "Bytes that belonged to no record"),
        ("clock_steps", "counter", "Steps of the clock"),
        ("connections", "counter", "Connections"),
    ):
        sources = [({"source": one["name"]}, one[key]) for one in shown["sources"]]
        add(f"source_{key}" + ("_total" if kind == "counter" else ""), kind, what, sources)
    for key, what in (("sent", "Messages sent"), ("dropped", "Messages that could not be written")):
        ports = [({"port": one["port"], "to": one["to"]}, one[key]) for one in shown["ports"]]
        add(f"port_{key}_total", "counter", what, ports)
    return "\n".join(lines) + "\n"


def _escaped(label: str) -> str:
    return label.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


class HealthServer:
    """Serves the page on the running loop.

    Args:
        show: gives the status.
        host, port: where; port 0 takes a free one.
    """

    def __init__(self, show: Callable[[], dict[str, Any]], host: str, port: int) -> None:
        self._show, self._host, self._port = show, host, port
        self._clients = 0
        self.url = ""
        self.opened = asyncio.Event()

    async def run(self) -> None:
        """Serves until it is cancelled.

        Raises:
            OSError: where the address cannot be used.
        """
        server = await asyncio.start_server(self._client, self._host, self._port, limit=_REQUEST_BYTES)
        host = f"[{self._host}]" if ":" in self._host else self._host
        self.url = f"http://{host}:{server.sockets[0].getsockname()[1]}/"
        self.opened.set()
        try:
            await asyncio.Event().wait()
        finally:
            # Not waited for: a client that stays would hold up the end from Python 3.12 on.
            server.close()

    async def _client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients += 1
        try:
            async with asyncio.timeout(_REQUEST_S):
                request = await reader.readuntil(b"\r\n\r\n")
            if self._clients > _CLIENTS:
                writer.write(_reply(503, "text/plain", b"too many clients\n"))
            else:
                await self._answer(request.split(b"\r\n", 1)[0].split(b" "), writer)
            await writer.drain()
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # a client that went away, or never asked anything
        except asyncio.CancelledError:
            pass  # the program ends
        finally:
            self._clients -= 1
            with contextlib.suppress(OSError):
                writer.close()

    async def _answer(self, request: list[bytes], writer: asyncio.StreamWriter) -> None:
        if len(request) < 2 or request[0] != b"GET":
            writer.write(_reply(405, "text/plain", b"only GET\n"))
            return
        path = request[1].split(b"?", 1)[0]
        if path == b"/":
            page = (resources.files("bottomlock.live") / "page.html").read_bytes()
            writer.write(_reply(200, "text/html; charset=utf-8", page))
        elif path == b"/health":
            shown = self._show()
            good = shown["state"] not in {"UNSAFE", "INITIALISING"}
            writer.write(_reply(200 if good else 503, "application/json", json.dumps(shown).encode() + b"\n"))
        elif path == b"/metrics":
            writer.write(_reply(200, "text/plain; version=0.0.4", metrics(self._show()).encode()))
        elif path == b"/events":
            await self._events(writer)
        else:
            writer.write(_reply(404, "text/plain", b"there are /, /health, /metrics and /events\n"))

    async def _events(self, writer: asyncio.StreamWriter) -> None:
        writer.write(
            b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n"
            b"X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n"
        )
        while not writer.is_closing():
            writer.write(b"data: " + json.dumps(self._show()).encode() + b"\n\n")
            # A client that does not read is not waited for, and does not fill the memory.
            async with asyncio.timeout(_REQUEST_S):
                await writer.drain()
            await asyncio.sleep(EVENT_S)


_WORDS = {200: "OK", 404: "Not Found", 405: "Method Not Allowed", 503: "Service Unavailable"}


def _reply(code: int, kind: str, body: bytes) -> bytes:
    head = (
        f"HTTP/1.1 {code} {_WORDS[code]}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n"
        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
        "Content-Security-Policy: default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
        "connect-src 'self'\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + body
