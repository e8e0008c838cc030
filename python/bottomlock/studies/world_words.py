"""The errors and settings of the scenarios of a study in sentences, and the limits that follow from them."""

from collections.abc import Callable, Sequence

from bottomlock.config.mission_sections import CurrentTable
from bottomlock.config.scenario import Scenario
from bottomlock.config.sensors import SENSORS


def settings(scenarios: Sequence[Scenario]) -> list[str]:
    """Sensors, water, gate and beam tests, a sentence each; where scenarios differ, one for each of them."""
    return [_of_all(words, scenarios) for words in (_inertial, _dvl, _others, _water, _gate, _beam_tests)]


def limits(scenarios: Sequence[Scenario]) -> list[str]:
    """What follows from them for the reading of a study."""
    return [_of_all(words, scenarios) for words in (_error_limits, _sway_limits, _gate_limits, _nis_limits)]


def _of_all(words: Callable[[Scenario], str], scenarios: Sequence[Scenario]) -> str:
    said: dict[str, list[str]] = {}
    for scenario in scenarios:
        said.setdefault(words(scenario), []).append(scenario.name)
    if len(said) == 1:
        return next(iter(said))
    return " ".join(f"{', '.join(names)}: {text}" for text, names in said.items())


def _inertial(scenario: Scenario) -> str:
    imu = scenario.imu
    return (
        f"Inertial sensors, 1 sigma: bias {imu.accel_bias_mg:g} mg and {imu.gyro_bias_deg_per_h:g} °/h, random walk "
        f"{imu.accel_noise_mps_per_rt_h:g} m/s/√h and {imu.gyro_noise_deg_per_rt_h:g} °/√h."
    )


def _dvl(scenario: Scenario) -> str:
    dvl = scenario.dvl
    outliers = "No beam has outliers."
    if dvl.outlier_fraction:
        outliers = (
            f"{100 * dvl.outlier_fraction:g} % of the readings of each beam are outliers with {dvl.outlier_factor:g} "
            "times the noise, which the filter does not model."
        )
    return (
        f"DVL: beam noise {1e3 * dvl.beam_noise_mps:g} mm/s, bias {1e3 * dvl.beam_bias_mps:g} mm/s, scale factor "
        f"{dvl.scale_factor_percent:g} %, {dvl.rate_hz:g} Hz. {outliers}"
    )


def _enabled(scenario: Scenario) -> list[str]:
    return [sensor.name for sensor in SENSORS if getattr(scenario, sensor.name).enabled]


def _others(scenario: Scenario) -> str:
    found = [f"`{name}` at {getattr(scenario, name).rate_hz:g} Hz" for name in _enabled(scenario)]
    return f"Further sensors: {', '.join(found) or 'none'}."


def _current(scenario: Scenario) -> CurrentTable:
    return CurrentTable.model_validate(scenario.mission.get("current", {}))


def _water(scenario: Scenario) -> str:
    current = _current(scenario)
    if current == CurrentTable():
        return "The water is still."
    wander = ""
    if current.wander_sd_mps:
        wander = f", varying by {current.wander_sd_mps:g} m/s in {current.wander_time_s:g} s"
    return (
        f"Current: {current.speed_mps:g} m/s towards {current.towards_deg:g}°{wander}; the same in all runs."
    )


def _gate(scenario: Scenario) -> str:
    gate, after = scenario.filter.gate, scenario.filter.inflate_after_rejections
    if gate == "off":
        return "No gate."
    rows = "the whole fix" if gate == "joint" else "each row"
    inflated = (
        f"the covariance is inflated after {after} rejected fixes in a row" if after else "never inflated"
    )
    return f"Gate: {rows} at {100 * scenario.filter.gate_probability:g} %, {inflated}."


def _beam_tests(scenario: Scenario) -> str:
    robust = scenario.robust
    if not robust.enabled:
        return "Single beams are not tested, and their noise is taken as Gaussian."
    gates = [
        f"{name} at {100 * gate:g} %"
        for name, gate in (("closure", robust.closure_gate), ("single beams", robust.beam_gate))
        if gate != "off"
    ]
    tail = {
        "gaussian": "Gaussian",
        "student_t": f"Student's t with {robust.student_t_degrees:g} degrees of freedom",
        "huber": f"Huber's with a threshold of {robust.huber_threshold:g}",
    }[robust.tail]
    return f"Beams are tested before a method uses them ({', '.join(gates) or 'no gate'}); tail of their noise: {tail}."


def _error_limits(scenario: Scenario) -> str:
    if scenario.dvl.outlier_fraction:
        return (
            "The simulated sensors have the errors that the filter assumes, and outliers among the beams beside them. "
            "An instrument with other errors, latency or a wrong alignment is a different case."
        )
    return (
        "The simulated sensors have exactly the errors that the filter assumes. An instrument with other errors, "
        "outliers, latency or a wrong alignment is a different case."
    )


def _sway_limits(scenario: Scenario) -> str:
    if _current(scenario) == CurrentTable():
        return "The water is still. Methods that assume zero sway are worse in a current."
    return (
        "Methods that assume zero sway over ground (`nsv`, `elc`, `weak_sway`) are wrong by the current across. It is "
        "the same in all runs: the bands do not cover other currents."
    )


def _gate_limits(scenario: Scenario) -> str:
    if scenario.filter.gate == "off":
        return "There is no gate: no fix is rejected."
    after = scenario.filter.inflate_after_rejections
    if after:
        return (
            f"The gate is on and re-opens: after {after} rejected fixes in a row the covariance grows to what they "
            "showed. The NIS includes the rejected fixes."
        )
    return (
        "The gate is on and does not re-open: a method that rejects its own fixes continues without them. Its NIS "
        "includes the rejected fixes."
    )


def _nis_limits(scenario: Scenario) -> str:
    if not scenario.robust.enabled:
        return "The NIS is that of every beam that returned."
    return (
        "The NIS is that of the beams that remain after the tests, with their noise as weighted. It is not exactly "
        "chi-squared with the number of rows, and with a heavy tail it is below it."
    )
