"""What is exported: tracks with what is known of each time, the beams of their pings, and further rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.figures.palette import stroke
from bottomlock.figures.series import is_utc
from bottomlock.geodesy import Place, geodetic_from_tangent
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.kernel.models import Environment
from bottomlock.recordings.axes import ENU_FROM_NED, FLU_FROM_FRD
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.panels import REFERENCE_COLOUR


@dataclass(frozen=True, eq=False)
class ExportTrack:
    """A track.

    Attributes:
        name: of files and topics.
        method: that estimated it; `reference`.
        group: of the tracks that have the same pings: a what-if case, a log; empty for a reference.
        description: a sentence for the reader of a file.
        rows: a row a time, with `time_ns`; columns are named as those of a replay's `samples`.
        position_t_m: (n, 3) north, east, down in the tangent frame, m; None for velocities alone.
        origin: of the tangent frame; None where its place on the Earth is not known.
        attitude: (n,) platform to tangent axes; None for a track without one.
        has_height: whether its heights and depths were recorded; those of a reference without are the origin's.
    """

    name: str
    method: str
    group: str
    description: str
    rows: pl.DataFrame
    position_t_m: Floats | None
    origin: Place | None
    attitude: Rotation | None
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
    def position_enu_m(self) -> Floats | None:
        """(n, 3) east, north, up in the tangent frame, m; None for velocities alone."""
        return None if self.position_t_m is None else np.asarray(self.position_t_m @ ENU_FROM_NED.T)

    @cached_property
    def geodetic(self) -> Floats | None:
        """(n, 3) latitude, longitude, deg, and height above the ellipsoid, m; None without an origin or positions."""
        return geodetic_of(self.position_t_m, self.origin)

    @cached_property
    def orientation_enu_flu(self) -> Floats | None:
        """(n, 4) unit quaternions x, y, z, w, forward-left-up to east-north-up; None without an attitude."""
        if self.attitude is None:
            return None
        turned = Rotation.from_matrix(ENU_FROM_NED @ self.attitude.as_matrix() @ FLU_FROM_FRD)
        return np.asarray(turned.as_quat(canonical=True))

    @property
    def colour(self) -> str:
        """#rrggbb, that of its method on every page of ours."""
        return stroke(self.method).colour if self.group else REFERENCE_COLOUR


@dataclass(frozen=True, eq=False)
class Export:
    """All that an export has.

    Attributes:
        title: name of the case or configuration.
        tracks: one or more.
        pings: by group, a row a ping: `time_ns`, `beam1_valid` and so on.
        further: what else a file of topics has: kind of the rows, name of the topic, and the rows.
    """

    title: str
    tracks: Sequence[ExportTrack]
    pings: Mapping[str, pl.DataFrame]
    further: Sequence[tuple[str, str, pl.DataFrame]] = ()


def environment_at(latitude_rad: float, earth: Literal["ellipsoid", "tangent_plane"]) -> Environment:
    """The Earth of a track: level axes depend on its shape and the latitude, not on gravity."""
    gravity = normal_gravity_mps2(latitude_rad, 0.0)
    return Environment(latitude_rad=float(latitude_rad), gravity_mps2=gravity, earth=earth)


def geodetic_of(position_t_m: Floats | None, origin: Place | None) -> Floats | None:
    """(n, 3) latitude, longitude, deg, and height, m, of positions in the tangent frame of an origin; None without."""
    if position_t_m is None or origin is None:
        return None
    latitude, longitude, height = geodetic_from_tangent(position_t_m, origin)
    return np.stack([np.rad2deg(latitude), np.rad2deg(longitude), height], axis=-1)
