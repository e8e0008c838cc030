"""Logs with a known geometry and planted faults; nothing here imports the audit's own mathematics."""

from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.audit.logs import BeamLog

Array = NDArray[np.float64]


def janus(tilt_deg: float = 22.0, first_deg: float = 45.0) -> Array:
    """(4, 3) beams a quarter turn apart, the first at `first_deg`, written out."""
    rows = []
    for k in range(4):
        a, t = np.deg2rad(first_deg + 90.0 * k), np.deg2rad(tilt_deg)
        rows.append([np.cos(a) * np.sin(t), np.sin(a) * np.sin(t), np.cos(t)])
    return np.array(rows)


def motion(rng: np.random.Generator, pings: int, step_s: float = 0.2) -> Array:
    """(pings, 3) smooth velocities: a mean surge and oscillations of all three axes of 8 to 60 s."""
    t = np.arange(pings) * step_s
    out = np.zeros((pings, 3))
    for axis, size in enumerate((0.35, 0.25, 0.2)):
        for _ in range(5):
            out[:, axis] += (
                size * rng.normal() * 0.7 * np.sin(2 * np.pi * t / rng.uniform(8.0, 60.0) + rng.uniform(0, 7))
            )
    out[:, 0] += 0.6
    return out


def noise(rng: np.random.Generator, shape: tuple[int, ...], sd: float, *, heavy: bool = False) -> Array:
    """White noise; heavy: a tenth of the readings ten times as noisy."""
    drawn = sd * rng.normal(size=shape)
    return np.where(rng.random(shape) < 0.1, 10.0 * drawn, drawn) if heavy else drawn


def make_log(
    seed: int,
    *,
    pings: int = 1200,
    physical: Array | None = None,
    used: Array | None = None,
    sd_mps: float = 0.01,
    unequal: bool = False,
    heavy: bool = False,
    instrument: bool = True,
    decimals: int | None = 4,
    velocity: Array | None = None,
) -> BeamLog:
    """A log: beams sit as `physical`, the instrument solves with `used`; `unequal`: beam 1 is five times noisier."""
    rng = np.random.default_rng(seed)
    physical = janus() if physical is None else physical
    used = physical if used is None else used
    v = motion(rng, pings) if velocity is None else velocity
    spread = np.array([5.0, 1.0, 1.0, 1.0][: len(physical)]) if unequal else np.ones(len(physical))
    y = v @ physical.T + noise(rng, (len(v), len(physical)), sd_mps, heavy=heavy) * spread
    if decimals is not None:
        y = np.round(y, decimals)
    own = y @ (np.linalg.inv(used.T @ used) @ used.T).T
    if decimals is not None:
        own = np.round(own, decimals)
    time_ns = np.arange(len(v), dtype=np.int64) * 200_000_000
    return BeamLog("planted", time_ns, y, np.ones(y.shape, dtype=bool), own if instrument else None)


def channels(log: BeamLog, order: list[int], sign: list[int] | None = None) -> BeamLog:
    """The same log with its beam columns in another order and with other signs; the instrument's velocity stays."""
    flip = np.array(sign or [1] * len(order))
    return replace(log, velocity_mps=log.velocity_mps[:, order] * flip, valid=log.valid[:, order])


def stale(log: BeamLog, rows: list[int]) -> BeamLog:
    """The pings of these rows become copies of the ones before them."""
    y, own = log.velocity_mps.copy(), None if log.instrument_mps is None else log.instrument_mps.copy()
    for row in rows:
        y[row] = y[row - 1]
        if own is not None:
            own[row] = own[row - 1]
    return replace(log, velocity_mps=y, instrument_mps=own)


def table(log: BeamLog) -> pl.DataFrame:
    """The log as `bottomlock convert` writes it."""
    columns: dict[str, Any] = {"time_ns": log.time_ns}
    for k in range(log.beams):
        columns |= {f"beam{k + 1}_mps": log.velocity_mps[:, k], f"beam{k + 1}_valid": log.valid[:, k]}
    if log.instrument_mps is not None:
        columns |= {f"instrument_{axis}_mps": log.instrument_mps[:, k] for k, axis in enumerate("xyz")}
    return pl.DataFrame(columns)


def kinds(findings: list[Any]) -> set[tuple[str, tuple[int, ...]]]:
    """What was found, and in which beams."""
    return {(one.kind, one.beams) for one in findings}
