# %% [markdown]
# # A sensor of my own
#
# Two things that the package does not have: a DVL with five beams, one of them straight down, and a paddle-wheel log
# that measures the speed through the water. The first is a geometry, the second a row of a method.

# %%
import matplotlib.pyplot as plt
import numpy as np

import bottomlock
from bottomlock.own_method import Beams, Prior, Rows, register

tilt = np.deg2rad([20.0, 20.0, 20.0, 20.0, 0.0])
azimuth = np.deg2rad([45.0, 135.0, 225.0, 315.0, 0.0])
five = bottomlock.BeamGeometry.from_angles(tilt, azimuth)
five

# %% [markdown]
# One ping with beams 2, 3 and 4 lost: the vertical beam gives the heave, and what is left of beam 1 is a mixture of
# surge and sway. The answer has one component, and says so of the others.

# %%
beams = five.beam_velocities([[2.0, 0.1, 0.05]])
fixes = bottomlock.solve_velocity(
    five, beams, [[True, False, False, False, True]], method="plcf", beam_sd_mps=0.02
)
fixes.to_frame()

# %% [markdown]
# ## A paddle wheel beside one beam
#
# The readings of run 0 of a straight leg, with beam 1 alone, and a wheel that reads the true surge with a noise of 5
# cm/s (the water is still). A method of one's own holds the wheel's readings by time and adds a row to those of the
# beam.

# %%
scenario = bottomlock.load_scenario("straight").with_trajectory(duration_s=120.0)
scenario = scenario.replace({"dvl.beams_lost": [2, 3, 4]})
simulation = bottomlock.build_simulation(scenario)
truth = simulation.truth()
streams = bottomlock.sensor_streams(simulation, truth)
pings, imu = streams["beams"], streams["imu"]

rng = np.random.default_rng(1)
ping_ns = pings["time_ns"].to_numpy()
true_p_mps = truth.velocity_p_mps[np.searchsorted(truth.time_ns, ping_ns)]
WHEEL_SD_MPS = 0.05
wheel_mps = dict(
    zip(ping_ns.tolist(), true_p_mps[:, 0] + rng.normal(0.0, WHEEL_SD_MPS, len(ping_ns)), strict=True)
)


class BeamsAndWheel:
    """The valid beams, and the wheel's reading of that time as a measurement of the surge."""

    name = "beams_and_wheel"

    def ping(self, beams: Beams, prior: Prior) -> Rows:
        """The rows of the beams with one more."""
        rows = beams.rows
        surge = np.zeros((1, rows.jacobian.shape[1]))
        surge[0, 6] = 1.0
        noise = np.zeros((len(rows.residual) + 1,) * 2)
        noise[:-1, :-1] = rows.noise
        noise[-1, -1] = WHEEL_SD_MPS**2
        residual = wheel_mps[beams.time_ns] - prior.velocity_p_mps[0]
        return Rows(np.append(rows.residual, residual), np.vstack([rows.jacobian, surge]), noise)


register(BeamsAndWheel)


# %% mystnb={"image": {"alt": "Surge error against time: growing with one beam, near zero with the wheel"}}
def errors(method: str) -> np.ndarray:
    """Surge, sway and heave error after each ping, m/s."""
    navigator = bottomlock.Navigator(
        simulation.geometry,
        scenario.kernel_model(simulation.gravity_mps2),
        scenario.kernel_options(),
        {
            "time_ns": int(imu["time_ns"][0]),
            "position_t_m": truth.position_t_m[0],
            "attitude_t_p": truth.attitude_t_p[0],
            "velocity_p_mps": truth.velocity_p_mps[0],
        },
        method=method,
    )
    time_ns = imu["time_ns"].to_numpy()
    omega = imu.select(f"omega_{axis}_radps" for axis in "xyz").to_numpy()
    force = imu.select(f"force_{axis}_mps2" for axis in "xyz").to_numpy()
    velocity = pings.select(f"beam{k}_mps" for k in range(1, 5)).fill_null(0.0).to_numpy()
    valid = pings.select(f"beam{k}_valid" for k in range(1, 5)).to_numpy()
    found, start = [], 0
    for row, time in enumerate(ping_ns):
        stop = int(np.searchsorted(time_ns, time, side="right"))
        navigator.push_imu_block(
            time_ns[start:stop], omega_p_radps=omega[start:stop], force_p_mps2=force[start:stop]
        )
        navigator.push_beams(
            int(time), velocity[row], valid[row], sd_mps=np.full(4, scenario.dvl.beam_noise_mps)
        )
        found.append(true_p_mps[row] - navigator.state()["velocity_p_mps"])
        start = stop
    return np.array(found)


alone, helped = errors("tc"), errors("beams_and_wheel")
figure, axes = plt.subplots(figsize=(7.2, 3.4))
axes.plot(ping_ns / 1e9, alone[:, 0], label="one beam (tc)")
axes.plot(ping_ns / 1e9, helped[:, 0], "--", label="one beam and the wheel")
axes.set(xlabel="time, s", ylabel="surge error, m/s")
axes.legend()
plt.show()
for words, one in (("one beam", alone), ("one beam and the wheel", helped)):
    print(
        f"{words:24} surge, sway, heave error, RMS over time:", np.sqrt((one**2).mean(axis=0)).round(3), "m/s"
    )

# %% [markdown]
# The wheel fixes the surge, and the beam then measures a mixture of the other two. It does not say which: sway and
# heave drift together along what neither instrument measures, so that the whole error need not be smaller in each
# component. A depth sensor would settle the heave. Through the water and over ground are the same here; in a current
# the difference is an error that lasts, and belongs into the noise or into a state of its own
# ([sway_current](../docs/methods/sway_current.md)).
#
# A sensor for every scenario, replay and campaign is one file in the kernel: [Sensors](../docs/sensors.md).
