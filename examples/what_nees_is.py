# %% [markdown]
# # What NEES is
#
# A filter gives an estimate and a covariance: "I am wrong by about this much". In a simulation the truth is known,
# and one can ask whether that is so. The normalised estimation error squared (NEES) is the error measured in the
# filter's own units: e' P⁻¹ e. If the filter is right about itself, it follows the chi-squared distribution with as
# many degrees of freedom as e has numbers, and is that many on the mean.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
from scipy.stats import chi2

import bottomlock

METHODS = ["lc", "tc", "vhv", "sway_current"]
scenario = bottomlock.load_scenario("lawn_mower").with_trajectory(duration_s=120.0)
scenario = scenario.with_overrides(runs=60, methods=METHODS)
with TemporaryDirectory() as folder:
    results = bottomlock.run_campaign(scenario, Path(folder) / "nees")
    samples = pl.concat([pl.read_parquet(path) for path in Path(folder).rglob("samples*.parquet")])

# %% [markdown]
# ## Error beside claim
#
# The sway error of every run (thin lines) and ± 2σ as the filter claims it. About one in twenty should lie outside.

# %% mystnb={"image": {"alt": "Sway errors of the runs against ± 2σ of two methods"}}
figure, panels = plt.subplots(1, 2, figsize=(7.8, 3.2))
for axes, method in zip(panels, ("tc", "vhv"), strict=True):
    of_method = samples.filter(pl.col("method") == method)
    for run in range(30):
        one = of_method.filter(pl.col("run") == run)
        axes.plot(
            one["time_ns"] / 1e9, one["err_velocity_sway_mps"], color="tab:blue", linewidth=0.4, alpha=0.6
        )
    sd = of_method.group_by("time_ns", maintain_order=True).agg(
        (pl.col("sd_velocity_sway_mps") ** 2).mean().sqrt()
    )
    for sign in (-2.0, 2.0):
        axes.plot(sd["time_ns"] / 1e9, sign * sd["sd_velocity_sway_mps"], color="black")
    outside = of_method.select(
        (pl.col("err_velocity_sway_mps").abs() > 2.0 * pl.col("sd_velocity_sway_mps")).mean()
    ).item()
    axes.set(title=f"{method}: {100 * outside:.0f} % outside ± 2σ", xlabel="time, s")
panels[0].set_ylabel("sway error, m/s")
plt.show()

# %% [markdown]
# ## All numbers at once
#
# NEES of velocity and attitude, six numbers, in every run at the last second; the curve is chi-squared with six
# degrees of freedom.

# %% mystnb={"image": {"alt": "Distribution of NEES of the methods beside chi-squared with 6 degrees"}}
last = samples.filter(pl.col("time_ns") == pl.col("time_ns").max())
figure, axes = plt.subplots(figsize=(7.2, 3.2))
grid = np.linspace(0.0, 30.0, 200)
axes.plot(grid, chi2.cdf(grid, 6), color="black", linewidth=2, label="chi-squared, 6 degrees")
for method, style in zip(METHODS, ("-", "--", "-.", ":"), strict=True):
    values = np.sort(last.filter(pl.col("method") == method)["nees_velocity_attitude"].to_numpy())
    axes.step(values, np.arange(1, len(values) + 1) / len(values), linestyle=style, label=method)
    low, high = chi2.ppf([0.025, 0.975], 6 * len(values)) / len(values)
    verdict = "too high" if values.mean() > high else "too low" if values.mean() < low else "inside"
    print(f"{method:13} mean {values.mean():6.2f}, 95 % band {low:.2f} … {high:.2f}: {verdict}")
axes.set(xlim=(0, 30), xlabel="NEES of velocity and attitude", ylabel="fraction of runs below")
axes.legend()
plt.show()

# %% [markdown]
# A curve to the right of chi-squared is a filter that is wrong by more than it claims: **overconfident**. To the left
# it is **conservative**: its σ is wider than needed. Overconfidence is what hurts, because whoever uses the estimate
# (a gate, an autopilot, another filter) trusts it too much.
#
# A single look at 95 % is wrong once in twenty. `bottomlock study` tests 45 cells of every method with one
# false-alarm rate for [the whole](../docs/methods/index.md).
