"""The health page: what the engine knows, as HTML with server-sent events, as JSON, and as Prometheus text.

Read only, and on the loopback address unless the configuration says otherwise. One page file, nothing from a network.
"""

import asyncio
import json
import math
from collections.abc import Callable, Sequence
from importlib import resources
from typing import Any

import numpy as np

from bottomlock.live.estimator import Estimator
from bottomlock.live.http_server import HTML, JSON, REQUEST_S, TEXT, HttpServer, Request, reply
from bottomlock.live.runner import Live
from bottomlock.live.states import ORDER
from bottomlock.ports.estimate import Estimate
from bottomlock.recordings.rotation import angles

EVENT_S = 0.25
"""Time between two events of the page."""
_STREAMS = 16
"""Most connections that follow the events at a time."""
_AXES = ("surge", "sway", "heave")


def status(live: Live) -> dict[str, Any]:
    """Everything that is shown, in SI: what JSON can hold, None for what is not known."""
    engine, now_ns = live.engine, live.clock()
    estimator, machine = engine.estimator, engine.machine
    known = estimator.estimate(engine.state, engine.reset_counter)
    sd = [None] * 3 if known is None else [_number(math.sqrt(v)) for v in np.diag(known.covariance_m2ps2)]
    attitude, attitude_sd = _attitude(known)
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
        "attitude_rpy_rad": attitude,
        "attitude_sd_rad": attitude_sd,
        "estimate_age_s": None if known is None else _age_s(now_ns, known.time_ns),
        "beams": [
            {"velocity_mps": _number(v), "used": bool(used)}
            for v, used in zip(estimator.last.velocity_mps, estimator.last.used, strict=True)
        ],
        "rank": estimator.rank,
        "ping": {"verdict": estimator.last.verdict, "why": estimator.last.why, "nis": estimator.last.nis},
        "reference": _reference(estimator),
        "water": _water(estimator),
        "gated": dict(estimator.gated),
        "sources": [_source(live, place, now_ns) for place in range(len(engine.sources))],
        "ports": [_port(live, place) for place in range(len(engine.ports))],
        "raw_log": None if live.log is None else {"file": live.log.path.name, "bytes": live.log.bytes},
    }


def _attitude(known: Estimate | None) -> tuple[list[float | None], list[float | None]]:
    """Roll, pitch, yaw of the platform, rad, and 1 sigma of its rotation about north, east, down; None without."""
    if known is None or known.attitude_t_p is None or known.navigation_covariance is None:
        return [None] * 3, [None] * 3
    return list(map(_number, angles(known.attitude_t_p))), [
        _number(math.sqrt(v)) for v in np.diag(known.navigation_covariance)[3:6]
    ]


def _reference(estimator: Estimator) -> dict[str, dict[str, float]]:
    """What was found of the slow error of the attitude or heading, rad, by angle; empty without one."""
    found = estimator.reference_error
    if found is None:
        return {}
    error, sd = found
    names = ("roll", "pitch", "yaw")[-len(sd) :]
    each = zip(names, error.tolist(), sd.tolist(), strict=True)
    return {name: {"error_rad": value, "sd_rad": one} for name, value, one in each}


def _water(estimator: Estimator) -> dict[str, Any] | None:
    """The current north and east, m/s, with 1 sigma, and what became of the cells; None without water track."""
    found = estimator.current
    if found is None:
        return None
    current, sd = (values.tolist() for values in found)
    return {"current_mps": current, "current_sd_mps": sd, "cells": estimator.water_counts.text()}


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
        "pieces_not_read": connection.dropped,
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
        "sent": one.sent if sink is None else live.written[place],
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
    for key, what in (
        ("attitude_rpy_rad", "Attitude"),
        ("attitude_sd_rad", "1 sigma about north, east, down"),
    ):
        turns = zip(("roll", "pitch", "yaw"), shown[key], strict=True)
        add(key, "gauge", f"{what}, rad", [({"angle": angle}, value) for angle, value in turns])
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
    for key, what in (("current_mps", "Current"), ("current_sd_mps", "1 sigma of the current")):
        axes = zip(("north", "east"), (shown["water"] or {}).get(key, ()), strict=False)
        add(key, "gauge", f"{what}, m/s", [({"axis": axis}, value) for axis, value in axes])
    gated: list[tuple[dict[str, str], float | None]] = [({"sensor": k}, n) for k, n in shown["gated"].items()]
    add("gated_total", "counter", "Measurements beside the pings that the gate rejected", gated)
    for key, kind, what in (
        ("age_s", "gauge", "Seconds since the last byte"),
        ("records", "counter", "Records"),
        ("taken", "counter", "Readings or pings that were taken"),
        ("bytes_dropped", "counter", "Bytes that belonged to no record"),
        ("pieces_not_read", "counter", "Pieces that came too fast to be taken, and second clients"),
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
