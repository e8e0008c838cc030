# %% [markdown]
# # The paper in five minutes
#
# Tal, Klein and Katz (*Sensors* 17, 2017, 415) ask what an inertial navigation system can do with a DVL that has lost
# two of its four beams. This page flies their straight trajectory for 250 s at 2 m/s, 30 times, each time with other
# sensor errors of their Table 2, and lets seven methods navigate every run. `bottomlock reproduce` makes the whole
# study.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import polars as pl

import bottomlock

METHODS = ["ins", "lc", "tc", "vb", "nsv", "plcf", "sway_current"]
scenario = bottomlock.load_scenario("straight").with_overrides(runs=30, methods=METHODS)
print(scenario)

# %%
with TemporaryDirectory() as folder:
    results = bottomlock.run_campaign(scenario, Path(folder) / "straight")
results

# %% [markdown]
# `lc` is the reference: it has all four beams. The others have beams 1 and 2, which measure surge and a mixture of
# heave and sway. What no beam measures drifts with the inertial sensors.

# %% mystnb={"image": {"alt": "Velocity errors of seven methods with two beams, with confidence bands"}}
figure, axes = plt.subplots(figsize=(7.2, 4.6))
results.plot_velocity_error(axes=axes)
axes.set_yscale("log")
plt.show()

# %% [markdown]
# A small error is not enough: a filter also states how large its error is. The normalised estimation error squared
# (NEES) of velocity and attitude is 6 on the mean, one for each of six numbers, if the filter states it rightly, and
# more if it claims too much. With 30 runs a mean within the band is no contradiction.

# %%
last = results.ensemble.filter(pl.col("time_s") == pl.col("time_s").max())
nees = results.consistency.filter(pl.col("quantity") == "nees_velocity_attitude")
table = last.select("method", velocity_mps=pl.col("velocity_rms_over_runs_mps").round(3)).join(
    nees.select(
        "method",
        nees_of_6=pl.col("mean").round(1),
        band_lo=pl.col("band_lo").round(1),
        band_hi=pl.col("band_hi").round(1),
    ),
    on="method",
    maintain_order="left",
)
table

# %% [markdown]
# Read the table from both sides. `tc` uses what the two beams measure and says honestly that the rest drifts. `vb`
# adds a beam made from its own estimate: its error is no better, its claim is far too small. `nsv` sets the sway to
# zero, which is true on this straight leg in still water and [false in a current](cross_current.py). `sway_current`
# says the same of the sway **through the water** and estimates the current.
#
# Next: [one beam only](one_beam_only.py), [why VB is overconfident](why_vb_is_overconfident.py), and
# [every method](../docs/methods/index.md).
