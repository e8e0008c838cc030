"""The DVL of a first case: its velocity, geometry, clock and axes against the IMU."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.io.beam_table import BeamTable, Recording
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import BeamGeometry, make_geometry
from bottomlock.replay.beam_noise import measure_noise
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.motion.fit import Match, Recorded, fit
from bottomlock.replay.motion.search import LOOSE, Searched, search_offset
from bottomlock.replay.motion.velocity import ping_velocity

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
SPEED_SI = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
LEAST_FOR_DIRECTIONS = 60
STARTING_NOISE_MPS = 0.01
NOISY = 1.25
"""Measured over claimed noise from which that of the recording is used."""
ENOUGH_PINGS = 20
"""Pings with a whole velocity from which clock and axes are compared with the IMU's."""
CLEAR = 40.0
"""Difference of two costs from which axes are told apart: a likelihood ratio beyond any doubt."""


@dataclass(eq=False)
class DvlPart:
    """A DVL as guessed.

    Attributes:
        recording: of its beams; None for a velocity.
        found: columns of a velocity; None for beams.
        time_ns, velocity_p_mps: (p,), (p, 3) pings with a whole velocity, on the DVL's own clock.
        first_ns, last_ns: of all pings.
        geometry: packaged name, or "" where a file is written.
        geometry_text: of that file.
        geometry_why, geometry_known: its reason.
        noise: of a beam, m/s, and why; None where it is what the geometry claims.
        unit, unit_why: of a velocity.
        offset_s: to the IMU's clock.
    """

    recording: Recording | None
    found: Found | None
    time_ns: Integers
    velocity_p_mps: Floats
    first_ns: int
    last_ns: int
    geometry: str = ""
    geometry_text: str = ""
    geometry_why: str = ""
    geometry_known: bool = True
    noise: tuple[float, str] | None = None
    unit: str = "m/s"
    unit_why: str = ""
    offset_s: float = 0.0
    offset_why: str = ""
    offset_known: bool = True
    match: Match | None = None
    questions: list[str] = field(default_factory=list)

    def recorded(self, imu: ImuPart, axes: Floats | None = None) -> Recorded:
        """Inertial readings, with axes other than the IMU's own guess, and the velocity on their clock."""
        P = imu.axes if axes is None else axes
        return Recorded(
            imu.time_ns, imu.force_s_mps2 @ P.T, imu.omega_s_radps @ P.T,
            self.time_ns + round(self.offset_s * 1e9), self.velocity_p_mps,
        )  # fmt: skip


def dvl_of_recording(recording: Recording) -> DvlPart:
    """A DVL with beams.

    Raises:
        DataError: for a log whose beams never give a velocity.
    """
    table = recording.table
    name, text, why, known = _geometry(recording)
    if text:
        geometry = make_geometry("directions", directions=[tuple(row) for row in _directions_of(text)])
        claimed = np.full(geometry.beams, STARTING_NOISE_MPS)
    else:
        instrument = read_geometry(name)
        geometry, claimed = instrument.geometry, instrument.beam_sd_mps
    time_ns, velocity = ping_velocity(
        np.asarray(geometry.directions_p), table.time_ns, table.velocity_mps, table.valid
    )
    return DvlPart(
        recording, None, time_ns, velocity, int(table.time_ns[0]), int(table.time_ns[-1]), geometry=name,
        geometry_text=text, geometry_why=why, geometry_known=known,
        noise=_noise(geometry, claimed, table),
    )  # fmt: skip


def _noise(geometry: BeamGeometry, claimed: Floats, table: BeamTable) -> tuple[float, str] | None:
    """Noise of a beam and why, where the closure exceeds what the geometry claims."""
    if table.beams != geometry.beams:
        return None
    group = measure_noise(geometry, table.velocity_mps, table.valid, claimed).groups[-1]
    if group.fallback or group.factor < NOISY:
        return None
    claim_mps = float(np.mean(claimed))
    why = f"closure of {group.pings} pings; the geometry claims {claim_mps:.2g}"
    return float(f"{group.factor * claim_mps:.2g}"), why


def _directions_of(text: str) -> list[list[float]]:
    import tomllib  # noqa: PLC0415

    return [list(row) for row in tomllib.loads(text)["directions"]]


def _geometry(recording: Recording) -> tuple[str, str, str, bool]:
    """Packaged name or text of a geometry file, why, and whether it is known."""
    beams = recording.table.beams
    if recording.geometry:
        return recording.geometry, "", f"the format {recording.format} belongs to it", True
    found = _from_velocity(recording)
    if found is not None:
        return (
            "",
            _file(found),
            "directions by least squares of the beams on the instrument's own velocity",
            True,
        )
    stated = np.asarray(recording.facts.get("beam_unit_vec", ()), dtype=float)
    if stated.shape == (beams, 3) and np.allclose(np.linalg.norm(stated, axis=1), 1.0, atol=0.02):
        return "", _file(stated), "beam_unit_vec of the messages", True
    if beams == 4:
        return "x_janus_20", "", "nothing says which instrument this is: see `bottomlock geometries`", False
    azimuth = 2.0 * np.pi * np.arange(beams) / beams
    tilt = np.deg2rad(22.5)
    cone = np.stack(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(beams, np.cos(tilt))], axis=1
    )
    return (
        "",
        _file(cone),
        f"{beams} beams at 22.5 deg, evenly around, beam 1 forward: nothing says their directions",
        False,
    )


def _from_velocity(recording: Recording) -> Floats | None:
    """(beams, 3) unit directions from the instrument's own velocity, where it is recorded and varied."""
    table = recording.table
    v = table.instrument_mps
    rows = table.valid.all(axis=1) & np.isfinite(v).all(axis=1) & (table.instrument_valid != 0)
    if recording.frame not in {"frd", "instrument", "as recorded"} or rows.sum() < LEAST_FOR_DIRECTIONS:
        return None
    v, y = v[rows], table.velocity_mps[rows]
    if np.linalg.eigvalsh(v.T @ v / len(v))[0] < 1e-4:
        return None
    A = np.linalg.lstsq(v, y, rcond=None)[0].T
    length = np.linalg.norm(A, axis=1)
    return np.asarray(A / length[:, None]) if (np.abs(length - 1.0) < 0.1).all() else None


def _file(directions: Floats) -> str:
    rows = ", ".join(
        "[" + ", ".join(f"{x:.6f}" for x in row / np.linalg.norm(row)) + "]" for row in directions
    )
    return (
        f'configuration = "directions"\ndirections = [{rows}]\n'
        f"beam_noise_mps = {STARTING_NOISE_MPS}  # m/s, 1 sigma: a starting value\n"
    )


def dvl_of_velocity(found: Found) -> DvlPart:
    """A DVL of which a velocity was recorded.

    Raises:
        DataError: for a table without times.
    """
    times = found.times.time_ns
    if times is None:
        raise DataError(f"{found.table.path}: has velocities but no column of times")
    values = found.values("v0", "v1", "v2")
    hint = found.units.get("v0", "").replace(" ", "")
    p95 = float(np.nanpercentile(np.abs(values), 95))
    if hint in SPEED_SI:
        unit, why = hint, "the column's name says so"
    elif p95 > 50.0:
        unit, why = "mm/s", f"95 % are below {p95:.4g}"
    else:
        unit, why = "m/s", f"95 % are below {p95:.3g}"
    good = np.isfinite(values).all(axis=1)
    if "valid" in found.extra:
        good &= found.values("valid")[:, 0] == 1.0
    good &= np.concatenate([[True], np.diff(times) > 0])
    return DvlPart(
        None, found, times[good], values[good] * SPEED_SI[unit], int(times[0]), int(times[-1]), geometry="x_janus_20",
        geometry_why="beams are projected from the velocity: give your instrument's "
        "tilt", geometry_known=False, unit=unit,
        unit_why=why,
    )  # fmt: skip


def set_clock(dvl: DvlPart, imu: ImuPart) -> Searched | None:
    """Finds the offset of a DVL's clock to the IMU's: none where they run together, else by the motion."""
    first, last = int(imu.time_ns[0]), int(imu.time_ns[-1])
    together = min(last, dvl.last_ns) - max(first, dvl.first_ns)
    shorter = min(last - first, dvl.last_ns - dvl.first_ns)
    if together > 0.3 * shorter:
        return None
    starts_s = (first - dvl.first_ns) * 1e-9
    imu_s, dvl_s = (last - first) * 1e-9, (dvl.last_ns - dvl.first_ns) * 1e-9
    for hours in range(-28, 29):
        shift = round(hours * 1800e9)
        if hours and min(last, dvl.last_ns + shift) - max(first, dvl.first_ns + shift) > 0.6 * shorter:
            dvl.offset_s = shift * 1e-9
            dvl.offset_why = (
                f"the files overlap when the DVL's clock is moved by {hours / 2.0:g} h, a time zone"
            )
            return None
    least_s = min(60.0, 0.5 * min(imu_s, dvl_s))
    found = None
    if len(dvl.time_ns) > ENOUGH_PINGS:
        begun_ns = dvl.time_ns + round(starts_s * 1e9)
        origin = Recorded(imu.time_ns, imu.force_p_mps2, imu.omega_p_radps, begun_ns, dvl.velocity_p_mps)
        found = search_offset(origin, least_s - dvl_s, imu_s - least_s)
    if found is not None and found.clear:
        dvl.offset_s = starts_s + found.offset_s
        dvl.offset_why = (
            f"the DVL's velocity follows the IMU's best there, {found.gain:.1f} times better than at other "
            "offsets (next best "
            f"{found.second:.1f})"
        )
    else:
        dvl.offset_s, dvl.offset_known = starts_s, False
        dvl.offset_why = (
            "the clocks have nothing in common, and the motion does not tell the offset: both "
            "files are taken to begin together"
        )
    return found


def _yaw(quarters: float) -> Floats:
    return np.asarray(Rotation.from_euler("Z", 90.0 * quarters, degrees=True).as_matrix()).round(12) + 0.0


def set_axes(dvl: DvlPart, imu: ImuPart, *, imu_confirmed: bool) -> ImuPart:
    """Axes of IMU and DVL about the vertical, and the IMU's handedness, by which choice lets the velocity follow."""
    mirror = np.diag([1.0, -1.0, 1.0])
    choices = {"as named": np.eye(3)}
    if not imu_confirmed:
        choices |= {f"turned by {90 * k} deg": _yaw(k) for k in (1, 2, 3)}
        if not imu.handed:
            choices |= {f"mirrored {k}": _yaw(k) @ mirror for k in range(4)}
    prior = LOOSE | {"rotation": 0.2}
    fits = {name: fit(dvl.recorded(imu, Q @ imu.axes), prior) for name, Q in choices.items()}
    known = {name: one for name, one in fits.items() if one is not None}
    if not known:
        dvl.questions.append("too few pings overlap the IMU's readings: clock and axes could not be compared")
        return imu
    sigma = min(one.sigma_mps for one in known.values())
    costs = {}
    for name in known:
        one = fit(dvl.recorded(imu, choices[name] @ imu.axes), prior, sigma_mps=sigma)
        costs[name] = np.inf if one is None else one.cost
    order = sorted(costs, key=lambda name: costs[name])
    best = order[0]
    if (
        best != "as named"
        and costs["as named"] - costs[best] > CLEAR
        and (len(order) < 2 or costs[order[1]] - costs[best] > CLEAR)
    ):
        Q = choices[best]
        odds = (
            f"the DVL's velocity follows the IMU with these axes (cost {costs[best]:.0f}, as named "
            f"{costs['as named']:.0f})"
        )
        imu = imu.with_axes(Q @ imu.axes, f"{imu.axes_why}; {odds}", known=True)
    elif best == "as named" and len(order) > 1 and costs[order[1]] - costs[best] > CLEAR:
        odds = f"the DVL's velocity follows the IMU (cost {costs[best]:.0f}, next best axes {costs[order[1]]:.0f})"
        imu = imu.with_axes(imu.axes, f"{imu.axes_why}; {odds}", known=True)
    dvl.match = fit(dvl.recorded(imu), LOOSE)
    _refine_clock(dvl)
    return imu


def _refine_clock(dvl: DvlPart) -> None:
    """Takes over a clock offset that the motion shows beyond doubt."""
    match = dvl.match
    if match is None or not match.plausible:
        if match is not None:
            dvl.questions.append(
                "the velocity does not follow the IMU: are both of the same dive, and which axes have they?"
            )
        return
    clock, sd = float(match.part("clock")[0]), float(match.part_sd("clock")[0])
    if abs(clock) > max(6.0 * sd, 0.03):
        dvl.offset_s += clock
        words = f"the DVL's velocity follows the IMU best when moved by {clock:+.3f} ± {sd:.2g} s"
        dvl.offset_why = f"{dvl.offset_why}; {words}" if dvl.offset_why else words
