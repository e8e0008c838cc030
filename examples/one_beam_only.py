# %% [markdown]
# # One beam only
#
# A single beam gives one number a ping: the velocity along its own direction. That is too little for a velocity and
# much for a filter. This page loses beams one after the other on a straight leg and asks how large the velocity error
# is after two minutes.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import bottomlock

LOST = {4: [], 3: [4], 2: [3, 4], 1: [2, 3, 4]}
base = bottomlock.load_scenario("straight").with_trajectory(duration_s=120.0)
base = base.replace({"depth.enabled": True}).with_overrides(runs=15, methods=["tc", "sway_current"])

frames = []
with TemporaryDirectory() as folder:
    for beams, lost in LOST.items():
        scenario = base.replace({"dvl.beams_lost": lost})
        results = bottomlock.run_campaign(scenario, Path(folder) / str(beams))
        frames.append(results.ensemble.with_columns(beams=pl.lit(beams)))
ensemble = pl.concat(frames)
last = ensemble.filter(pl.col("time_s") == pl.col("time_s").max())
table = last.pivot("method", index="beams", values="velocity_rms_over_runs_mps")
table.with_columns(pl.col("tc", "sway_current").round(3))

# %% mystnb={"image": {"alt": "Velocity errors of tc and sway_current with four to one of the beams"}}
figure, panels = plt.subplots(1, 2, sharey=True, figsize=(7.4, 3.6))
for axes, method in zip(panels, ("tc", "sway_current"), strict=True):
    for beams, style in zip(LOST, ("-", "--", "-.", ":"), strict=True):
        rows = ensemble.filter((pl.col("method") == method) & (pl.col("beams") == beams))
        axes.plot(rows["time_s"], rows["velocity_rms_over_runs_mps"], style, label=f"{beams} of 4 beams")
    axes.set(title=method, xlabel="time, s", yscale="log")
panels[0].set_ylabel("velocity error, RMS over 15 runs, m/s")
panels[0].legend()
plt.show()

# %% [markdown]
# Why one beam helps at all: it cuts the velocity's uncertainty in one direction, and the motion and the depth sensor
# turn that into the others over time. `tc` takes nothing but that. `sway_current` adds that a torpedo-shaped vehicle
# hardly slips sideways through the water, which is what remains to be known.

# %%
janus = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
for beams in range(1, 5):
    rows = janus.directions_p[:beams]
    print(
        f"{beams} beam(s): {np.linalg.matrix_rank(rows)} of 3 directions of the velocity measured in one ping"
    )

# %% [markdown]
# `bottomlock study` runs every set of beams on three trajectories; [observability](observability_in_pictures.py) shows
# what a manoeuvre adds.
