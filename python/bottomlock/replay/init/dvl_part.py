"""The DVL of a first case: its velocity, geometry, clock and axes against the IMU."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.config.beam_layout import BeamLayout
from bottomlock.errors import DataError
from bottomlock.io.beam_table import BeamTable, Recording
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import Reordered
from bottomlock.recordings.pings import (
    PingNoise,
    beam_noise,
    better_order,
    ping_velocity,
    tilt_of_noise,
)
from bottomlock.recordings.rig_fit import Match
from bottomlock.recordings.rotation import UNCHANGED_AXES, Axes, permute_axes
from bottomlock.recordings.screen import repeated
from bottomlock.recordings.streams import Floats, Integers
from bottomlock.replay.beam_noise import measure_noise
from bottomlock.replay.init.beam_columns import range_columns
from bottomlock.replay.init.entries import Entry
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import NOTHING, Guess
from bottomlock.replay.read_tables import SPEED_SI
from bottomlock.replay.reading import no_velocity

LEAST_FOR_DIRECTIONS = 60
STARTING_NOISE_MPS = 0.01
FOUR_BEAMS = (
    ("x_janus_20", "nothing says which instrument this is: see `bottomlock list geometries`"),
    (
        "teledyne_30",
        "the beams close with 1 and 2 opposite, as Teledyne RDI's; 30 deg, or 20 as teledyne_20? Nothing says it",
    ),
)
"""Geometries of beams whose instrument is not known, the first that closes is taken; others of their order differ in
tilt and yaw, which no closure shows."""
THREE_BEAMS = "sontek_argonaut"
THREE_BEAMS_WHY = (
    "three beams; nothing says their tilt and which looks forward: see `bottomlock list geometries`"
)
NEAR_SCALE, CERTAIN_SCALE = 0.3, 0.1
"""Scale of a velocity, and its 1 sigma, that no other unit has: feet, the nearest, are 0.3 of metres."""
NOISY = 1.25
"""Measured over claimed noise from which that of the recording is used."""
ENOUGH_PINGS = 20
"""Pings with a whole velocity from which clock and axes are compared with the IMU's."""


@dataclass(frozen=True, eq=False)
class DvlPart:
    """A DVL as guessed.

    Attributes:
        recording: of its beams; None for a velocity.
        found: columns of a velocity; None for beams.
        time_ns, velocity_p_mps: (p,), (p, 3) pings with a whole velocity, on the DVL's own clock.
        first_ns, last_ns: of all pings.
        geometry: packaged name, or "" where a file is written.
        geometry_text: of that file.
        noise: of a beam, m/s; None where it is what the geometry claims.
        unit: of a velocity.
        offset: to the IMU's clock.
        claimed: geometry, and noise of each beam that it claims.
        axes: of a velocity, those that point forward, starboard, down; it is in these already.
        mounting_deg, mounting_why: roll, pitch and yaw of the instrument on the vehicle; the velocity is turned by them
            already.
        match: of its velocity with the IMU's readings.
        log: path of the recording.
        further: what else the case says of it.
    """

    recording: Recording | None
    found: Found | None
    time_ns: Integers
    velocity_p_mps: Floats
    first_ns: int
    last_ns: int
    geometry: Guess
    geometry_text: str = ""
    noise: Guess | None = None
    unit: Guess = NOTHING
    offset: Guess = NOTHING
    claimed: tuple[BeamGeometry, Floats] | None = None
    axes: Axes = UNCHANGED_AXES
    mounting_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mounting_why: str = ""
    match: Match | None = None
    log: Path | None = None
    further: tuple[Entry, ...] = ()

    def matched(self, match: Match) -> Self:
        """The same with its fit, which decides the unit where it finds a scale that none of the others has."""
        scale, sd = float(match.part("scale")[0]), float(match.part_sd("scale")[0])
        if self.unit.known or not match.plausible or abs(scale) > NEAR_SCALE or sd > CERTAIN_SCALE:
            return replace(self, match=match)
        why = f"{self.unit.why}; it is {1.0 + scale:.2f} ± {sd:.1g} of what the accelerometers integrate to"
        return replace(self, match=match, unit=Guess(self.unit.value, why))

    @property
    def on_imu_ns(self) -> Integers:
        """(p,) times of these pings on the IMU's clock."""
        return self.time_ns + round(float(self.offset.value) * 1e9)

    def mirrored(self) -> Self:
        """The same with the y axis of its velocity reversed."""
        axes: Axes = ("x", "-y", "z")
        return replace(self, axes=axes, velocity_p_mps=permute_axes(self.velocity_p_mps, axes))

    def turned(self, C: Floats) -> Self:
        """The same with a mounting of the instrument: a rotation (3, 3)."""
        roll, pitch, yaw = Rotation.from_matrix(C).as_euler("ZYX", degrees=True)[::-1].round(1) + 0.0
        velocity = np.asarray(self.velocity_p_mps @ C.T)
        return replace(self, velocity_p_mps=velocity, mounting_deg=(float(roll), float(pitch), float(yaw)))

    def saying(self, key: str, why: str, asks: str = "") -> Self:
        """The same with what is assumed of a key of its geometry, or what is asked."""
        return replace(self, further=(*self.further, Entry(f"dvl.{key}", why=why, known=False, asks=asks)))


def dvl_of_recording(recording: Recording, log: Path | None) -> DvlPart:
    """A DVL with beams, of a log.

    Raises:
        DataError: for a log whose beams never give a velocity.
    """
    table = recording.table
    named, text = _geometry(recording)
    geometry, claimed = _claimed(named.value, text)
    valid = table.valid & ~repeated(table.time_ns, table.velocity_mps, table.valid)[:, None]
    time_ns, velocity = ping_velocity(
        np.asarray(geometry.directions_p), table.time_ns, table.velocity_mps, valid
    )
    order = _better_order(geometry, claimed, table)
    part = DvlPart(
        recording, None, time_ns, velocity, int(table.time_ns[0]), int(table.time_ns[-1]), geometry=named,
        geometry_text=text, claimed=(geometry, claimed),
        noise=_noise(geometry, claimed, table) if order is None else None, log=log,
    )  # fmt: skip
    if order is None:
        return part
    return part.saying(
        "file", f"the beams are in the order of the geometry, and close {order.ratio:.1f} times better with "
        f"{order.words}", "instrument",
    )  # fmt: skip


def _better_order(geometry: BeamGeometry, claimed: Floats, table: BeamTable) -> Reordered | None:
    return better_order(
        np.asarray(geometry.directions_p), table.velocity_mps, table.valid, float(np.mean(claimed))
    )


def _claimed(name: str, text: str) -> tuple[BeamGeometry, Floats]:
    """Geometry and claimed noise (B,) of a packaged name, or of the text of a file."""
    if text:
        directions = tomllib.loads(text)["directions"]
        geometry = BeamLayout(configuration="directions", directions=directions).geometry()
        return geometry, np.full(geometry.beams, STARTING_NOISE_MPS)
    instrument = read_geometry(name)
    return instrument.geometry, np.asarray(instrument.beam_sd_mps)


def with_noise(dvl: DvlPart, pings: PingNoise | None) -> DvlPart:
    """The same with the noise that consecutive pings show, where it exceeds the geometry's claim and the closure."""
    if pings is None or dvl.claimed is None:
        return dvl
    geometry, sd_mps = dvl.claimed
    claimed = float(np.mean(sd_mps))
    found = beam_noise(np.asarray(geometry.directions_p), pings.velocity_sd_mps)
    level, vertical = float(np.sqrt(np.mean(pings.velocity_sd_mps[:2] ** 2))), float(pings.velocity_sd_mps[2])
    noise, named = dvl.noise, dvl.geometry
    if found > NOISY * (claimed if noise is None else noise.value):
        scatter = f"consecutive pings scatter by {level:.2g} m/s level and {vertical:.2g} m/s vertical"
        noise = Guess(
            float(f"{found:.2g}"), f"{scatter} beyond the motion; the geometry claims {claimed:.2g}"
        )
    if not named.known and vertical > 0.0 and found > NOISY * claimed:
        tilt = float(np.rad2deg(tilt_of_noise(pings.velocity_sd_mps)))
        tilted = f"{named.why}; the noise of the velocity is that of beams tilted by {tilt:.0f} deg"
        named = replace(named, why=tilted)
    return replace(dvl, noise=noise, geometry=named)


def _noise(geometry: BeamGeometry, claimed: Floats, table: BeamTable) -> Guess | None:
    """Noise of a beam, where the closure exceeds what the geometry claims."""
    group = measure_noise(geometry, table.velocity_mps, table.valid, claimed).groups[-1]
    if group.fallback or group.factor < NOISY:
        return None
    claim_mps = float(np.mean(claimed))
    why = f"closure of {group.pings} pings; the geometry claims {claim_mps:.2g}"
    return Guess(float(f"{group.factor * claim_mps:.2g}"), why)


def _geometry(recording: Recording) -> tuple[Guess, str]:
    """Packaged name, or the text of a geometry file."""
    beams = recording.table.beams
    if recording.geometry:
        return Guess(recording.geometry, f"the format {recording.format} belongs to it"), ""
    found = _from_velocity(recording)
    if found is not None:
        why = "directions by least squares of the beams on the instrument's own velocity"
        return Guess("", why), _file(found)
    stated = np.asarray(recording.facts.get("beam_unit_vec", ()), dtype=float)
    if stated.shape == (beams, 3) and np.allclose(np.linalg.norm(stated, axis=1), 1.0, atol=0.02):
        return Guess("", "beam_unit_vec of the messages"), _file(stated)
    if beams == 4:
        # The first whose order of beams closes, or the first of all where none does.
        closing = (one for one in FOUR_BEAMS if _better_order(*_claimed(one[0], ""), recording.table) is None)
        return Guess(*next(closing, FOUR_BEAMS[0]), known=False), ""
    if beams == 3:
        return Guess(THREE_BEAMS, THREE_BEAMS_WHY, known=False), ""
    azimuth = 2.0 * np.pi * np.arange(beams) / beams
    tilt = np.deg2rad(22.5)
    cone = np.stack(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(beams, np.cos(tilt))], axis=1
    )
    why = f"{beams} beams at 22.5 deg, evenly around, beam 1 forward: nothing says their directions"
    return Guess("", why, known=False), _file(cone)


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


OFTEN = 0.01
"""Part of the rows with the same largest value from which this is a code for "no reading"."""


def _usual(values: Floats) -> float:
    """Speed below which 95 % of the readings are, without a largest one that repeats as a code does."""
    speed = np.abs(values[np.isfinite(values)])
    code = speed == speed.max(initial=0.0)
    return float(np.percentile(speed[~code] if OFTEN * len(speed) < code.sum() < len(speed) else speed, 95))


def dvl_of_velocity(found: Found) -> DvlPart:
    """A DVL of which a velocity was recorded.

    Raises:
        DataError: for a table without times.
    """
    times = found.times.time_ns
    if times is None:
        raise DataError("has velocities but no column of times", place=found.table.path)
    values = found.values("v0", "v1", "v2")
    hint = found.units.get("v0", "")
    p95 = _usual(values)
    if hint in SPEED_SI:
        unit = Guess(hint, "the column's name says so")
    else:
        why = f"95 % are below {p95:.3g}" + f", and its name says '{hint}', which is no unit known" * bool(
            hint
        )
        unit = Guess("mm/s" if p95 > 50.0 else "m/s", why, known=False)
    good = np.isfinite(values).all(axis=1) & ~no_velocity(values * SPEED_SI[unit.value])
    if "valid" in found.extra:
        good &= found.values("valid")[:, 0] == 1.0
    good &= np.concatenate([[True], np.diff(times) > 0]) & ~repeated(times, values, good[:, None])
    ranges = range_columns(found.table)
    name, because = "x_janus_20", "beams are projected from the velocity: give your instrument's tilt"
    if len(ranges) == 3:
        name, because = THREE_BEAMS, f"the ranges {', '.join(ranges)} are those of {THREE_BEAMS_WHY}"
    return DvlPart(
        None, found, times[good], values[good] * SPEED_SI[unit.value], int(times[0]), int(times[-1]),
        geometry=Guess(name, because, known=False), unit=unit, claimed=_claimed(name, ""),
    )  # fmt: skip
