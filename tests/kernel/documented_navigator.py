"""The example of docs/settings.md: `make lint` checks its types, tests/kernel/test_documented.py runs it."""

# The documented example begins.
import numpy as np

import bottomlock

model = bottomlock.Model(
    environment=bottomlock.Environment(latitude_rad=0.57),  # with normal gravity
    imu=bottomlock.ImuModel(
        accel_noise_mps_rts=1e-4,
        gyro_noise_rad_rts=1e-5,
        accel_bias_sd_mps2=5e-4,
        gyro_bias_sd_radps=2.4e-7,
        accel_bias_walk_mps2_rts=1e-6,
        gyro_bias_walk_radps_rts=1e-9,
    ),
    dvl=bottomlock.DvlModel(
        beam_noise_sd_mps=0.02,
        beam_bias_sd_mps=0.005,
        beam_bias_walk_mps_rts=5e-5,
        scale_factor_sd=0.003,
        scale_factor_walk_rts=1e-6,
    ),
    initial=bottomlock.InitialModel(
        position_sd_m=[2.0, 2.0, 2.0],
        attitude_sd_rad=[0.001, 0.001, 0.01],
        velocity_sd_mps=[0.05, 0.05, 0.05],
    ),
    depth=bottomlock.DepthModel(sd_m=0.02, bias_sd_m=0.3, bias_time_s=21_600.0),
    magnetometer=bottomlock.MagnetometerModel(yaw_sd_rad=0.03, roll_pitch_sd_rad=0.005),
    gps=bottomlock.GpsModel(position_sd_m=[2.0, 2.0, 4.0], velocity_sd_mps=[0.1, 0.1, 0.2]),
)
gravity = model.environment.gravity_mps2
options = bottomlock.Options(levers=bottomlock.Levers(depth_p_m=[0.5, 0.0, 0.0]))
initial = bottomlock.InitialState(
    time_ns=0, position_t_m=[0, 0, 20], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[2, 0, 0]
)
janus = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
navigator = bottomlock.Navigator(janus, model, options, initial, method="tc")

valid = np.array([True, True, False, False])
for step in range(1001):
    time_ns = step * 10_000_000
    navigator.push_imu(time_ns, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -gravity])
    if step % 100 == 50:
        beams_mps = janus.beam_velocities([[2.0, 0.0, 0.0]])[0]
        for report in navigator.push_beams(time_ns, beams_mps, valid, sd_mps=np.full(4, 0.02)):
            assert report.verdict == "accepted"
velocity_p_mps = navigator.state()["velocity_p_mps"]
