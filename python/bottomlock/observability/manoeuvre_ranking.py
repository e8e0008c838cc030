"""Ranking of short manoeuvres: which states each makes observable, and how well, by covariance analysis."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import polars as pl

from bottomlock.kernel import BeamGeometry
from bottomlock.kernel.models import DvlModel, Model
from bottomlock.observability.analysis import Aiding, Finding, Kind, deviations, observe
from bottomlock.observability.schedule import Schedule
from bottomlock.tables.observability import MANOEUVRE_RANKING
from bottomlock.truth.manoeuvres import MANOEUVRES, Manoeuvre, manoeuvre_truth


def manoeuvre_ranking(
    geometry: BeamGeometry,
    aiding: Aiding,
    model: Model,
    *,
    manoeuvres: Iterable[Manoeuvre] = tuple(MANOEUVRES.values()),
    kind: Kind = "full",
    period_s: float = 1.0,
    rates_hz: Mapping[str, float] | None = None,
    rate_hz: float = 50.0,
) -> pl.DataFrame:
    """Every state after every manoeuvre: observable or not, and the filter's predicted standard deviation.

    Args:
        geometry: the beams.
        aiding: the beams that return and what else aids.
        model: sensor errors, initial deviations and environment in SI (`Scenario.kernel_model`).
        manoeuvres: the candidates.
        kind: "full", or "inertial" for a filter that does not estimate the DVL's errors.
        period_s: interval between measurements, all sensors at once.
        rates_hz: in place of the period a rate for each sensor, "beams" among them (`Schedule.regular`).
        rate_hz: rate at which the motion is sampled.

    Returns:
        `tables.observability.MANOEUVRE_RANKING`, manoeuvres in their order, states in the filter's.

    Raises:
        KernelError: for an empty aiding set, or a model with a value out of range.

    Examples:
        With two beams sway is unobservable on a straight course; a figure of eight makes it observable:

        >>> from bottomlock.config.scenario import load_scenario
        >>> model = load_scenario("straight").kernel_model(9.8125)
        >>> table = manoeuvre_ranking(BeamGeometry.janus(0.35), Aiding(beams=(1, 2)), model)
        >>> table.filter(state="velocity y").sort("sd_after")["manoeuvre"][0]
        'figure_eight'
    """
    environment = model.environment
    earth_rate_radps = environment.earth_rate_radps
    initial_sd, frames = np.array(_initial_sd(model)), []
    for manoeuvre in manoeuvres:
        truth = manoeuvre_truth(
            manoeuvre,
            rate_hz=rate_hz,
            latitude_rad=environment.latitude_rad,
            gravity_mps2=environment.gravity_mps2,
            earth_rate_radps=earth_rate_radps,
        )
        settings: dict[str, Any] = {"kind": kind, "period_s": period_s}
        if rates_hz is not None:
            settings["schedule"] = Schedule.regular(truth.time_ns, geometry.beams, rates_hz)
        (found,) = observe(truth, geometry, [aiding], earth_rate_radps=earth_rate_radps, **settings)
        history = deviations(truth, geometry, aiding, model, **settings)
        count = len(found.states)
        columns = {
            "state": found.states,
            "verdict": [_word(found, k) for k in range(count)],
            "sd_before": initial_sd[:count],
            "sd_after": history.sd[-1, :count],
        }
        frames.append(
            pl.DataFrame(columns)
            .with_columns(
                manoeuvre=pl.lit(manoeuvre.name),
                aiding=pl.lit(aiding.name),
                fraction_left=pl.when(pl.col("sd_before") > 0.0).then(
                    pl.col("sd_after") / pl.col("sd_before")
                ),
            )
            .select(list(MANOEUVRE_RANKING))
        )
    return pl.concat(frames)


def _word(found: Finding, state: int) -> str:
    if not found.decided:
        return "undecided"
    return "observable" if found.states[state] in found.observable_states else "unobservable"


def _initial_sd(model: Model) -> list[float]:
    """Standard deviations of the 20 states at the start."""
    initial, imu, dvl = model.initial, model.imu, model.of(DvlModel)
    return [
        *initial.position_sd_m,
        *initial.attitude_sd_rad,
        *initial.velocity_sd_mps,
        *[imu.accel_bias_sd_mps2] * 3,
        *[imu.gyro_bias_sd_radps] * 3,
        *[dvl.beam_bias_sd_mps] * 4,
        dvl.scale_factor_sd,
    ]
