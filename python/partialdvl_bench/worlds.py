"""From a mission of the list and a seed to a simulation: what is drawn is drawn here."""

from dataclasses import replace
from typing import Any

import numpy as np

from bottomlock import Scenario, Simulation, build_simulation
from bottomlock.plant.seabed import GridSeabed, Seabed
from partialdvl_bench.mission_list import MissionSpec, levels
from partialdvl_bench.seeds import kernel_seed, stream

QUIET_MPS = 1e-9
"""Noise of the simulated beams; `beam_errors` adds that of the mission."""
LONG_S, RATE_HZ, LONG_RATE_HZ = 1000.0, 100.0, 50.0
"""Missions longer than this have the lower rate of the IMU."""
GRID_M, HALF_WIDTH_M = 5.0, 800.0
USUAL_DEPTH_M = 18.0


def simulation_of(spec: MissionSpec, seed: int) -> Simulation:
    """The simulation of a mission: its scenario, loaded and checked, over its seabed."""
    simulation = build_simulation(scenario_of(spec, seed))
    if spec.seabed != "drop_off":
        return simulation
    return replace(
        simulation, seabed=drop_off(stream(seed, spec.name, "seabed"), **levels()["seabed"]["drop_off"])
    )


def scenario_of(spec: MissionSpec, seed: int) -> Scenario:
    """The scenario of a mission, with beams that have bias and scale factor, and no noise.

    Examples:
        >>> from partialdvl_bench.mission_list import mission_list
        >>> scenario_of(mission_list()[1], 7).trajectory.vehicle
        'tauv'
    """
    table = levels()
    draw = stream(seed, spec.name, "path")
    vehicle = table["vehicle"][spec.vehicle]
    speed = draw.uniform(*vehicle["speed_mps"])
    imu = table["imu"][spec.imu]
    rate = LONG_RATE_HZ if spec.duration_s > LONG_S else RATE_HZ
    content: dict[str, Any] = {
        "name": spec.name,
        # As the missions were made first, and stay.
        "environment": {"earth": "tangent_plane"},
        "trajectory": {
            "kind": "waypoints", "source": "vehicle", "vehicle": spec.vehicle,
            "duration_s": spec.duration_s, "speed_mps": speed,
        },
        "mission": {
            "waypoints_m": waypoints(
                spec.path, draw, reach_m=speed * spec.duration_s + 100.0, scale=vehicle.get("path_scale", 1.0)
            ),
            "turn_radius_m": vehicle.get("turn_radius_m", 12.0),
            "depth_profile": depth_profile(draw, spec.duration_s),
            "current": _current(spec, seed),
        } | _held_heading(spec, seed),
        "seabed": _seabed(spec, seed),
        "imu": {"rate_hz": rate, "sampling": "averaged"} | imu["imu"],
        "dvl": table["dvl"][spec.dvl] | table["limits"] | {"beam_noise_mps": QUIET_MPS} | _losses(spec, seed),
        "depth": {"rate_hz": 1.0},
        "heading": {"rate_hz": 1.0} | (table["heading"][spec.heading] if spec.heading else imu["heading"]),
        "initial": imu["initial"],
        "campaign": {"seed": kernel_seed(seed, spec.name)},
    } | ({"water_track": table["water"][spec.water]} if spec.water else {})  # fmt: skip
    return Scenario.model_validate(content)


def waypoints(
    kind: str, draw: np.random.Generator, *, reach_m: float, scale: float = 1.0
) -> list[tuple[float, float]]:
    """Waypoints (north, east in m) of a path of at least this length, from the origin in a direction that is drawn.

    A line bends slightly, a zigzag by 70°, a lawn is mown up and down again, a box is gone round. Drawn lengths are
    multiplied by `scale`.
    """
    length, width = scale * draw.uniform(80.0, 120.0), scale * draw.uniform(40.0, 60.0)
    if kind in {"line", "zigzag"}:
        bend = np.deg2rad(8.0 if kind == "line" else 35.0)
        count = int(np.ceil(reach_m / length)) + 1
        turn = bend * np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
        steps = length * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        points = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    elif kind == "lawn":
        rows = [0, 1, 2, 3, 4, 3, 2, 1]
        count = int(np.ceil(reach_m / length)) + 2
        ends = [[(k % 2) * length, rows[k % 8] * width] for k in range(count)]
        corners = [[ends[k][0], rows[(k - 1) % 8] * width] for k in range(1, count)]
        points = np.array([ends[0], *[one for k in range(1, count) for one in (corners[k - 1], ends[k])]])
    else:
        corner = np.array(
            [[0.0, 0.0], [length, 0.0], [length, width + 20.0 * scale], [0.0, width + 20.0 * scale]]
        )
        count = int(np.ceil(reach_m / min(length, width))) + 2
        points = corner[np.arange(count) % 4]
    heading = draw.uniform(0.0, 2.0 * np.pi)
    cosine, sine = np.cos(heading), np.sin(heading)
    turned = points @ np.array([[cosine, sine], [-sine, cosine]])
    return [(float(north), float(east)) for north, east in turned.round(3)]


def depth_profile(draw: np.random.Generator, duration_s: float) -> list[tuple[float, float]]:
    """Depths (m) at times (s): level, then down or up at 0.2 m/s, and so on until the end."""
    time, depth = draw.uniform(20.0, 50.0), draw.uniform(12.0, 20.0)
    knots = [(0.0, depth)]
    while time < duration_s:
        other = draw.uniform(12.0, 30.0)
        knots += [(time, depth), (time + max(10.0, abs(other - depth) / 0.2), other)]
        depth, time = other, knots[-1][0] + draw.uniform(30.0, 90.0)
    return [(float(round(at, 2)), float(round(value, 3))) for at, value in knots]


def drop_off(
    draw: np.random.Generator, *, depth_m: float, deep_m: float, width_m: float, trench_m: float
) -> Seabed:
    """A trench between two cliffs, the nearer 30 to 60 m from the start in a direction that is drawn, as a grid."""
    heading, distance = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(30.0, 60.0)
    axis = GRID_M * np.arange(
        -round(HALF_WIDTH_M / GRID_M), round(HALF_WIDTH_M / GRID_M) + 1, dtype=np.float64
    )
    beyond = np.cos(heading) * axis[:, None] + np.sin(heading) * axis[None, :] - distance
    down, up = (0.5 * np.tanh(2.0 * (beyond - edge) / width_m) for edge in (0.0, trench_m))
    fall = down - up
    return GridSeabed(north_m=axis, east_m=axis, depth_m=depth_m + (deep_m - depth_m) * fall)


def _held_heading(spec: MissionSpec, seed: int) -> dict[str, float]:
    """The key of [mission] for a vehicle that holds its heading."""
    if "water" not in levels()["vehicle"][spec.vehicle]:
        return {}
    return {"heading_deg": stream(seed, spec.name, "heading").uniform(0.0, 360.0)}


def _current(spec: MissionSpec, seed: int) -> dict[str, Any]:
    level = dict(levels()["current"][spec.current])
    draw = stream(seed, spec.name, "current")
    towards, sheared = draw.uniform(0.0, 360.0), draw.uniform(0.0, 2.0 * np.pi)
    shear = level.pop("shear_per_m", 0.0)
    return level | {
        "towards_deg": towards,
        "shear_north_mps_per_m": shear * float(np.cos(sheared)),
        "shear_east_mps_per_m": shear * float(np.sin(sheared)),
        "seed": int(draw.integers(2**31)),
    }


def _seabed(spec: MissionSpec, seed: int) -> dict[str, Any]:
    level = dict(levels()["seabed"][spec.seabed])
    if spec.seabed == "rough":
        return {"kind": "rolling", "half_width_m": HALF_WIDTH_M} | level
    direction = stream(seed, spec.name, "seabed").uniform(0.0, 2.0 * np.pi)
    slope = level.get("slope_deg", 0.0)
    depth = level["depth_m"]
    if spec.loss == "geometric":
        table = levels()
        tilt = np.deg2rad(
            np.max(table["dvl"][spec.dvl].get("tilts_deg", table["dvl"][spec.dvl].get("tilt_deg")))
        )
        reach = table["loss"]["geometric"]["range_at_start"] * table["limits"]["max_range_m"]
        depth = USUAL_DEPTH_M + reach * float(np.cos(tilt))
    return {
        "kind": "plane",
        "depth_m": depth,
        "slope_north_deg": slope * float(np.cos(direction)),
        "slope_east_deg": slope * float(np.sin(direction)),
    }


def _losses(spec: MissionSpec, seed: int) -> dict[str, Any]:
    """Keys of [dvl] for losses that a scenario can have; the others are those of `beam_errors`."""
    level = levels()["loss"][spec.loss]
    beams = len(levels()["dvl"][spec.dvl].get("azimuths_deg", range(4)))
    if spec.loss == "markov":
        return {"dropouts": [{"beams": list(range(1, beams + 1))} | level]}
    if spec.loss == "blackout":
        draw = stream(seed, spec.name, "loss")
        lost_s = draw.uniform(*level["lock_s"])
        end_s = lost_s + draw.uniform(*level["lasting_s"])
        whole = {
            "beams": list(range(1, beams + 1)), "from_s": round(lost_s, 2), "to_s": round(end_s, 2)
        }  # fmt: skip
        return {"outages": [whole]}
    if spec.loss != "schedule":
        return {}
    draw = stream(seed, spec.name, "loss")
    outages, at = [], draw.uniform(*level["apart_s"])
    while at < spec.duration_s - level["lasting_s"][1]:
        for lost in level["lost"]:
            count = {-1: beams - 1, 0: beams}.get(lost, lost)
            chosen = sorted(int(beam) for beam in draw.choice(beams, count, replace=False) + 1)
            end = at + draw.uniform(*level["lasting_s"])
            if end < spec.duration_s - 10.0:
                outages.append({"beams": chosen, "from_s": round(at, 2), "to_s": round(end, 2)})
            at = end + draw.uniform(*level["apart_s"])
    return {"outages": outages}
