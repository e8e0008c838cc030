"""The tracks that a replay exports: estimates of the chosen methods in each what-if case, and the reference."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError, ScenarioError
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.kernel.models import Environment
from bottomlock.pages.plots import is_utc
from bottomlock.recordings.axes import ENU_FROM_NED, FLU_FROM_FRD, from_angles
from bottomlock.recordings.geodesy import Place, geodetic_from_tangent
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.dive_plots import taken
from bottomlock.replay.level import level_axes
from bottomlock.replay.report import ReplayTables
from bottomlock.tables.replay import FORWARD

REFERENCE = "reference"


@dataclass(frozen=True, eq=False)
class ExportTrack:
    """A track.

    Attributes:
        name: of files and topics: what-if case, method, and `smoothed` for that pass; or `reference`.
        method: that estimated it, or `reference`.
        what_if: the case, empty for the reference.
        description: a sentence for the reader of a file.
        rows: of `samples`, or of `reference`, those with a position alone.
        position_t_m: (n, 3) north, east, down in the tangent frame, m.
        geodetic: (n, 3) latitude, longitude, deg, and height above the ellipsoid, m; None without an origin.
        orientation_enu_flu: (n, 4) unit quaternions x, y, z, w, forward-left-up to east-north-up; None for a track
            without an attitude.
        has_height: whether its heights and depths were recorded; those of a reference without are the origin's.
    """

    name: str
    method: str
    what_if: str
    description: str
    rows: pl.DataFrame
    position_t_m: Floats
    geodetic: Floats | None
    orientation_enu_flu: Floats | None
    has_height: bool = True

    @property
    def time_ns(self) -> Times:
        """(n,) times, ns."""
        return self.rows["time_ns"].to_numpy()

    @property
    def is_utc(self) -> bool:
        """Whether the times are Unix time."""
        return is_utc(int(self.time_ns[0]))

    @property
    def position_enu_m(self) -> Floats:
        """(n, 3) east, north, up in the tangent frame, m."""
        return np.asarray(self.position_t_m @ ENU_FROM_NED.T)


def export_tracks(tables: ReplayTables, methods: Sequence[str] | None = None) -> list[ExportTrack]:
    """The tracks of the first run: forward and smoothed, in every what-if case, then the reference where there is one.

    Args:
        tables: of the replay.
        methods: to export; the one to take by default.

    Raises:
        ScenarioError: for a method that the replay has not run.
        DataError: for a replay without one position.
    """
    manifest = tables.manifest
    chosen = [taken(manifest)] if methods is None else list(dict.fromkeys(methods))
    for method in chosen:
        if method not in manifest["methods"]:
            raise ScenarioError(
                f"'{method}': is not in the replay, expected of {', '.join(manifest['methods'])}"
            )
    origin = None if manifest["origin"] is None else Place(**manifest["origin"])
    environment = _environment(manifest)
    tracks = [
        track
        for what_if, words in manifest["what_if"]
        for method in chosen
        for track in _estimates(tables, what_if, words, method, origin, environment)
    ]
    if tables.path is not None:
        rows = _placed(tables.path)
        if rows.height:
            tracks.append(_reference(manifest, rows, tables.path.height, origin))
    if not tracks:
        raise DataError("the replay has no position to export: its start has none")
    return tracks


def _reference(
    manifest: Mapping[str, Any], rows: pl.DataFrame, times: int, origin: Place | None
) -> ExportTrack:
    """The reference, of so many times."""
    section, position = manifest["configuration"]["reference"], _position(rows)
    has_height = section["height"] is not None or section["down"] is not None
    words = f"{manifest['case']}: reference, {manifest['reference_note'] or 'as recorded'}"
    words += "" if has_height else "; heights were not recorded"
    return ExportTrack(
        name=REFERENCE,
        method=REFERENCE,
        what_if="",
        description=words + _without(times - rows.height),
        rows=rows,
        position_t_m=position,
        geodetic=_geodetic(position, origin),
        orientation_enu_flu=None,
        has_height=has_height,
    )


def _without(times: int) -> str:
    """Times that a track leaves out, in words; none for none."""
    return f"; {times} times without a position are left out" if times else ""


def _environment(manifest: Mapping[str, Any]) -> Environment:
    """The Earth of a replay: level axes depend on its shape and the latitude, not on gravity."""
    origin, stated = manifest["origin"], manifest["configuration"]["origin"]
    latitude = np.deg2rad(stated["latitude_deg"]) if origin is None else origin["latitude_rad"]
    gravity = normal_gravity_mps2(latitude, 0.0)
    return Environment(latitude_rad=float(latitude), gravity_mps2=gravity, earth=stated["earth"])


def _estimates(
    tables: ReplayTables,
    what_if: str,
    words: str,
    method: str,
    origin: Place | None,
    environment: Environment,
) -> Iterator[ExportTrack]:
    """The passes of a method in a what-if case."""
    manifest = tables.manifest
    samples = tables.samples.filter(
        (pl.col("what_if") == what_if) & (pl.col("method") == method) & (pl.col("run") == pl.col("run").min())
    )
    answer = manifest.get("answer", {})
    for (which,), every in samples.group_by(["pass"], maintain_order=True):
        rows = _placed(every)
        if not rows.height:
            continue
        end = "" if which == FORWARD else f"_{which}"
        description = f"{manifest['case']}: {words}; method {method}, {which}"
        if manifest["semi_synthetic"]:
            description += "; semi-synthetic"
        if answer.get("method") != method:
            description += f"; not the track to take ({answer.get('sentence', 'there is no verdict')})"
        description += _without(every.height - rows.height)
        position = _position(rows)
        angles = np.deg2rad(rows.select("roll_deg", "pitch_deg", "yaw_deg").to_numpy())
        attitude = level_axes(environment, position) * from_angles(*angles.T)
        yield ExportTrack(
            f"{what_if}_{method}{end}",
            method,
            what_if,
            description,
            rows,
            position,
            _geodetic(position, origin),
            _enu_flu(attitude.as_matrix()),
        )


def _enu_flu(rotation_t_p: Floats) -> Floats:
    """(n, 4) unit quaternions x, y, z, w of (n, 3, 3) rotations from platform (forward-right-down) to tangent axes."""
    rotation = Rotation.from_matrix(ENU_FROM_NED @ rotation_t_p @ FLU_FROM_FRD)
    return np.asarray(rotation.as_quat(canonical=True))


def _placed(rows: pl.DataFrame) -> pl.DataFrame:
    """The rows with a position: a reference may have none at times, dead reckoning before its first ping."""
    return rows.filter(pl.all_horizontal(pl.col("north_m", "east_m", "down_m").is_not_null()))


def _position(rows: pl.DataFrame) -> Floats:
    return rows.select("north_m", "east_m", "down_m").to_numpy()


def _geodetic(position_t_m: Floats, origin: Place | None) -> Floats | None:
    if origin is None:
        return None
    latitude, longitude, height = geodetic_from_tangent(position_t_m, origin)
    return np.stack([np.rad2deg(latitude), np.rad2deg(longitude), height], axis=-1)
