# %% [markdown]
# # In a notebook
#
# Objects show themselves: as a line in a terminal, as a small table in a notebook.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

import bottomlock

scenario = bottomlock.load_scenario("figure_eight").with_trajectory(duration_s=60.0)
scenario = scenario.with_overrides(runs=10, methods=["tc", "nsv", "sway_current"])
scenario

# %%
scenario.dvl.tilt_deg, scenario.imu.gyro_bias_deg_per_h

# %% [markdown]
# A scenario never changes in place. `replace` gives a new one with another value of one [key](../docs/keys.md),
# checked as a file is; a wrong key names the nearest right one.

# %%
one_lost = scenario.replace({"dvl.beams_lost": [4]})
try:
    scenario.replace({"dvl.beam_lost": [4]})
except bottomlock.BottomlockError as error:
    print(error)

# %%
found = {}
with TemporaryDirectory() as folder:
    for words, each in (("two beams", scenario), ("three beams", one_lost)):
        found[words] = bottomlock.run_campaign(each, Path(folder) / words.replace(" ", "_"))
found["two beams"]

# %% [markdown]
# Plots take axes, or make their own. Tables are Polars data frames: `runs`, `ensemble`, `consistency`.

# %% mystnb={"image": {"alt": "Velocity errors with two beams and with three, side by side"}}
figure, panels = plt.subplots(1, 2, figsize=(8.4, 4.0))
for axes, (words, results) in zip(panels, found.items(), strict=True):
    results.plot_velocity_error(axes=axes)
    axes.set_title(words, loc="right")
plt.show()

# %%
found["two beams"].runs.select("run", "method", "velocity_rms_over_time_mps", "nees_mean_over_time").head(6)

# %% [markdown]
# Both have the same runs, so their differences are paired. Here the differences of the three beams to the two:

# %%
compared = found["three beams"].compare(found["two beams"], labels=("three beams", "two beams"))
compared.filter(
    (compared["campaign"] == "three beams") & (compared["quantity"] == "velocity at the end")
).select("method", "unit", "value", "paired", "difference", "difference_lo", "difference_hi")

# %% [markdown]
# [Notebooks](../docs/notebooks.md) lists what shows itself; [side by side](../docs/compare.md) compares variants with
# paired differences.
