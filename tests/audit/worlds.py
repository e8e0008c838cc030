"""Logs with what stands beside them, simulated or flown by the plant, and defects of a mounting to plant in them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from bottomlock import BeamGeometry
from bottomlock.audit.logs import BeamLog, Reference
from bottomlock.audit.robust import resolution
from bottomlock.audit.run import Audit, audit_log
from bottomlock.config.scenario import load_scenario
from bottomlock.instruments.from_scenario import with_geometry
from bottomlock.io.beams import read_geometry
from bottomlock.plant.telemetry import euler_rad
from bottomlock.recordings.streams import Depths, Inertial
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams

Array = NDArray[np.float64]
REFERENCE_STEP_S = 0.1
ATTITUDE_SD_RAD = np.deg2rad(0.02)


@dataclass(frozen=True, eq=False)
class World:
    """A log with what the audit is given beside it.

    Attributes:
        name: in the table.
        log: the pings.
        geometry: stated, or None.
        mounting_rpy_rad: (3,) stated mounting, which the geometry contains.
        reference, imu, depths: recordings beside the log, or None.
    """

    name: str
    log: BeamLog
    geometry: BeamGeometry | None
    mounting_rpy_rad: Array
    reference: Reference | None = None
    depths: Depths | None = None
    imu: Inertial | None = None

    def with_log(self, log: BeamLog) -> World:
        """The same with another log."""
        return replace(self, log=log)


@dataclass(frozen=True)
class Noise:
    """How a simulated instrument measures: 1 sigma of a beam, m/s; correlation of consecutive pings; and the rest.

    `unequal` is the factor of beam 1; `lost` the fraction of beams lost, in runs of `run` pings; `resolution_mps` what
    readings are rounded to; `shared_mps` a common wander of the measured velocity.
    """

    sd_mps: float = 0.01
    correlation: float = 0.3
    unequal: float = 1.0
    lost: float = 0.1
    run: float = 4.0
    resolution_mps: float = 0.001
    shared_mps: float = 0.0


def oscillations(rng: np.random.Generator, time_s: Array, sizes: tuple[float, float, float]) -> Array:
    """(n, 3) sums of five oscillations of 6 to 60 s on each axis, RMS `sizes`."""
    out = np.zeros((len(time_s), 3))
    for axis, size in enumerate(sizes):
        for _ in range(5):
            rate = 2.0 * np.pi / rng.uniform(6.0, 60.0)
            out[:, axis] += size * np.sqrt(0.4) * np.sin(rate * time_s + rng.uniform(0.0, 2.0 * np.pi))
    return out


def coloured(rng: np.random.Generator, pings: int, beams: int, correlation: float) -> Array:
    """(pings, beams) noise of unit variance with this correlation of consecutive pings."""
    white = rng.normal(size=(pings, beams))
    white[1:] *= np.sqrt(1.0 - correlation**2)
    return np.asarray(lfilter([1.0], [1.0, -correlation], white, axis=0))


def lost_beams(
    rng: np.random.Generator, pings: int, beams: int, fraction: float, run: float
) -> NDArray[np.bool_]:
    """(pings, beams) True where a beam is lost, in runs of mean length `run` (a chain of two states)."""
    lost = np.zeros((pings, beams), dtype=bool)
    ends, begins = 1.0 / run, fraction / max(1.0 - fraction, 1e-9) / run
    draws = rng.random((pings, beams))
    for k in range(1, pings):
        lost[k] = np.where(lost[k - 1], draws[k] >= ends, draws[k] < begins)
    return lost


def simulated(
    seed: int,
    *,
    pings: int = 4000,
    noise: Noise = Noise(),
    speed: float = 1.0,
    instrument: bool = True,
    beside: bool = True,
    geometry: str = "waterlinked_a50",
    step_s: float = 0.25,
) -> World:
    """A dive of a vehicle that weaves, with the instrument's velocity and a reference of attitude and velocity.

    Args:
        seed: of everything drawn.
        pings: number of pings.
        noise: of the beams.
        speed: factor of all motion; 0 is at rest.
        instrument: with the instrument's own velocity, by least squares of three or four beams.
        beside: with attitude, velocity and depth beside the log.
        geometry: packaged name.
        step_s: between pings.
    """
    rng = np.random.default_rng(seed)
    stated = read_geometry(geometry).geometry
    rows = np.asarray(stated.directions_p)
    t = np.arange(pings) * step_s
    fine = np.arange(0.0, t[-1] + 8.0, 0.1) - 4.0
    at = np.concatenate([fine, t])
    body = speed * (np.array([0.8, 0.0, 0.0]) + oscillations(rng, at, (0.4, 0.25, 0.15)))
    angles = speed * oscillations(rng, at, (0.06, 0.05, 0.5))
    attitude = Rotation.from_euler("ZYX", angles[:, ::-1])
    few = len(fine)
    y = body[few:] @ rows.T
    beam = noise.sd_mps * coloured(rng, pings, len(rows), noise.correlation)
    beam[:, 0] *= noise.unequal
    y += beam + noise.shared_mps * coloured(rng, pings, 3, 0.98) @ rows.T
    y = np.round(y / noise.resolution_mps) * noise.resolution_mps
    valid = ~lost_beams(rng, pings, len(rows), noise.lost, noise.run)
    y = np.where(valid, y, 0.0)
    time_ns = np.round(t * 1e9).astype(np.int64)
    own, solved = _own(y, valid, rows, noise.resolution_mps) if instrument else (None, None)
    log = BeamLog("simulated", time_ns, y, valid, None, own, solved)
    if not beside:
        return World("simulated", log, stated, np.zeros(3))
    velocity_t = attitude[:few].apply(body[:few]) + 0.002 * rng.normal(size=(few, 3))
    fine_ns = np.round(fine * 1e9).astype(np.int64)
    depth = 20.0 + np.concatenate([[0.0], np.cumsum(0.05 * (velocity_t[1:, 2] + velocity_t[:-1, 2]))])
    return World(
        "simulated", log, stated, np.zeros(3),
        Reference(fine_ns, angles[:few] + 1e-4 * rng.normal(size=(few, 3)), velocity_t),
        Depths(fine_ns, depth + 0.005 * rng.normal(size=few)),
    )  # fmt: skip


def flown(
    scenario: str, seed: int, *, reference_sd_mps: float | None = 0.005, geometry: str = "waterlinked_a50",
    duration_s: float = 900.0,
) -> World:  # fmt: skip
    """A dive of the plant in a packaged scenario, with its beams' losses, outliers and noise, as an instrument logs it.

    The DVL's own bias and scale are none: what is planted is all there is.

    Args:
        scenario: packaged name.
        seed: of the campaign; the reference's noise has it too.
        reference_sd_mps: noise of the velocity beside the log; None for the IMU in its place, as a vehicle has it.
        geometry: packaged name of the instrument; its noise and losses are the scenario's.
        duration_s: at most the scenario's own.
    """
    told = with_geometry(load_scenario(scenario), geometry)
    told = told.with_trajectory(duration_s=min(duration_s, told.trajectory.duration_s))
    dvl = told.dvl.model_copy(update={"beam_bias_mps": 0.0, "scale_factor_percent": 0.0})
    told = told.model_copy(update={"dvl": dvl, "campaign": told.campaign.model_copy(update={"seed": seed})})
    simulation = build_simulation(told)
    truth = simulation.truth()
    streams = sensor_streams(simulation, truth)
    stated = simulation.geometry
    names = range(1, stated.beams + 1)
    beams = streams["beams"]
    valid = beams.select(f"beam{k}_valid" for k in names).to_numpy()
    y = np.nan_to_num(beams.select(f"beam{k}_mps" for k in names).fill_null(np.nan).to_numpy())
    y = np.round(y / 0.001) * 0.001
    own, solved = _own(y, valid, np.asarray(stated.directions_p), 0.001)
    log = BeamLog(scenario, beams["time_ns"].to_numpy(), y, valid, None, own, solved)

    rng = np.random.default_rng(seed)
    every = max(1, round(REFERENCE_STEP_S * 1e9 / float(np.median(np.diff(truth.time_ns)))))
    at = slice(None, None, every)
    turned = euler_rad(truth.attitude_t_p[at])
    rpy = turned + ATTITUDE_SD_RAD * rng.normal(size=turned.shape)
    velocity_t, imu = None, None
    if reference_sd_mps is None:
        table = streams["imu"]
        force, rate = (
            table.select(f"{name}_{axis}_{unit}" for axis in "xyz").to_numpy()
            for name, unit in (("force", "mps2"), ("omega", "radps"))
        )
        imu = Inertial(table["time_ns"].to_numpy(), force, rate)
    else:
        velocity_t = Rotation.from_euler("ZYX", turned[:, ::-1]).apply(truth.velocity_p_mps[at])
        velocity_t = velocity_t + reference_sd_mps * rng.normal(size=velocity_t.shape)
    depth = truth.position_t_m[at][:, 2] + 0.005 * rng.normal(size=len(turned))
    beside = "IMU" if reference_sd_mps is None else f"{1e3 * reference_sd_mps:.0f} mm/s"
    return World(
        f"{scenario}, {beside}", log, stated, np.zeros(3), Reference(truth.time_ns[at], rpy, velocity_t),
        Depths(truth.time_ns[at], depth), imu,
    )  # fmt: skip


def _own(y: Array, valid: NDArray[np.bool_], rows: Array, step: float) -> tuple[Array, NDArray[np.bool_]]:
    """Least squares of the valid beams, rounded; and whether there are three of them."""
    own = np.zeros((len(y), 3))
    patterns, place = np.unique(valid, axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        if pattern.sum() >= 3:
            chosen = place == k
            own[chosen] = y[chosen][:, pattern] @ np.linalg.pinv(rows[pattern]).T
    return np.round(own / step) * step, valid.sum(axis=1) >= 3


def audited(world: World) -> Audit:
    """The audit of a log with all that is beside it."""
    return audit_log(
        world.log, stated=world.geometry, geometry_name="stated", mounting_rpy_rad=world.mounting_rpy_rad,
        reference=world.reference, imu=world.imu, depths=world.depths,
    )  # fmt: skip


def rows_of(world: World) -> Array:
    """(beams, 3) stated rows."""
    assert world.geometry is not None
    return np.asarray(world.geometry.directions_p)


def _rounded(world: World, y: Array) -> Array:
    """Readings in the steps of the log: unrounded ones never repeat by chance, as those of an instrument do.

    Before, they are spread over the step that they were rounded to: a change of less than a step is lost otherwise.
    """
    step = resolution(world.log.velocity_mps.ravel())
    spread = np.random.default_rng(7).uniform(-0.5, 0.5, y.shape)
    return np.asarray(np.round(y / step + spread) * step)


def clock_behind(world: World, behind_s: float) -> World:
    """The DVL's clock is behind."""
    return world.with_log(replace(world.log, time_ns=world.log.time_ns - round(behind_s * 1e9)))


def _moved(world: World, change_mps: Array) -> World:
    """The instrument's velocity and its beams with a change (n, 3) of the velocity that the instrument measures."""
    own = world.log.instrument_mps
    assert own is not None
    moved = np.where(world.log.solved[:, None], change_mps, 0.0)
    y = world.log.velocity_mps + np.where(world.log.valid, moved @ rows_of(world).T, 0.0)
    return world.with_log(replace(world.log, velocity_mps=_rounded(world, y), instrument_mps=own + moved))


def yawed(world: World, angle_deg: float) -> World:
    """What beams in an instrument turned to starboard read of the same motion."""
    own = np.nan_to_num(np.asarray(world.log.instrument_mps))
    return _moved(world, Rotation.from_euler("z", angle_deg, degrees=True).inv().apply(own) - own)


def scaled(world: World, factor: float) -> World:
    """All beams read this many times the velocity."""
    return _moved(world, (factor - 1.0) * np.nan_to_num(np.asarray(world.log.instrument_mps)))


def lever_arm_of(world: World, ahead_m: float) -> World:
    """The DVL sits ahead of the reference's point."""
    reference = world.reference
    assert reference is not None
    attitude = Rotation.from_euler("ZYX", reference.rpy_rad[:, ::-1])
    rate = (
        (attitude[:-2].inv() * attitude[2:]).as_rotvec() / np.diff(reference.time_ns)[:, None].mean() / 2e-9
    )
    at = [np.interp(world.log.time_ns, reference.time_ns[1:-1], column) for column in rate.T]
    return _moved(world, np.cross(np.stack(at, axis=1), [ahead_m, 0.0, 0.0]))
