# %% [markdown]
# # A live loop with late data
#
# On a vehicle a ping arrives when its sound is back and its bytes are through; an acoustic position (USBL) arrives
# when the ship has computed it and sent it down. Both come after inertial readings that are newer. `Navigator` takes
# every sample at its time of validity. This page runs the same readings three times: in order; with pings 0.4 s and
# positions 1.5 s late; and late again, but stamped on arrival, as a naive driver would.

# %%
import matplotlib.pyplot as plt
import numpy as np

import bottomlock

scenario = bottomlock.load_scenario("figure_eight").with_trajectory(duration_s=60.0)
scenario = scenario.replace({"dvl.beams_lost": [3, 4], "acoustic_position.enabled": True})
simulation = bottomlock.build_simulation(scenario)
truth = simulation.truth()
streams = bottomlock.sensor_streams(simulation, truth)
imu, pings, fixes = streams["imu"], streams["beams"], streams["acoustic_position"]

imu_ns, ping_ns, fix_ns = (table["time_ns"].to_numpy() for table in (imu, pings, fixes))
omega = imu.select(f"omega_{axis}_radps" for axis in "xyz").to_numpy()
force = imu.select(f"force_{axis}_mps2" for axis in "xyz").to_numpy()
beam_mps = pings.select(f"beam{k}_mps" for k in range(1, 5)).fill_null(0.0).to_numpy()
beam_valid = pings.select(f"beam{k}_valid" for k in range(1, 5)).to_numpy()
fix_m = fixes.select(f"position_{axis}_m" for axis in ("north", "east", "down")).to_numpy()
beam_sd_mps = np.full(4, scenario.dvl.beam_noise_mps)
print(
    f"{len(imu_ns)} inertial readings, {len(ping_ns)} pings of two beams and {len(fix_ns)} positions in 60 s"
)


# %%
def loop(
    ping_late_s: float, fix_late_s: float, *, stamped_on_arrival: bool = False
) -> tuple[bottomlock.Navigator, np.ndarray]:
    """The driver's loop: samples in the order of arrival. Returns the navigator and its position error each second."""
    navigator = bottomlock.Navigator(
        simulation.geometry,
        scenario.kernel_model(simulation.gravity_mps2),
        scenario.kernel_options(),
        {
            "time_ns": int(imu_ns[0]),
            "position_t_m": truth.position_t_m[0],
            "attitude_t_p": truth.attitude_t_p[0],
            "velocity_p_mps": truth.velocity_p_mps[0],
        },
        horizon_ns=2_000_000_000,
    )
    arrivals = sorted(
        [(int(time), 0, row) for row, time in enumerate(imu_ns)]
        + [(int(time + 1e9 * ping_late_s), 1, row) for row, time in enumerate(ping_ns)]
        + [(int(time + 1e9 * fix_late_s), 2, row) for row, time in enumerate(fix_ns)]
    )
    errors = []
    for arrival_ns, kind, row in arrivals:
        if kind == 0:
            navigator.push_imu(int(imu_ns[row]), omega_p_radps=omega[row], force_p_mps2=force[row])
            if row % 150 == 75:
                errors.append(truth.position_t_m[row] - navigator.state()["position_t_m"])
        elif kind == 1:
            time = arrival_ns if stamped_on_arrival else int(ping_ns[row])
            navigator.push_beams(time, beam_mps[row], beam_valid[row], sd_mps=beam_sd_mps)
        else:
            time = arrival_ns if stamped_on_arrival else int(fix_ns[row])
            navigator.push_acoustic_position(time_ns=time, position_t_m=fix_m[row])
    return navigator, np.array(errors)


in_order, errors_in_order = loop(0.0, 0.0)
late, errors_late = loop(0.4, 1.5)
naive, errors_naive = loop(0.4, 1.5, stamped_on_arrival=True)

# %% [markdown]
# Once the last late sample is in, the filter holds the bits that it would hold had everything arrived in order.

# %%
same = np.array_equal(late.covariance(), in_order.covariance()) and np.array_equal(
    late.state()["position_t_m"], in_order.state()["position_t_m"]
)
print("late and in order end in the same bits:", same)

# %% mystnb={"image": {"alt": "Position error: in order, late at its time, and largest stamped on arrival"}}
figure, axes = plt.subplots(figsize=(7.2, 3.4))
for words, errors, style in (
    ("in order", errors_in_order, "-"),
    ("late, at its time of validity", errors_late, "--"),
    ("late, stamped on arrival", errors_naive, ":"),
):
    axes.plot(np.arange(len(errors)) + 0.5, np.linalg.norm(errors, axis=1), style, label=words)
    print(f"{words:30} position error, RMS over time: {np.sqrt((errors**2).sum(axis=1).mean()):.2f} m")
axes.set(xlabel="time, s", ylabel="position error, m")
axes.legend()
plt.show()

# %% [markdown]
# A late sample costs a little while it is on its way, because the estimate of the moment does not have it yet. A
# wrong time stamp costs more: at 2 m/s a position that is 1.5 s old is 3 m behind, at every fix again. [Late
# data](../docs/late_data.md) has the law and the cost of going back; [Live](../docs/live.md) is the command that does
# all this between sockets.
