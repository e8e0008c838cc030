"""Units that cannot be meant: the likely mistake is named, and what may be true is taken."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock import kernel
from bottomlock.audit.logs import read_log
from bottomlock.config.scenario import load_scenario
from bottomlock.errors import DataError, ScenarioError
from bottomlock.files.table_file import read_table_file
from bottomlock.io.beams import Columns, read_geometry, read_times
from bottomlock.kernel import BeamGeometry, KernelError, Method
from bottomlock.recordings.sensors import SENSORS, Sensor
from tests.kernel.test_models import JANUS, LOG, MODEL, OPTIONS, STATE

EFFORT = {"mass_kg": [20.0, 20.0, 30.0], "linear_drag_kg_per_s": [14.0, 0.0, 33.0]}


def navigator(method: Method = "tc") -> kernel.Navigator:
    return kernel.Navigator(JANUS, MODEL, OPTIONS, STATE.replace(velocity_p_mps=[0, 0, 0]), method=method)


def test_angles_in_degrees_are_named() -> None:
    with pytest.raises(KernelError, match=r"tilt_rad is 20, expected less than pi/2: is it in degrees\?"):
        BeamGeometry.janus(20.0)
    with pytest.raises(KernelError, match=r"azimuth_rad is 45, .*degrees\?"):
        BeamGeometry.from_angles([0.3, 0.3], [45.0, 135.0])
    with pytest.raises(KernelError, match=r"mounting_rpy_rad has 45, .*degrees\?"):
        BeamGeometry.janus(0.35, mounting_rpy_rad=[0.0, 0.0, 45.0])
    # A vertical beam, a horizontal one but a hair, and an azimuth counted the other way round.
    assert BeamGeometry.from_angles([0.0, 1.57], [0.0, -6.0]).beams == 2


def test_a_tilt_in_radians_is_named(tmp_path: Path) -> None:
    text = 'configuration = "x"\ntilt_deg = 0.349\nbeam_noise_mps = 0.01\n'
    (tmp_path / "dvl.toml").write_text(text)
    with pytest.raises(
        ScenarioError, match=r"tilted by 0.349 deg at most, expected 2 deg or more: is it in radians"
    ):
        read_geometry(tmp_path / "dvl.toml")
    angles = 'configuration = "angles"\ntilts_deg = {}\nazimuths_deg = [0, 120, 240]\nbeam_noise_mps = 0.01\n'
    (tmp_path / "dvl.toml").write_text(angles.format("[0.4, 0.4, 0.4]"))
    with pytest.raises(ScenarioError, match="is it in radians"):
        read_geometry(tmp_path / "dvl.toml")
    # One vertical beam beside tilted ones is an instrument.
    (tmp_path / "dvl.toml").write_text(angles.format("[25.0, 25.0, 0.0]"))
    assert read_geometry(tmp_path / "dvl.toml").geometry.beams == 3
    with pytest.raises(ScenarioError, match=r"dvl.tilt_deg.*is it in radians"):
        load_scenario("straight").replace({"dvl.tilt_deg": 0.349})


@pytest.mark.parametrize("speed_mps", [300.0, -989_855.0])
def test_beams_faster_than_any_vehicle_are_refused(speed_mps: float) -> None:
    """By the navigator, by a replay and by a fix; 49 m/s is left to the gate."""
    readings = np.array([0.0, 0.0, speed_mps, 0.0])
    valid, sd = np.ones(4, dtype=bool), np.full(4, 0.05)
    made = navigator()
    made.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0, 0, -9.8])
    before = made.covariance()
    with pytest.raises(
        KernelError, match=r"beam 3 .* velocity is .*, expected less than 50 m/s: is it in mm/s"
    ):
        made.push_beams(0, readings, valid, sd_mps=sd)
    assert np.array_equal(made.covariance(), before)
    made.push_beams(0, np.where(readings == 0.0, 0.0, 49.0), valid, sd_mps=sd)
    with pytest.raises(KernelError, match="dvl row 0: beam 3"):
        replayed(beam_velocity_mps=readings[None])
    with pytest.raises(KernelError, match="row 0: beam 3"):
        kernel.solve_velocity(JANUS, readings[None], valid[None], method="lc", beam_sd_mps=0.05)
    # A beam that is not valid may hold any code.
    kernel.solve_velocity(JANUS, readings[None], readings[None] == 0.0, method="lc", beam_sd_mps=0.05)


def replayed(**changed: Any) -> Any:  # noqa: ANN401 - the kernel's dict
    log: Any = LOG | changed
    return kernel.replay_log(
        JANUS, MODEL, OPTIONS, ["tc"], log, STATE, sample_time_ns=np.array([log["imu_time_ns"][-1]])
    )


def test_angles_and_deviations_in_other_units_are_refused() -> None:
    """In degrees or mm/s; a turn and half a turn are taken."""
    made = navigator()
    made.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0, 0, -9.8])
    before = made.covariance()
    with pytest.raises(KernelError, match=r"yaw_rad .*4.5e1, .*is it in degrees\?"):
        made.push_heading(0, 45.0, sd_rad=0.01)
    with pytest.raises(KernelError, match=r"heading sd_rad .*5.*is it in degrees\?"):
        made.push_heading(0, 0.0, sd_rad=5.0)
    with pytest.raises(KernelError, match=r"attitude yaw_sd_rad .*5.*is it in degrees\?"):
        made.push_attitude(0, [1.0, 0.0, 0.0, 0.0], roll_pitch_sd_rad=0.01, yaw_sd_rad=5.0)
    with pytest.raises(KernelError, match=r"attitude roll_pitch_sd_rad .*5.*is it in degrees\?"):
        made.push_attitude(0, [1.0, 0.0, 0.0, 0.0], roll_pitch_sd_rad=5.0, yaw_sd_rad=0.01)
    with pytest.raises(
        KernelError, match=r"beam 1 .*standard deviation is 20, expected at most 10 m/s: is it in mm/s"
    ):
        made.push_beams(0, np.zeros(4), np.ones(4, dtype=bool), sd_mps=np.full(4, 20.0))
    assert np.array_equal(made.covariance(), before)
    made.push_heading(0, 2 * np.pi, sd_rad=np.pi)


def test_a_masked_beam_is_a_lost_beam() -> None:
    """Masked in the velocity, the flag or the deviation: the same as a flag that is cleared."""
    readings = np.array([0.1, 0.1, 30.0, 0.1])
    flags, sd = np.ones(4, dtype=bool), np.full(4, 0.05)
    lost = np.array([True, True, False, True])
    mask = ~lost
    expected = _after_ping(readings, lost, sd)
    ma = np.ma.masked_array
    for ping in (
        (ma(readings, mask), flags, sd),
        (readings, ma(flags, mask), sd),
        (readings, flags, ma(sd, mask)),
    ):
        assert np.array_equal(_after_ping(*ping), expected)
    fix = kernel.solve_velocity(JANUS, ma(readings, mask)[None], flags[None], method="lc", beam_sd_mps=0.05)
    assert fix.beams_used.tolist() == [lost.tolist()]
    out = replayed(beam_velocity_mps=ma(readings, mask)[None])
    assert np.isnan(out["beam_weight"][0, 0]).tolist() == mask.tolist()


def _after_ping(velocity: Any, valid: Any, sd: Any) -> Any:  # noqa: ANN401 - arrays of any kind
    made = navigator()
    made.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0, 0, -9.8])
    made.push_beams(0, velocity, valid, sd_mps=sd)
    return made.covariance()


def test_a_masked_element_elsewhere_is_named() -> None:
    force = np.ma.masked_array([0.0, 0.0, -9.8], [False, False, True])
    with pytest.raises(KernelError, match=r"force_p_mps2\[2\] is masked"):
        navigator().push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=force)
    rows = np.ma.masked_array(LOG["force_p_mps2"], np.zeros((150, 3), dtype=bool))
    replayed(force_p_mps2=rows)
    rows[7, 1] = np.ma.masked
    with pytest.raises(KernelError, match=r"log.force_p_mps2\[7, 1\] is masked"):
        replayed(force_p_mps2=rows)


def test_nulls_of_polars_are_not_numbers() -> None:
    made = navigator()
    made.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0, 0, -9.8])
    null = pl.Series([0.1, None, 0.1, 0.1])
    with pytest.raises(KernelError, match=r"beam 2 .* flag a lost beam invalid"):
        made.push_beams(0, null, np.ones(4, dtype=bool), sd_mps=np.full(4, 0.05))
    with pytest.raises(KernelError, match="valid has dtype"):
        made.push_beams(0, np.zeros(4), pl.Series([True, None, True, True]), sd_mps=np.full(4, 0.05))


@pytest.mark.parametrize("step", [200, 200_000])
def test_pings_in_milli_and_microseconds_are_named(step: int, tmp_path: Path) -> None:
    """By `fix` and `audit`, which have no filter that would refuse them; 5 Hz in nanoseconds is taken."""
    beams = {f"beam{k}_mps": 0.1 * np.arange(20) for k in range(1, 5)}
    flags = {f"beam{k}_valid": np.ones(20, dtype=bool) for k in range(1, 5)}
    for factor, fails in ((1, True), (200_000_000 // step, False)):
        frame = pl.DataFrame({"time_ns": np.arange(20) * step * factor} | beams | flags)
        frame.write_csv(tmp_path / "log.csv")
        for read in (read_log, lambda path: read_times(read_table_file(path), Columns(), str(path))):
            if fails:
                with pytest.raises(
                    DataError, match=rf"rises by {step} ns a row .*is it in micro- or milliseconds"
                ):
                    read(tmp_path / "log.csv")
            else:
                read(tmp_path / "log.csv")


@pytest.mark.parametrize("sensor", SENSORS[:-1], ids=lambda sensor: sensor.name)
def test_every_number_of_a_section_reaches_the_kernel(sensor: Sensor) -> None:
    """The kernel's default would stand for a key that none of its settings is named like.

    What makes a speed of revolutions or forces reaches it with the readings (tests/recordings/test_drives.py).
    """
    made = {"advance_m", "buoyancy_n"}
    needed: dict[str, Any] = {"depth": {"sd_m": 0.1}, "thrust": {"advance_m": 0.1}, "effort": EFFORT}
    section = sensor.settings(**needed.get(sensor.name, {}))
    for key, value in section:
        if (
            isinstance(value, float)
            and not key.startswith("mounting")
            and key not in made | {"yaw_offset_deg"}
        ):
            other = section.model_copy(update={key: value + 0.25})
            assert other.kernel_models() != section.kernel_models(), key
