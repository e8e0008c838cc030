# %% [markdown]
# # A slope
#
# On the packaged scenario `slope` a lawn mower runs along a slope of 12 degrees. Outward legs climb out of the range
# of the beams that look downhill, other beams are lost by chance, and a current flows. Which beams return is nobody's
# choice: it comes from range, incidence and chance.

# %% mystnb={"image": {"alt": "The path down and along a slope, and when each beam returns"}}
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import bottomlock

METHODS = ["ins", "lc", "tc", "nsv", "weak_sway", "sway_current"]
scenario = bottomlock.load_scenario("slope").with_overrides(runs=12, methods=METHODS)
# Guidance on the true position: one truth for all runs.
scenario = scenario.replace({"trajectory.feedback": "truth"})
simulation = bottomlock.build_simulation(scenario)
truth = simulation.truth()
streams = bottomlock.sensor_streams(simulation, truth)
valid = streams["beams"].select(f"beam{k}_valid" for k in range(1, 5)).to_numpy()

figure, panels = plt.subplots(1, 2, figsize=(7.4, 3.2), width_ratios=[1, 2])
panels[0].plot(truth.position_t_m[::150, 1], truth.position_t_m[::150, 0], color="black")
panels[0].set(xlabel="east (downhill), m", ylabel="north, m", title="path", aspect="equal")
time_s = streams["beams"]["time_ns"].to_numpy() / 1e9
for k in range(4):
    panels[1].plot(time_s, np.where(valid[:, k], k + 1, np.nan), "s", markersize=2.5, color="black")
panels[1].set(xlabel="time, s", ylabel="beam", yticks=[1, 2, 3, 4], title="beams that return in run 0")
plt.show()
for beams in range(4, -1, -1):
    print(f"{int(np.sum(valid.sum(axis=1) == beams)):4} pings with {beams} beams")

# %%
with TemporaryDirectory() as folder:
    results = bottomlock.run_campaign(scenario, Path(folder) / "slope")
table = results.runs.group_by("method", maintain_order=True).agg(
    velocity_rms_mps=(pl.col("velocity_rms_over_time_mps") ** 2).mean().sqrt().round(3),
    nees_of_20=pl.col("nees_mean_over_time").mean().round(0),
)
table

# %% mystnb={"image": {"alt": "Velocity errors of the methods on the slope"}}
figure, axes = plt.subplots(figsize=(7.2, 4.0))
results.plot_velocity_error(axes=axes)
axes.set_yscale("log")
plt.show()

# %% [markdown]
# `lc` is the reference: it has all four beams at every ping. `tc` takes every beam that returns. `sway_current` adds
# what is known of the vehicle in the water. `nsv` sets the sway over ground to zero in a current.
#
# The packaged scenario steers by the estimate, each method its own vehicle, and reports how far the true vehicle
# leaves its path: `bottomlock run slope --out out/slope --methods ins,tc,sway_current` (minutes). [The
# vehicle](../docs/plant.md) has the equations and the keys of seabed, current and beam loss.
