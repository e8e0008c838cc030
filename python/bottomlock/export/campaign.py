"""What a finished campaign exports: run K of each trajectory, the truth and the estimate of each method with its σ.

The place is the scenario's, latitude and longitude of `[environment]` at the surface of the sea; the time is that of
the simulation, which starts at zero and is no date.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.campaign.run_again import Motion, RunAgain, check_run, runs_again
from bottomlock.config.scenario import Scenario
from bottomlock.export.formats import check_formats, results_of, write_export
from bottomlock.export.tracks import Export, ExportTrack, chosen_methods, geodetic_of, orientation_enu_flu
from bottomlock.files.overwriting import digests_of
from bottomlock.kernel.models import Environment
from bottomlock.recordings.axes import from_quaternions, to_angles
from bottomlock.recordings.geodesy import Place
from bottomlock.recordings.streams import Floats
from bottomlock.replay.level import level_axes
from bottomlock.simulation.build import build_simulation
from bottomlock.tables.results import CampaignTables, read_campaign_tables

TRUTH = "truth"
_AXES = ("north", "east", "down")


def export_campaign(
    folder: str | Path,
    formats: Sequence[str],
    *,
    run: int = 0,
    methods: Sequence[str] | None = None,
    threads: int = 0,
    force: bool = False,
) -> list[Path]:
    """Writes run K of every trajectory to `export/` in the campaign's folder; the same format is replaced.

    Args:
        folder: of the campaign.
        formats: of `formats.FORMATS`.
        run: its number, from 0.
        methods: whose tracks are exported; all by default.
        threads: 0 for as many as there are cores.
        force: replace files that have changed since they were written.

    Returns:
        The files.

    Raises:
        ScenarioError: as `check_formats` and `runs_again`, and for a method that the campaign has not run.
        DataError: as `read_campaign_tables`, `check_formats` and `runs_again`, and for tracks that a format cannot
            hold.
        OutputError: as `write_export`.
    """
    folder = Path(folder)
    check_formats(formats)
    campaign = read_campaign_tables(folder)
    check_run(campaign, run)
    if methods is not None:
        known = [method for name in campaign.trajectories for method in campaign.methods(name)]
        methods = chosen_methods(methods, list(dict.fromkeys(known)), "the campaign")
    results = results_of(folder, formats, "run", digests_of(folder, [folder / "manifest.json"]))
    for _, result in results:
        result.check(force=force)
    return write_export(export_of_run(campaign, run, methods, threads=threads), results, force=force)


def places_of(folder: Path) -> list[str]:
    """Where and when the tracks of a campaign's folder are, a line a trajectory.

    Raises:
        DataError: as `read_campaign_tables`.
    """
    campaign = read_campaign_tables(folder)
    stated = {name: campaign.configuration(name)["environment"] for name in campaign.trajectories}
    return [
        f"{name}: {place_words(one['latitude_deg'], one['longitude_deg'])}" for name, one in stated.items()
    ]


def place_words(latitude_deg: float, longitude_deg: float) -> str:
    """Origin and time of an exported run, in words."""
    return (
        f"origin latitude {latitude_deg:g}°, longitude {longitude_deg:g}° of the scenario's [environment], at the "
        "surface; time from the start, no date"
    )


def export_of_run(
    campaign: CampaignTables, run: int, methods: Sequence[str] | None = None, *, threads: int = 0
) -> Export:
    """Run K of every trajectory; methods that a trajectory has not run are left out of it.

    Raises:
        ScenarioError, DataError: as `runs_again`.
    """
    again = runs_again(campaign, run, threads=threads)
    pings = {
        group: _pings(motion)
        for one in again
        for group, motion in zip(_groups(one), one.vehicles, strict=True)
    }
    tracks = [track for one in again for track in _tracks(one, methods)]
    used = {track.group for track in tracks}
    kept = {group: table for group, table in pings.items() if group in used}
    return Export(f"run {run} of {', '.join(campaign.trajectories)}", tracks, kept)


def _groups(again: RunAgain) -> list[str]:
    """A name a vehicle."""
    name = f"{again.scenario.name}_run{again.run}"
    if len(again.vehicles) == 1:
        return [name]
    return [f"{name}_vehicle_of_{method}" for method in again.scenario.campaign.methods]


def _tracks(again: RunAgain, methods: Sequence[str] | None) -> Iterator[ExportTrack]:
    """The estimates of the chosen methods, each vehicle's truth after those of its own."""
    name, all_methods = f"{again.scenario.name}_run{again.run}", again.scenario.campaign.methods
    shared = len(again.vehicles) == 1
    place = _Place(again.scenario)
    words = f"{again.scenario.name}: run {again.run} of a simulation, {place.words}"
    for k, (group, motion) in enumerate(zip(_groups(again), again.vehicles, strict=True)):
        own = all_methods if shared else all_methods[k : k + 1]
        flown = [method for method in own if methods is None or method in methods]
        for method in flown:
            samples = again.samples.filter(pl.col("method") == method)
            yield place.track(
                f"{name}_{method}",
                method,
                group,
                f"{words}; method {method}",
                *_estimate(motion, samples),
                samples,
            )
        if flown:
            position, attitude = motion.position_t_m, from_quaternions(motion.attitude_t_p)
            yield place.track(
                f"{name}_{TRUTH}" if shared else f"{name}_{TRUTH}_{own[0]}",
                TRUTH,
                "",
                f"{words}; truth" if shared else f"{words}; truth of the vehicle that {own[0]} steers",
                position,
                attitude,
                motion.velocity_p_mps,
                pl.DataFrame({"time_ns": again.time_ns}),
            )


def _estimate(motion: Motion, samples: pl.DataFrame) -> tuple[Floats, Rotation, Floats]:
    """Position, attitude and velocity: the truth less the error, true minus estimate, of the samples."""

    def error(quantity: str, axes: Sequence[str], unit: str) -> Floats:
        return samples.select(f"err_{quantity}_{axis}_{unit}" for axis in axes).to_numpy().astype(np.float64)

    misalignment = Rotation.from_rotvec(error("misalignment", _AXES, "rad"))
    return (
        motion.position_t_m - error("position", _AXES, "m"),
        misalignment.inv() * from_quaternions(motion.attitude_t_p),
        motion.velocity_p_mps - error("velocity", ("surge", "sway", "heave"), "mps"),
    )


class _Place:
    """Where a scenario is."""

    def __init__(self, scenario: Scenario) -> None:
        stated, simulation = scenario.environment, build_simulation(scenario)
        self._origin = Place(np.deg2rad(stated.latitude_deg), np.deg2rad(stated.longitude_deg), 0.0)
        self._environment = Environment(
            latitude_rad=simulation.latitude_rad, gravity_mps2=simulation.gravity_mps2, earth=stated.earth
        )
        self.words = place_words(stated.latitude_deg, stated.longitude_deg)

    def track(
        self,
        name: str,
        method: str,
        group: str,
        description: str,
        position_t_m: Floats,
        attitude_t_p: Rotation,
        velocity_p_mps: Floats,
        rows: pl.DataFrame,
    ) -> ExportTrack:
        """A track with the columns of a replay's samples before those of the campaign's."""
        geodetic = geodetic_of(position_t_m, self._origin)
        assert geodetic is not None
        angles = np.rad2deg(to_angles(level_axes(self._environment, position_t_m).inv() * attitude_t_p))
        placed = {
            ("north_m", "east_m", "down_m"): position_t_m,
            ("latitude_deg", "longitude_deg", "height_m"): geodetic,
            ("roll_deg", "pitch_deg", "yaw_deg"): angles,
            ("surge_mps", "sway_mps", "heave_mps"): velocity_p_mps,
        }
        columns = [
            pl.Series(column, values[:, k])
            for names, values in placed.items()
            for k, column in enumerate(names)
        ]
        of_time = rows.drop("trajectory", "run", "method", "time_ns", strict=False).get_columns()
        table = pl.DataFrame([rows["time_ns"], *columns, *of_time])
        rotation = attitude_t_p.as_matrix()
        return ExportTrack(
            name, method, group, description, table, position_t_m, geodetic, orientation_enu_flu(rotation)
        )


def _pings(motion: Motion) -> pl.DataFrame:
    """A row a ping, and which beams returned."""
    beams = {f"beam{k + 1}_valid": valid for k, valid in enumerate(motion.beam_valid.T)}
    return pl.DataFrame({"time_ns": motion.ping_ns, **beams})
