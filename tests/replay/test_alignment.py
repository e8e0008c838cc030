"""Alignment: what each source of level and heading makes of a known vehicle, and what it rejects."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.io.beams import read_geometry
from bottomlock.recordings.axes import from_angles, to_angles
from bottomlock.recordings.streams import Attitudes, Beams, Inertial, Positions
from bottomlock.replay.align import Alignment, align
from bottomlock.replay.case import Case, parse_case
from bottomlock.replay.model import imu_model
from bottomlock.replay.streams import Streams
from tests.oracle.mechanisation import earth_rate_tangent
from tests.oracle.rotations import Array, matrix_from_euler
from tests.replay.test_replay_case import LEAST
from tests.toml_text import toml

ROLL, PITCH, YAW, LATITUDE, GRAVITY = 0.05, -0.08, 2.0, 0.57, 9.8
SECTIONS = toml({
    "attitude": {"file": "a", "clock": {"column": "t"}, "roll": "r", "pitch": "p", "yaw": "y"},
    "gps": {"file": "g", "clock": {"column": "t"}, "north": "n", "east": "e"},
})  # fmt: skip


def case(start: str, *, gyro_bias: float = 0.01) -> Case:
    text = LEAST.replace('heading = "gyrocompass"', start).replace(
        "gyro_bias_deg_per_h = 3.0", f"gyro_bias_deg_per_h = {gyro_bias}"
    )
    return parse_case(text + SECTIONS, place="case")


def at_rest(seconds: float = 200.0, rate_hz: float = 10.0, rate_noise: float = 0.0) -> Streams:
    """A vehicle at rest that reads gravity and the Earth's rate, with GPS and attitude."""
    R = matrix_from_euler(ROLL, PITCH, YAW)
    count = int(seconds * rate_hz)
    time_ns = np.arange(count, dtype=np.int64) * round(1e9 / rate_hz)
    force = np.tile(R.T @ np.array([0.0, 0.0, -GRAVITY]), (count, 1))
    omega = np.tile(R.T @ earth_rate_tangent(LATITUDE), (count, 1))
    omega = omega + np.random.default_rng(4).standard_normal((count, 3)) * rate_noise
    geometry = read_geometry("x_janus_20")
    beams = geometry.geometry.beam_velocities([[1.5, 0.2, -0.1]])
    along = np.outer(time_ns * 1e-9 * 2.0, [np.cos(YAW), np.sin(YAW), 0.0])
    return Streams(
        inertial=Inertial(time_ns, force, omega),
        beams=Beams(time_ns[-5:-4], beams, np.ones((1, 4), dtype=bool), np.full((1, 4), 0.02)),
        instrument=geometry,
        aiding={
            "attitude": Attitudes(
                time_ns, from_angles(np.full(count, 0.01), np.full(count, 0.02), np.full(count, 0.03))
            ),
            "gps": Positions(time_ns, along),
        },
        reference=None,
        origin=None,
        latitude_rad=LATITUDE,
    )


def aligned(start: str, streams: Streams | None = None, **settings: float) -> Alignment:
    given = case(f"{start}\nat_s = 199.6\nwindow_s = 150.0", **settings)
    return align(given, at_rest() if streams is None else streams, imu_model(given), GRAVITY)


def angles(found: Alignment) -> Array:
    return to_angles(found.attitude)


def test_levelling_and_gyrocompass_find_a_vehicle_at_rest() -> None:
    found = aligned('heading = "gyrocompass"')
    np.testing.assert_allclose(angles(found), [ROLL, PITCH, YAW], atol=1e-9)
    # 0.01 deg/h of gyro bias on 15 deg/h cos(latitude), and 0.5 mg of accelerometer bias.
    horizontal = 7.292115e-5 * np.cos(LATITUDE)
    assert found.attitude_sd_rad[2] == pytest.approx(np.deg2rad(0.01) / 3600 / horizontal, rel=1e-9)
    assert found.attitude_sd_rad[0] == pytest.approx(0.5e-3 * 9.80665 / GRAVITY, rel=1e-9)


def test_recorded_attitude_and_given() -> None:
    np.testing.assert_allclose(
        angles(aligned('heading = "attitude"\nlevel = "attitude"')), [0.01, 0.02, 0.03], atol=1e-12
    )
    given = 'heading = "given"\nheading_deg = 45.0\nheading_sd_deg = 2.0\nlevel = "given"\n'
    given += "roll_deg = 1.0\nlevel_sd_deg = 0.5"
    found = aligned(given)
    np.testing.assert_allclose(angles(found), np.deg2rad([1.0, 0.0, 45.0]), atol=1e-12)
    np.testing.assert_allclose(found.attitude_sd_rad, np.deg2rad([0.5, 0.5, 2.0]))


def test_velocity_of_the_last_ping() -> None:
    found = aligned('heading = "gyrocompass"\nvelocity = "beams"\nvelocity_sd_mps = [0.03, 0.03, 0.03]')
    np.testing.assert_allclose(found.velocity_p_mps, [1.5, 0.2, -0.1], atol=1e-12)
    assert (found.velocity_sd_mps > 0.03).all()


def test_stated_deviation_is_the_scatter_of_the_heading() -> None:
    """Gyro noise: over 40 dives the headings scatter as stated, to a factor that chance passes in 1 of 1000 tries."""
    errors = []
    noise, stated = 2e-6, 0.0
    given = case('heading = "gyrocompass"\nat_s = 199.6\nwindow_s = 150.0', gyro_bias=0.0)
    for seed in range(40):
        streams = at_rest()
        shaken = (
            streams.inertial.omega_p_radps + np.random.default_rng(seed).standard_normal((2000, 3)) * noise
        )
        found = align(
            given,
            replace(streams, inertial=replace(streams.inertial, omega_p_radps=shaken)),
            imu_model(given),
            GRAVITY,
        )
        errors.append(angles(found)[2] - YAW)
        stated += found.attitude_sd_rad[2] / 40
    # The largest of three axes' scatter is stated: never less than the truth on average, and not twice as much.
    assert 0.5 * stated < np.std(errors) < 1.3 * stated


def aided(of: Streams, **aids: Any) -> Streams:  # noqa: ANN401 - a stream of readings
    return replace(of, aiding=dict(of.aiding) | aids)


REST = at_rest()
SILENT = Attitudes(REST.inertial.time_ns[:100], from_angles(np.zeros(100), 0.0, 0.0))
TURNING = replace(REST.inertial, omega_p_radps=REST.inertial.omega_p_radps + 0.01)
DEAF = replace(REST.beams, valid=np.array([[True, True, False, False]]))


@pytest.mark.parametrize(
    ("start", "streams", "gyro_bias", "message"),
    [
        ('heading = "gyrocompass"', REST, 30.0, "the gyros are not accurate"),
        ('heading = "gyrocompass"', replace(REST, inertial=TURNING), 0.01, "the vehicle must be at rest"),
        ('heading = "attitude"', aided(REST, attitude=SILENT), 0.01, r"\[attitude\] has no row in the 1 s before the"),
        ('heading = "gyrocompass"\nvelocity = "beams"', replace(REST, beams=DEAF), 0.01, "has too few valid beams"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(start: str, streams: Streams, gyro_bias: float, message: str) -> None:
    with pytest.raises(DataError, match=message):
        aligned(start, streams, gyro_bias=gyro_bias)


def test_start_before_its_window_is_refused() -> None:
    given = case('heading = "gyrocompass"\nat_s = 5.0\nwindow_s = 10.0')
    with pytest.raises(DataError, match="averages the readings before the start"):
        align(given, at_rest(), imu_model(given), GRAVITY)
