"""The case file of a mission: what a careful engineer states of its sensors, whatever the noise is."""

from typing import Any

from bottomlock import Simulation
from bottomlock.config.sensors import DEPTH_BIAS_M, DEPTH_BIAS_TIME_S, Depth
from bottomlock.config.toml_value import toml_value
from partialdvl_bench.mission_list import MissionSpec, levels

_CLOCK = {"column": "time_ns", "unit": "ns"}
_DVL_ERRORS = (
    "beam_bias_mps", "beam_bias_walk_mps_per_rt_s", "scale_factor_percent", "scale_factor_walk_percent_per_rt_s",
)  # fmt: skip
_INSTRUMENT = ("configuration", "tilt_deg", "tilts_deg", "azimuths_deg", "beam_noise_mps")


def case_text(
    spec: MissionSpec, simulation: Simulation, start: dict[str, list[float]], *, reference: bool
) -> str:
    """The case file, TOML; with `reference` the truth beside it is what a replay compares with."""
    scenario, gravity = simulation.scenario, simulation.gravity_mps2
    depth = Depth()
    initial = scenario.initial
    roll, pitch, yaw = start["angles_deg"]
    imu = levels()["imu"][spec.imu]["imu"]
    tables: list[tuple[str, dict[str, Any]]] = [
        ("origin", {
            "latitude_deg": scenario.environment.latitude_deg, "gravity": gravity, "earth": scenario.environment.earth,
        }),
        ("imu", {
            "file": "imu.parquet", "clock": _CLOCK, "sampling": "averaged",
            "force": [f"force_{axis}_mps2" for axis in "xyz"], "omega": [f"omega_{axis}_radps" for axis in "xyz"],
        }),
        ("imu.errors", imu),
        ("dvl", {"file": "beams.parquet", "geometry": "dvl.toml"}),
        ("dvl.errors", {key: getattr(scenario.dvl, key) for key in _DVL_ERRORS}),
        *([("water_track", {"file": "water.parquet", "cells": [1]})] if spec.water else []),
        ("depth", {
            "file": "depth.parquet", "clock": _CLOCK, "column": "depth_m",
            "sd_m": depth.noise_pa / (depth.water_density_kg_per_m3 * gravity),
            "bias_m": DEPTH_BIAS_M, "bias_time_s": DEPTH_BIAS_TIME_S,
        }),
        # A heading sensor alone: roll and pitch are not measured and not used.
        ("attitude", {
            "file": "heading.parquet", "clock": _CLOCK, "roll": "roll_rad", "pitch": "pitch_rad", "yaw": "yaw_rad",
            "aids": "heading", "yaw_sd_deg": scenario.heading.noise_deg,
        } | _slow_errors(spec)),
        ("start", {
            "at_s": 0.0, "level": "given", "roll_deg": roll, "pitch_deg": pitch, "level_sd_deg": initial.roll_deg,
            "heading": "given", "heading_deg": yaw, "heading_sd_deg": initial.yaw_deg,
            "position": "given", "position_m": start["position_m"], "position_sd_m": list(initial.position_m),
            "velocity": "given", "velocity_mps": start["velocity_mps"], "velocity_sd_mps": list(initial.velocity_mps),
        }),
        ("replay", {"smooth": False}),
    ]  # fmt: skip
    water = levels()["vehicle"][spec.vehicle].get("water")
    if water is not None:
        tables.append(("filter.water", {"vehicle": water}))
    if reference:
        tables.append(("reference", {
            "file": "truth.parquet", "clock": _CLOCK,
            "north": "position_north_m", "east": "position_east_m", "down": "position_down_m",
            "velocity_body": ["surge_mps", "sway_mps", "heave_mps"],
            "roll": "roll_rad", "pitch": "pitch_rad", "yaw": "yaw_rad", "note": "the simulated truth",
        }))  # fmt: skip
    head = f'# A mission of PartialDVL-Bench v{spec.version}.\nname = "{spec.name}"\n'
    return head + "".join(f"\n[{name}]\n{_lines(table)}" for name, table in tables)


def _slow_errors(spec: MissionSpec) -> dict[str, float]:
    """Keys of [attitude] for the slow errors of a heading reference."""
    if not spec.heading:
        return {}
    own = levels()["heading"][spec.heading]
    slow = {f"yaw_{key}": own[key] for key in ("offset_sd_deg", "walk_sd_deg")}
    return slow | {"walk_time_s": own["walk_time_s"]}


def instrument_text(spec: MissionSpec) -> str:
    """The DVL's file, TOML."""
    own = levels()["dvl"][spec.dvl]
    return f'name = "{spec.dvl}"\n' + _lines({key: own[key] for key in _INSTRUMENT if key in own})


def _lines(table: dict[str, Any]) -> str:
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in table.items())
