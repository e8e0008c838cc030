# %% [markdown]
# # Planner: which manoeuvre makes a state observable?
#
# Before a dive with a damaged DVL one would like to know which short manoeuvre helps most. `manoeuvre_ranking` flies
# six of them on paper: for each it judges every error state (observable or not) and computes by covariance analysis
# how much of its standard deviation is left.

# %%
import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import bottomlock
from bottomlock.observability.analysis import Aiding
from bottomlock.observability.report import manoeuvre_ranking
from bottomlock.simulation.manoeuvres import MANOEUVRES

for manoeuvre in MANOEUVRES.values():
    print(f"{manoeuvre.name:14} {manoeuvre.words}")

# %% [markdown]
# Beams 1 and 2 return, and nothing else aids. Sensor errors are those of the paper's IMU (the packaged scenario
# `survey_table2`).

# %%
scenario = bottomlock.load_scenario("survey_table2")
model = scenario.kernel_model(bottomlock.normal_gravity_mps2(np.deg2rad(32.8)))
janus = bottomlock.BeamGeometry.janus(np.deg2rad(30.0))
table = manoeuvre_ranking(janus, Aiding(beams=(1, 2)), model)
observable = (
    table.group_by("manoeuvre", maintain_order=True)
    .agg(
        observable=(pl.col("verdict") == "observable").sum(),
        unobservable=(pl.col("verdict") == "unobservable").sum(),
        undecided=(~pl.col("verdict").is_in(["observable", "unobservable"])).sum(),
    )
    .sort("observable", descending=True)
)
observable

# %% [markdown]
# A state counts as observable if it can be told from all others by itself. At rest, on a straight course and in a
# steady turn the motion is the same all the time, and no window is long enough. What is observable is not yet known
# well: the next figure shows how well.

# %% mystnb={"image": {"alt": "What each manoeuvre leaves of the σ of each state, as a table of colours"}}
wanted = table["state"].unique(maintain_order=True).to_list()[3:15]
names = observable["manoeuvre"].to_list()
left = np.array(
    [
        [
            table.filter((pl.col("manoeuvre") == m) & (pl.col("state") == s))["fraction_left"].item()
            for s in wanted
        ]
        for m in names
    ]
)
figure, axes = plt.subplots(figsize=(7.4, 3.4))
image = axes.imshow(100.0 * left, cmap="viridis_r", vmin=0.0, vmax=200.0, aspect="auto")
axes.set_xticks(range(len(wanted)), wanted, rotation=45, ha="right")
axes.set_yticks(range(len(names)), names)
axes.grid(visible=False)
for row, line in enumerate(100.0 * left):
    for column, value in enumerate(line):
        axes.text(
            column,
            row,
            f"{value:.0f}",
            ha="center",
            va="center",
            fontsize=7,
            color="white" if value > 110 else "black",
        )
figure.colorbar(image, label="σ left, % of that before")
plt.show()

# %%
sway = table.filter(pl.col("state") == "velocity y").sort("sd_after")
best = sway.row(0, named=True)
print(
    f"sway is best known after {best['manoeuvre']}: σ {best['sd_after']:.3f} m/s of {best['sd_before']:.3f} before"
)

# %% [markdown]
# A row is a manoeuvre, a column a state. Below 100 the manoeuvre made the state better known, above 100 it became
# less known while the vehicle flew. Compare the velocities of the straight course with those of the turns. The yaw
# stays at 100: on an Earth at rest no manoeuvre shows a DVL the heading, and a minute of the Earth's rotation is too
# little to matter ([why](../docs/observability.md)). `bottomlock observe survey --out out/observe` makes this study
# for every set of beams.
