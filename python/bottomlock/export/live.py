"""What a raw log of `bottomlock live` exports: the estimates that its replay offers to the ports, and their pings.

Times are the host's, UTC. States in which nothing may be sent have no estimate, so the track has a gap there.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.export.formats import check_formats, write_export
from bottomlock.export.tracks import Export, ExportTrack, environment_at, geodetic_of
from bottomlock.files.records import sha256_of
from bottomlock.geodesy import Place
from bottomlock.io.columns import frame_of
from bottomlock.live.config import LiveConfig
from bottomlock.live.replay import Replayed, replay_log
from bottomlock.ports.estimate import Estimate
from bottomlock.recordings.axes import from_quaternions, to_angles
from bottomlock.recordings.readings import Ping
from bottomlock.recordings.streams import Floats
from bottomlock.replay.vehicle_motion import level_axes

NAME = "live"
"""Of the track, and of the group of its pings."""
_AXES = ("north", "east", "down")
_BODY = ("surge", "sway", "heave")


def export_live(
    config: LiveConfig, log: Path, formats: Sequence[str], *, inputs: Sequence[Path] = (), force: bool = False
) -> tuple[Replayed, list[Path]]:
    """Plays a raw log again and writes its track to `NAME_export/` beside it; the same format is replaced.

    Args:
        config: that the log is played with.
        log: of `bottomlock live`.
        formats: of `formats.FORMATS`.
        inputs: further files that are read.
        force: replace files that have changed since they were written.

    Returns:
        What the replay gave, and the files.

    Raises:
        ScenarioError: as `check_formats`.
        DataError: as `replay_log` and `check_formats`, for a log without an estimate, and for a track that a format
            cannot hold.
        OutputError: as `write_export`.
    """
    origin = config.home
    check_formats(formats, has_origin=origin is not None, has_position=config.mode == "navigation")
    made_from = {
        "log": sha256_of(log),
        "configuration": hashlib.sha256(config.model_dump_json().encode()).hexdigest(),
    }
    collected = _Collected()
    replayed: list[Replayed] = []

    def make() -> Export:
        replayed.append(replay_log(config, log, estimates=collected.estimate))
        if not collected.estimates:
            state = replayed[0].state
            raise DataError("gives no estimate to export", place=log, hint=f"its last state is {state}")
        return _export(config, log, collected, replayed[0], origin)

    folder = log.with_name(f"{log.stem}_export")
    files = write_export(make, formats, folder, "live", made_from, [log, *inputs], force=force, below="")
    return replayed[0], files


@dataclass
class _Collected:
    """What a replay passes on."""

    estimates: list[Estimate] = field(default_factory=list)
    pings: list[tuple[int, Ping]] = field(default_factory=list)

    def estimate(self, estimate: Estimate) -> None:
        """Takes an estimate, and its ping where that is a new one."""
        beams = estimate.beams
        if beams is not None and (not self.pings or self.pings[-1][1] is not beams):
            self.pings.append((estimate.time_ns, beams))
        self.estimates.append(estimate)


def _export(
    config: LiveConfig, log: Path, collected: _Collected, replayed: Replayed, origin: Place | None
) -> Export:
    words = f"{config.name}: {log.name}, played again: {replayed.text()}; estimates of the states in which any is sent"
    estimates = collected.estimates
    columns: dict[str, Any] = {"time_ns": [one.time_ns for one in estimates]}
    position = attitude = None
    if config.mode == "navigation":
        position = np.array([one.position_t_m for one in estimates])
        attitude = from_quaternions(np.array([one.attitude_t_p for one in estimates]))
        geodetic = geodetic_of(position, origin)
        columns |= _named([f"{axis}_m" for axis in _AXES], position)
        if geodetic is not None:
            columns |= _named(("latitude_deg", "longitude_deg", "height_m"), geodetic)
        assert config.origin is not None  # of every configuration in mode navigation
        earth = environment_at(math.radians(config.origin.latitude_deg), config.origin.earth)
        angles = np.rad2deg(to_angles(level_axes(earth, position).inv() * attitude))
        columns |= _named(("roll_deg", "pitch_deg", "yaw_deg"), angles)
    columns |= _velocities(estimates)
    track = ExportTrack(
        name=NAME,
        method=config.navigation.method if config.mode == "navigation" else config.velocity.method,
        group=NAME,
        description=words,
        rows=frame_of(columns),
        position_t_m=position,
        origin=origin,
        attitude=attitude,
    )
    pings = {NAME: _pings(collected.pings)} if collected.pings else {}
    return Export(config.name, [track], pings)


def _velocities(estimates: Sequence[Estimate]) -> dict[str, Any]:
    """Columns of velocity, 1 sigma and state; a component that the beams do not determine is NaN."""
    names = [f"sd_velocity_{axis}_mps" for axis in _BODY]
    covariances = [one.covariance_m2ps2 for one in estimates]
    if estimates[0].navigation_covariance is not None:
        of_position = [f"sd_position_{axis}_m" for axis in _AXES]
        names = [*of_position, *(f"sd_misalignment_{axis}_rad" for axis in _AXES), *names]
        covariances = [one.navigation_covariance for one in estimates]  # type: ignore[misc]
    return {
        **_named([f"{axis}_mps" for axis in _BODY], np.array([one.velocity_p_mps for one in estimates])),
        **_named(names, np.sqrt([np.diag(one) for one in covariances])),
        **{name: [getattr(one, name) for one in estimates] for name in ("state", "rank", "reset_counter")},
    }


def _named(names: Sequence[str], values: Floats) -> dict[str, Floats]:
    """The columns of values (n, names)."""
    return dict(zip(names, values.T, strict=True))


def _pings(pings: Sequence[tuple[int, Ping]]) -> pl.DataFrame:
    """A row a ping: time of the first estimate that has it, velocities and ranges of the beams, and which are valid."""
    columns: dict[str, Any] = {"time_ns": [time_ns for time_ns, _ in pings]}
    for key, name in (("velocity_mps", "mps"), ("range_m", "range_m"), ("valid", "valid")):
        values = np.array([getattr(beams, key) for _, beams in pings])
        columns |= _named([f"beam{k + 1}_{name}" for k in range(values.shape[1])], values)
    return frame_of(columns)
