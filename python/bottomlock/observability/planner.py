"""Which short manoeuvre makes which state observable, and how well: predicted by covariance analysis."""

from collections.abc import Iterable, Mapping
from typing import Any

import polars as pl

from bottomlock.kernel import BeamGeometry
from bottomlock.observability.analysis import Aiding, Finding, Kind, deviations, observe
from bottomlock.observability.schedule import Schedule
from bottomlock.tables.check import check
from bottomlock.tables.observability import PLAN
from bottomlock.truth.manoeuvres import MANOEUVRES, Manoeuvre, manoeuvre_truth


def plan(
    geometry: BeamGeometry,
    aiding: Aiding,
    model: Mapping[str, Any],
    *,
    manoeuvres: Iterable[Manoeuvre] = tuple(MANOEUVRES.values()),
    kind: Kind = "full",
    period_s: float = 1.0,
    rates_hz: Mapping[str, float] | None = None,
    rate_hz: float = 50.0,
) -> pl.DataFrame:
    """Every state after every manoeuvre: observable or not, and the standard deviation that the filter would claim.

    Args:
        geometry: the beams.
        aiding: the beams that return and what else aids.
        model: sensor errors and environment in SI (`Scenario.kernel_model`): where the filter starts from.
        manoeuvres: what may be flown.
        kind: "full", or "inertial" for a filter that does not estimate the DVL's errors.
        period_s: interval between measurements, all sensors at once.
        rates_hz: in place of the period a rate for each sensor, "beams" among them (`Schedule.regular`).
        rate_hz: rate at which the motion is sampled.

    Returns:
        `tables.observability.PLAN`, manoeuvres in their order, states in the filter's.

    Raises:
        KernelError: for an empty aiding set or a model that makes no sense.

    Examples:
        Two beams of a straight course leave a vehicle's sideways velocity in the dark; an eight shows it:

        >>> from bottomlock.config.scenario import load_scenario
        >>> model = load_scenario("straight").kernel_model(9.8125)
        >>> table = plan(BeamGeometry.janus(0.35), Aiding(beams=(1, 2)), model)
        >>> sway = table.filter(state="velocity y")
        >>> best(sway)["manoeuvre"].to_list()
        ['figure_eight']
    """
    environment = model["environment"]
    frames = []
    for manoeuvre in manoeuvres:
        truth = manoeuvre_truth(
            manoeuvre,
            rate_hz=rate_hz,
            latitude_rad=environment["latitude_rad"],
            gravity_mps2=environment["gravity_mps2"],
            earth_rate_radps=environment["earth_rate_radps"],
        )
        measured: Any = {"kind": kind, "period_s": period_s}
        if rates_hz is not None:
            measured["schedule"] = Schedule.regular(truth.time_ns, geometry.beams, rates_hz)
        (found,) = observe(
            truth, geometry, [aiding], earth_rate_radps=environment["earth_rate_radps"], **measured
        )
        history = deviations(truth, geometry, aiding, dict(model), **measured)
        count = len(found.states)
        before, after = _initial_sd(model)[:count], history.sd[-1, :count]
        frames.append(
            pl.DataFrame(
                {
                    "manoeuvre": [manoeuvre.name] * count,
                    "aiding": [aiding.name] * count,
                    "state": found.states,
                    "verdict": [_word(found, k) for k in range(count)],
                    "sd_before": before,
                    "sd_after": after,
                    "fraction_left": [a / b if b > 0.0 else None for a, b in zip(after, before, strict=True)],
                },
                schema=dict(PLAN),
            )
        )
    return pl.concat(frames)


def best(table: pl.DataFrame) -> pl.DataFrame:
    """For each state the manoeuvre that leaves the smallest deviation: `tables.observability.PLAN`."""
    check(table, PLAN, place="plan")
    return table.filter(pl.col("sd_after") == pl.col("sd_after").min().over("state")).unique(
        "state", keep="first", maintain_order=True
    )


def _word(found: Finding, state: int) -> str:
    if not found.decided:
        return "undecided"
    return "observable" if found.states[state] in found.observable_states else "hidden"


def _initial_sd(model: Mapping[str, Any]) -> list[float]:
    """Standard deviations of the 20 states at the start."""
    initial, imu, dvl = model["initial"], model["imu"], model["dvl"]
    return [
        *initial["position_sd_m"],
        *initial["attitude_sd_rad"],
        *initial["velocity_sd_mps"],
        *[imu["accel_bias_sd_mps2"]] * 3,
        *[imu["gyro_bias_sd_radps"]] * 3,
        *[dvl["beam_bias_sd_mps"]] * 4,
        dvl["scale_factor_sd"],
    ]
