"""The dives of the tests: one truth and one draw of noise, what its loggers hold, and faults as data.

`drawn_dive` draws a dive, `tables` are what its loggers hold, a `Fault` spoils tables; `tests.dive_logs.write` makes
the files that a user would have. `given` are its readings, one at a time.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import encoder
from bottomlock.io.beams import read_geometry
from bottomlock.recordings import readings

Floats = NDArray[np.float64]
LATITUDE_DEG, LONGITUDE_DEG = 45.0, 10.0
METRES_PER_DEG = (111_131.745, 78_846.8)
"""North and east, at 45 degrees."""
EPOCH_S = 1_764_000_000.0
"""Unix time at which the tables begin."""
LATITUDE = np.deg2rad(LATITUDE_DEG)
EARTH = 7.292115e-5 * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])
GRAVITY = np.array([0.0, 0.0, 9.8062])
STANDARD_GRAVITY = 9.80665
SURFACE_PA, DENSITY = 101_325.0, 1025.0


@dataclass(frozen=True, eq=False)
class Dive:
    """Truth and readings in platform axes (forward, right, down), SI; times in s from 0.

    `rpy`, `position` (north, east, down) and `velocity` are true, at the times of the IMU. The others are measured: the
    slow sensors, attitude and depth at `slow_s`, positions (north, east) at `gps_s`. Beams are of the DVL's own axes.
    """

    geometry: str
    imu_s: Floats
    force: Floats
    omega: Floats
    ping_s: Floats
    beams: Floats
    beam_sd: float
    rpy: Floats
    position: Floats
    velocity: Floats
    slow_s: Floats
    depth: Floats
    angles: Floats
    gps_s: Floats
    gps: Floats

    def at(self, seconds: Floats, values: Floats) -> Floats:
        """(n, k) values at the times of IMU readings, at other times."""
        return np.stack([np.interp(seconds, self.imu_s, column) for column in values.T], axis=1)

    @property
    def instrument(self) -> Floats:
        """(n, 3) the instrument's own velocity, of its beams; NaN where one is lost."""
        return self.beams @ np.linalg.pinv(np.asarray(read_geometry(self.geometry).geometry.directions_p)).T


def _wander(
    t: Floats, rng: np.random.Generator, size: float, periods: tuple[float, float], parts: int = 5
) -> Floats:
    low, high = 2.0 * np.pi / periods[1], 2.0 * np.pi / periods[0]
    rates, phases = rng.uniform(low, high, parts), rng.uniform(0.0, 2.0 * np.pi, parts)
    return np.asarray(size * np.sqrt(2.0 / parts) * np.sin(t[:, None] * rates + phases).sum(axis=1))


def felt(
    step_s: float, rpy: Floats, body: Floats, earth: Floats = EARTH, gravity: Floats = GRAVITY
) -> tuple[Floats, Floats, Floats, Floats]:
    """What perfect inertial sensors feel of a motion: specific force, rate; velocity over ground, rate against it.

    Args:
        step_s: between rows.
        rpy: (n, 3) roll, pitch, yaw, rad.
        body: (n, 3) velocity forward, right, down, m/s.
        earth: its rotation, north, east, down, rad/s.
        gravity: north, east, down, m/s².
    """
    C = Rotation.from_euler("ZYX", rpy[:, ::-1])
    v_n = C.apply(body)
    accel = np.gradient(v_n, step_s, axis=0) + 2.0 * np.cross(earth, v_n)
    turns = (C[:-1].inv() * C[1:]).as_rotvec() / step_s
    turns = np.vstack([turns[:1], 0.5 * (turns[1:] + turns[:-1]), turns[-1:]])
    return C.inv().apply(accel - gravity), turns + C.inv().apply(np.tile(earth, (len(rpy), 1))), v_n, turns


@cache
def drawn_dive(
    seed: int,
    *,
    seconds: float = 240.0,
    imu_hz: float = 50.0,
    dvl_hz: float = 4.0,
    geometry: str = "waterlinked_a50",
    beam_sd: float = 0.008,
    gyro_bias: float = np.deg2rad(20.0) / 3600.0,
    lively: float = 1.0,
    sway_mps: float = 0.0,
    lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    mounting_rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Dive:
    """A small vehicle that turns, surges and rolls at half a metre per second, calm for the first 12 s; a MEMS IMU.

    Args:
        seed: of the motion and of every error.
        seconds: duration.
        imu_hz, dvl_hz: rates.
        geometry: of the DVL.
        beam_sd: noise of a beam, m/s.
        gyro_bias: 1 sigma of each gyro's, rad/s.
        lively: factor of rolling, heaving and the changes of speed.
        sway_mps: mean sway of a vehicle that crabs.
        lever_m: of the DVL from the IMU.
        mounting_rpy_deg: turns the DVL's axes to the platform's.
    """
    rng = np.random.default_rng(seed)
    fine = 4
    t = np.arange(0.0, seconds, 1.0 / (imu_hz * fine))
    ramp = np.clip((t - 12.0) / 5.0, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    roll = np.deg2rad(1.0) + ramp * _wander(t, rng, np.deg2rad(4.0 * lively), (4.0, 15.0))
    pitch = np.deg2rad(-2.0) + ramp * _wander(t, rng, np.deg2rad(4.0 * lively), (5.0, 20.0))
    yaw = 0.6 + ramp * _wander(t, rng, np.deg2rad(70.0), (25.0, 80.0))
    body = ramp[:, None] * np.stack(
        [0.5 + _wander(t, rng, 0.2 * lively, (6.0, 30.0)), sway_mps + _wander(t, rng, 0.12 * lively, (6.0, 30.0)),
         _wander(t, rng, 0.08 * lively, (6.0, 30.0))], axis=1,
    )  # fmt: skip
    dt = t[1] - t[0]
    rpy = np.stack([roll, pitch, yaw], axis=1)
    force, omega, v_n, turns = felt(dt, rpy, body)
    moved = np.cumsum(0.5 * (v_n[1:] + v_n[:-1]) * dt, axis=0)
    position = np.vstack([np.zeros(3), moved]) + np.array([0.0, 0.0, 3.0])
    k = slice(0, None, fine)
    n = len(t[k])
    imu_force = force[k] + 0.01 * rng.normal(size=(n, 3)) + 9.8e-3 * rng.normal(size=3)
    imu_omega = omega[k] + 5e-4 * rng.normal(size=(n, 3)) + gyro_bias * rng.normal(size=3)
    ping_s = np.arange(0.3, seconds - 0.5, 1.0 / dvl_hz)
    B = np.asarray(read_geometry(geometry).geometry.directions_p)
    at_dvl = body + np.cross(turns, lever_m)
    v = np.stack([np.interp(ping_s, t, column) for column in at_dvl.T], axis=1)
    v = Rotation.from_euler("ZYX", mounting_rpy_deg[::-1], degrees=True).apply(v, inverse=True)
    beams = v @ B.T + beam_sd * rng.normal(size=(len(ping_s), len(B)))
    lost = rng.random(beams.shape) < 0.02
    rpy = rpy[k]
    slow, second = slice(0, None, max(round(imu_hz / 5.0), 1)), slice(0, None, max(round(imu_hz), 1))
    times, places = t[k], position[k]
    count = len(times[slow])
    return Dive(
        geometry, times, imu_force, imu_omega, ping_s, np.where(lost, np.nan, beams), beam_sd, rpy, places, body[k],
        times[slow], places[slow, 2] + 0.02 * rng.normal(size=count),
        rpy[slow] + np.deg2rad(0.3) * rng.normal(size=(count, 3)),
        times[second], places[second, :2] + 0.1 * rng.normal(size=(len(times[second]), 2)),
    )  # fmt: skip


def gauss_markov(drawn: Floats, step_s: float, time_s: float) -> Floats:
    """First-order Gauss-Markov processes from normal numbers of their sigma, (n, …), `step_s` apart."""
    kept = np.exp(-step_s / time_s)
    driven = np.sqrt(1.0 - kept**2) * drawn
    driven[0] = drawn[0]
    return np.asarray(lfilter([1.0], [1.0, -kept], driven, axis=0))


Tables = Mapping[str, pl.DataFrame]
"""What the loggers of a dive hold, by name: imu, velocity and beams (of the DVL), depth, ahrs, gps, nav, truth."""


def tables(made: Dive, *, start_s: float = EPOCH_S, range_m: float = 4.0) -> Tables:
    """The dive as careful loggers write it: Unix time in s, SI, degrees; null where a beam is lost.

    `gps` has noise, `nav` holds true positions in centimetres; `truth` has the true ones and velocities, at 5 Hz.
    """
    xyz, ned = ("x", "y", "z"), ("north", "east", "down")

    def table(seconds: Floats, columns: Mapping[str, Floats]) -> pl.DataFrame:
        return pl.DataFrame({"time_s": seconds + start_s} | dict(columns)).fill_nan(None)

    few = np.searchsorted(made.imu_s, made.slow_s)
    true, moving = made.position[few], Rotation.from_euler("ZYX", made.rpy[few][:, ::-1])
    down = np.asarray(read_geometry(made.geometry).geometry.directions_p)[:, 2]
    beams = {
        f"beam{k + 1}_{unit}": values
        for k, b in enumerate(made.beams.T)
        for unit, values in (
            ("mps", b),
            ("range_m", np.where(np.isfinite(b), range_m * np.mean(down) / down[k], np.nan)),
        )
    }
    angles = np.rad2deg(made.angles)
    angles[:, 2] %= 360.0
    places = made.gps / METRES_PER_DEG + (LATITUDE_DEG, LONGITUDE_DEG)
    return {
        "imu": table(
            made.imu_s,
            {f"a{a}": made.force[:, k] for k, a in enumerate(xyz)}
            | {f"g{a}": made.omega[:, k] for k, a in enumerate(xyz)},
        ),
        "velocity": table(made.ping_s, {f"v{a}": made.instrument[:, k] for k, a in enumerate(xyz)}).with_columns(
            altitude=pl.lit(range_m * float(np.mean(down)))
        ),
        "beams": table(made.ping_s, beams),
        "depth": table(made.slow_s, {"depth_m": made.depth}),
        "ahrs": table(made.slow_s, dict(zip(("roll_deg", "pitch_deg", "heading_deg"), angles.T, strict=True))),
        "gps": table(made.gps_s, {"latitude": places[:, 0], "longitude": places[:, 1]}),
        "nav": table(
            made.gps_s,
            {name: np.round(np.interp(made.gps_s, made.imu_s, made.position[:, k]), 2) for k, name in enumerate(ned)},
        ),
        "truth": table(
            made.slow_s,
            dict(zip(ned, true.T, strict=True))
            | dict(zip(("vn", "ve", "vd"), moving.apply(made.velocity[few]).T, strict=True)),
        ),
    }  # fmt: skip


Fault = Callable[[Tables], Tables]
"""Spoils tables as a logger, a driver or a sensor does."""
BOTH = ("velocity", "beams")
"""Tables of the DVL."""


def changed(*names: str, **columns: pl.Expr) -> Fault:
    """Columns of tables that hold something else, or that are added."""
    return lambda held: dict(held) | {one: held[one].with_columns(**columns) for one in names}


def named(name: str, **names: str) -> Fault:
    """Columns of a table by other names."""
    return lambda held: dict(held) | {name: held[name].rename(names)}


def left(name: str, rows: pl.Expr) -> Fault:
    return lambda held: dict(held) | {name: held[name].filter(rows)}


def all_of(*faults: Fault) -> Fault:
    """One after another."""

    def spoil(held: Tables) -> Tables:
        for one in faults:
            held = one(held)
        return held

    return spoil


def during(column: str, begin_s: float, end_s: float, then: pl.Expr) -> pl.Expr:
    """A column that is another from one time to another, s from the start of the tables."""
    inside = (pl.col("time_s") - EPOCH_S).is_between(begin_s, end_s)
    return pl.when(inside).then(then).otherwise(pl.col(column))


def later(*names: str, by_s: float, begin_s: float = -np.inf, end_s: float = np.inf) -> Fault:
    """Stamps that are later than the time by some seconds, all along or for a while."""
    return changed(*names, time_s=during("time_s", begin_s, end_s, pl.col("time_s") + by_s))


def lost(begin_s: float, end_s: float, code: float, altitude: float | None = None) -> Fault:
    """No bottom for a while, which the velocities say by a number."""
    columns = {f"v{axis}": during(f"v{axis}", begin_s, end_s, pl.lit(code)) for axis in "xyz"}
    if altitude is not None:
        columns["altitude"] = during("altitude", begin_s, end_s, pl.lit(altitude))
    return changed("velocity", **columns)


def single_pings(code: float, every: int = 7) -> Fault:
    """A velocity that is a code at one ping of some."""
    hit = pl.int_range(pl.len()) % every == every - 1
    return changed("velocity", **{f"v{a}": pl.when(hit).then(code).otherwise(pl.col(f"v{a}")) for a in "xyz"})


def exchanged(name: str, one: str, other: str) -> Fault:
    """Two columns that have changed places."""
    return named(name, **{one: other, other: one})


def course_beside_heading(held: Tables) -> Tables:
    """A table of navigation with the course before the heading; a vehicle at rest has course 0."""
    north, east = (held["truth"][name].to_numpy() for name in ("vn", "ve"))
    course = np.where(np.hypot(north, east) > 0.02, np.rad2deg(np.arctan2(east, north)) % 360.0, 0.0)
    table = held["ahrs"].select(
        "time_s", roll="roll_deg", pitch="pitch_deg", course=pl.Series(course), heading="heading_deg"
    )
    return dict(held) | {"ahrs": table}


def intervals(held: Tables) -> Tables:
    """A DVL's table whose column "time" is the milliseconds since the report before."""
    velocity = held["velocity"]
    return dict(held) | {
        "velocity": velocity.select(
            (pl.col("time_s").diff().fill_null(0.2) * 1e3).alias("time"), pl.exclude("time_s")
        )
    }


def quaternion(scalar: str, first: int) -> Fault:
    """An attitude as four numbered columns, from q0 or q1, the scalar first or last."""

    def spoil(held: Tables) -> Tables:
        ahrs = held["ahrs"]
        angles = ahrs.select("heading_deg", "pitch_deg", "roll_deg").to_numpy()
        q = np.roll(
            Rotation.from_euler("ZYX", angles, degrees=True).as_quat(), int(scalar == "first"), axis=1
        )
        columns = {f"q{k + first}": one for k, one in enumerate(q.T)}
        return dict(held) | {"ahrs": ahrs.select("time_s").hstack(pl.DataFrame(columns))}

    return spoil


def hull_pressure(held: Tables) -> Tables:
    """Another pressure sensor, of the air in the hull."""
    air = 101_900.0 + 60.0 * (held["depth"]["time_s"] / 40.0).sin()
    return dict(held) | {"hull": held["depth"].select("time_s", pressure_pa=air)}


def _scaled(name: str, columns: str, factor: float) -> Fault:
    return changed(name, **{one: factor * pl.col(one) for one in columns.split()})


GYROS, FORCES, DEGREES = "gx gy gz", "ax ay az", float(np.rad2deg(1.0))
WHOLE_SPHERE = 360.0
FAULTS: dict[str, Fault] = {
    "nothing": lambda held: held,
    # Of drivers and loggers.
    "intervals for times": intervals,
    "zeros for lost velocities": lost(50.0, 80.0, 0.0, -1.0),
    "zeros for a minute": lost(150.0, 210.0, 0.0, -1.0),
    "-32.768 for lost velocities": single_pings(-32.768),
    "flags as True and False": changed("velocity", velocity_valid=pl.lit("True")),
    "hull pressure": hull_pressure,
    "q0 to q3, scalar last": quaternion("last", 0),
    "q1 to q4, scalar first": quaternion("first", 1),
    "no stamps of the DVL": changed("beams", stamp_ns=pl.lit(0)),
    "identity for an attitude": changed("ahrs", roll_deg=pl.lit(0.0), pitch_deg=pl.lit(0.0), heading_deg=pl.lit(0.0)),
    "clock set after 40 s": later(*BOTH, by_s=-3e8, end_s=40.0),
    "DVL on GPS time": later(*BOTH, by_s=18.0),
    "course before heading": course_beside_heading,
    # Of sensors.
    "frozen depth": changed("depth", depth_m=during("depth_m", 40.0, np.inf, pl.lit(3.1))),
    "depth jumps": changed("depth", depth_m=during("depth_m", 60.0, np.inf, pl.col("depth_m") + 2.0)),
    "depth drifts": changed("depth", depth_m=pl.col("depth_m") + 2.0 * (pl.col("time_s") - EPOCH_S) / 150.0),
    "beam 1 dead": changed("beams", beam1_mps=pl.lit(None, dtype=pl.Float64)),
    "beams 1 and 2 dead": changed("beams", beam1_mps=pl.lit(np.nan), beam2_mps=pl.lit(np.nan)),
    "compass jumps": changed(
        "ahrs", heading_deg=during("heading_deg", 80.0, 140.0, (pl.col("heading_deg") + 25.0) % WHOLE_SPHERE)
    ),
    # Of users.
    "deg/s named rad/s": all_of(
        _scaled("imu", GYROS, DEGREES), named("imu", gx="gx_rad_s", gy="gy_rad_s", gz="gz_rad_s")
    ),
    "rad/s named deg/s": named("imu", gx="gx_deg_s", gy="gy_deg_s", gz="gz_deg_s"),
    "IMU in g named m/s2": all_of(
        _scaled("imu", FORCES, 1.0 / STANDARD_GRAVITY), named("imu", ax="ax_m_s2", ay="ay_m_s2", az="az_m_s2")
    ),
    "IMU axes exchanged": all_of(exchanged("imu", "ax", "ay"), exchanged("imu", "gx", "gy")),
    "IMU with z up": _scaled("imu", "ay az gy gz", -1.0),
    "gyro z reversed": _scaled("imu", "gz", -1.0),
    "dropped readings": left(
        "imu", (pl.int_range(pl.len()) % 7 < 5) & ~(pl.col("time_s") - EPOCH_S).is_between(100.0, 106.0)
    ),
    "beams 2 and 3 exchanged": exchanged("beams", "beam2_mps", "beam3_mps"),
    "DVL clock 1.5 s late": later(*BOTH, by_s=1.5),
    "DVL begins 60 s late": all_of(*(left(one, pl.col("time_s") > EPOCH_S + 60.0) for one in BOTH)),
    "velocities 8 % too large": _scaled("velocity", "vx vy vz", 1.08),
    "velocities in feet a second": _scaled("velocity", "vx vy vz", 3.28084),
    "velocity forward, left, up": _scaled("velocity", "vy vz", -1.0),
    "velocity forward, left, down": _scaled("velocity", "vy", -1.0),
    "DVL times in ms": changed(*BOTH, time_s=1e3 * pl.col("time_s")),
    "radians named degrees": _scaled("ahrs", "roll_deg pitch_deg heading_deg", 1.0 / DEGREES),
    "heading from east": changed("ahrs", heading_deg=(90.0 - pl.col("heading_deg")) % WHOLE_SPHERE),
    "magnetic heading": changed("ahrs", heading_deg=(pl.col("heading_deg") - 12.0) % WHOLE_SPHERE),
    "pressure named depth": changed("depth", depth_m=1013.25 + pl.col("depth_m") * DENSITY * STANDARD_GRAVITY / 100.0),
    "depth upwards": _scaled("depth", "depth_m", -1.0),
    "depth in feet": all_of(_scaled("depth", "depth_m", 1.0 / 0.3048), named("depth", depth_m="Depth (ft)")),
    "latitude and longitude exchanged": exchanged("gps", "latitude", "longitude"),
}  # fmt: skip
"""What goes wrong with logs, by name."""


def dvl_bytes(held: pl.DataFrame, form: str, geometry: str, *, delay_ns: int = 60_000_000) -> bytes:
    """The table of beams as a maker's format; a velocity where all beams are there."""
    of = read_geometry(geometry).geometry
    writer, inverse = encoder(form, of), np.linalg.pinv(np.asarray(of.directions_p))
    out, before = [], 0
    for k, row in enumerate(held.fill_null(np.nan).iter_rows(named=True)):
        beams, ranges = (
            np.array([row[f"beam{j + 1}_{unit}"] for j in range(of.beams)]) for unit in ("mps", "range_m")
        )
        time_ns, whole = round(row["time_s"] * 1e9), bool(np.isfinite(beams).all())
        ping = Ping(
            time_ns=time_ns, transmission_ns=time_ns + delay_ns, interval_ns=max(time_ns - before, 0) if k else 0,
            number=k + 1, beam_velocity_mps=beams, range_m=ranges, velocity_p_mps=inverse @ beams if whole else None,
            covariance_m2ps2=np.eye(3) * 1e-4 if whole else None,
        )  # fmt: skip
        before = time_ns
        out.append(writer.encode(ping))
    return b"".join(out)


def given(made: Dive, *, start_ns: int = 0) -> Iterator[readings.Reading | readings.Ping]:
    """Readings in the order of their times, as `Navigator.start` takes them: IMU, pings, attitudes, depths."""
    quaternions = np.roll(Rotation.from_euler("ZYX", made.angles[:, ::-1]).as_quat(), 1, axis=1)

    def at(second: float) -> int:
        return start_ns + round(second * 1e9)

    rows: list[readings.Reading | readings.Ping] = [
        readings.ImuReading(at(s), tuple(w), tuple(f))
        for s, w, f in zip(made.imu_s, made.omega.tolist(), made.force.tolist(), strict=True)
    ]
    rows += [readings.Ping.of_beams(at(s), b) for s, b in zip(made.ping_s, made.beams, strict=True)]
    for s, q, depth in zip(made.slow_s, quaternions.tolist(), made.depth.tolist(), strict=True):
        rows += [readings.AttitudeReading(at(s), tuple(q)), readings.DepthReading(at(s), depth)]
    return iter(sorted(rows, key=lambda one: one.time_ns))
