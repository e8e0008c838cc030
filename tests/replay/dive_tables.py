"""Tables of a replay as long as wanted, made without a filter: a lawn mower, three methods, beams lost in between."""

from typing import Any

import numpy as np
import polars as pl

from bottomlock.files.replay_tables import (
    REPLAY_RUNS,
    REPLAY_SAMPLES,
    ReplayTables,
    innovations_schema,
    pings_schema,
)
from bottomlock.own_method import DEAD_RECKONING

START_NS = 1_767_225_610 * 10**9
SPIKE_S, SPIKE_MPS = 33.0, 9.25
"""One sample of tc's surge, which no thinning may lose."""
LOST_S = (20.0, 30.0)
"""Beams 2 and 3 are lost from the first to the second."""
ORIGIN = {"latitude_rad": np.deg2rad(54.0), "longitude_rad": np.deg2rad(-3.5), "height_m": 0.0}
METHODS = ("ins", "tc", DEAD_RECKONING)


def dive_tables(seconds: float = 60.0, rate_hz: float = 5.0) -> ReplayTables:
    """A dive without a reference, as `bottomlock replay` writes it; the free INS runs 4.5 km off."""
    count = round(seconds * rate_hz)
    t = np.arange(count) / rate_hz
    time_ns = START_NS + np.round(t * 1e9).astype(np.int64)
    samples = pl.concat([_samples(method, t, time_ns) for method in METHODS])
    pings, innovations = _pings(t, time_ns), _innovations(t, time_ns)
    runs = pl.concat([_runs(method) for method in METHODS])
    return ReplayTables(manifest(), runs, samples, innovations, pings, None, None)


def manifest() -> dict[str, Any]:
    return {
        "case": "lawn_mower",
        "description": "made by hand",
        "version": "0",
        "configuration_hash": "0" * 64,
        "semi_synthetic": [],
        "reference_note": "",
        "has_reference": False,
        "methods": list(METHODS),
        "what_if": [["recorded", "beams as recorded"]],
        "origin": ORIGIN,
        "beams": 4,
        "answer": {
            "verdict": "yes",
            "sentence": "The beams fit the navigation, and dead reckoning agrees.",
            "numbers": ["NIS 2.2. Closure of 985 pings.", "tc is at most 2 m from dead reckoning."],
            "change": "Nothing.",
            "method": "tc",
            "vehicle": "",
        },
        "alignment": dict.fromkeys(("start", "level", "heading", "position", "velocity"), "given"),
        "clocks": {},
        "notes": [],
    }


def _samples(method: str, t: np.ndarray[Any, Any], time_ns: np.ndarray[Any, Any]) -> pl.DataFrame:
    rng = np.random.default_rng(METHODS.index(method))
    leg = np.floor(t / 10.0)
    off = 4500.0 * (t / t[-1]) ** 2 if method == "ins" else 0.01 * t * (method == DEAD_RECKONING)
    yaw = np.where(leg % 2 == 0, 0.0, 180.0) + rng.standard_normal(len(t))
    columns: dict[str, Any] = {name: np.full(len(t), None) for name in REPLAY_SAMPLES} | {
        "case": ["lawn_mower"] * len(t), "what_if": ["recorded"] * len(t),
        "method": [method] * len(t), "pass": ["forward"] * len(t), "time_ns": time_ns,
        "north_m": 10.0 * np.abs((t / 10.0 + 1.0) % 2.0 - 1.0) + off, "east_m": 2.0 * leg + off,
        "down_m": 20.0 + 0.01 * t,
        "roll_deg": rng.standard_normal(len(t)), "pitch_deg": rng.standard_normal(len(t)),
        "yaw_deg": (yaw + 180.0) % 360.0 - 180.0,
        "surge_mps": 1.0 + 0.05 * rng.standard_normal(len(t)), "sway_mps": 0.02 * rng.standard_normal(len(t)),
        "heave_mps": 0.02 * rng.standard_normal(len(t)),
    }  # fmt: skip
    if method == "tc":
        columns["surge_mps"][np.searchsorted(t, SPIKE_S)] = SPIKE_MPS
    for axis in ("north", "east", "down"):
        columns[f"sd_position_{axis}_m"] = 0.1 + 0.002 * t
        columns[f"sd_misalignment_{axis}_rad"] = np.full(len(t), 0.01)
    for axis in ("surge", "sway", "heave"):
        columns[f"sd_velocity_{axis}_mps"] = np.full(len(t), 0.0125)
    return pl.DataFrame(columns, schema=dict(REPLAY_SAMPLES))


def _pings(t: np.ndarray[Any, Any], time_ns: np.ndarray[Any, Any]) -> pl.DataFrame:
    lost = (t >= LOST_S[0]) & (t < LOST_S[1])
    columns: dict[str, Any] = {"case": ["lawn_mower"] * len(t), "what_if": ["recorded"] * len(t)}
    columns |= {"time_ns": time_ns}
    for k in range(4):
        columns[f"beam{k + 1}_mps"] = np.full(len(t), 0.3)
        columns[f"beam{k + 1}_valid"] = ~lost if k in {1, 2} else np.ones(len(t), dtype=bool)
    schema = pings_schema(4)
    return pl.DataFrame({name: columns[name] for name in schema}, schema=schema)


def _innovations(t: np.ndarray[Any, Any], time_ns: np.ndarray[Any, Any]) -> pl.DataFrame:
    rng = np.random.default_rng(9)
    columns: dict[str, Any] = {
        "case": ["lawn_mower"] * len(t), "what_if": ["recorded"] * len(t),
        "method": ["tc"] * len(t), "time_ns": time_ns, "status": ["fix"] * len(t), "nis": rng.chisquare(4, len(t)),
        "degrees": np.full(len(t), 4),
    }  # fmt: skip
    for k in range(4):
        columns[f"beam{k + 1}_innovation_mps"] = 0.02 * rng.standard_normal(len(t))
        columns[f"beam{k + 1}_innovation_sd_mps"] = np.full(len(t), 0.02)
    schema = innovations_schema(4)
    return pl.DataFrame({name: columns[name] for name in schema}, schema=schema)


def _runs(method: str) -> pl.DataFrame:
    row: dict[str, Any] = dict.fromkeys(REPLAY_RUNS) | {
        "case": "lawn_mower", "what_if": "recorded", "method": method, "pass": "forward",
        "beams_mean_over_pings": 3.5, "fixes_accepted": 0, "fixes_in_part": 0, "fixes_rejected": 0,
    }  # fmt: skip
    return pl.DataFrame([row], schema=dict(REPLAY_RUNS))
