# %% [markdown]
# # Why the virtual beam is overconfident
#
# The virtual beam fills a lost beam with what the filter itself expects it to read, and gives the result to the
# filter as a measurement. Nothing has been measured. What happens is easiest to see with one number.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import bottomlock

# %% [markdown]
# ## One number
#
# A velocity is known to 1 m/s and drifts by 0.1 m/s in each second. Every second the filter measures its own
# estimate, as if that were an independent reading of 1 m/s. The innovation is zero, so the estimate never changes.
# The claimed variance shrinks all the same.

# %% mystnb={"image": {"alt": "The true σ grows; the claimed one falls unless the correlation is kept"}}
true_variance, claimed, kept = [1.0], [1.0], [1.0]
for _ in range(60):
    true_variance.append(true_variance[-1] + 0.1**2)
    predicted = claimed[-1] + 0.1**2
    claimed.append(predicted * 1.0 / (predicted + 1.0))
    kept.append(kept[-1] + 0.1**2)
figure, axes = plt.subplots(figsize=(7.2, 3.0))
axes.plot(np.sqrt(true_variance), label="true σ of the error")
axes.plot(np.sqrt(claimed), "--", label="claimed, own estimate as a measurement")
axes.plot(np.sqrt(kept), ":", color="black", linewidth=2.5, label="claimed, with the correlation kept")
axes.set(xlabel="time, s", ylabel="m/s", ylim=(0, None))
axes.legend()
plt.show()
print(f"after 60 s: true σ {true_variance[-1] ** 0.5:.2f} m/s, claimed {claimed[-1] ** 0.5:.2f} m/s")

# %% [markdown]
# The remedy is to say the truth about the noise of that reading: its error **is** the filter's error, fully
# correlated. Then the gain is zero and nothing is gained: the exact virtual beam is tight coupling (`vb` with
# `exact_virtual_beams` equals `tc`, a theorem with a test).
#
# ## In the paper's world
#
# The paper multiplies the variance of the virtual beam by a factor n_f and does not say which. Larger factors weaken
# the false measurement.

# %%
base = bottomlock.load_scenario("straight").with_trajectory(duration_s=150.0)
rows = []
with TemporaryDirectory() as folder:
    for factor in (1.0, 3.0, 10.0, 100.0):
        scenario = base.replace({"filter.virtual_beam_factor": factor})
        scenario = scenario.with_overrides(runs=20, methods=["tc", "vb"])
        results = bottomlock.run_campaign(scenario, Path(folder) / f"{factor:g}")
        samples = pl.concat(
            [pl.read_parquet(path) for path in (Path(folder) / f"{factor:g}").rglob("samples*.parquet")]
        )
        sway = (
            samples.filter(pl.col("time_ns") >= 100_000_000_000)
            .group_by("method")
            .agg(
                error_mps=(pl.col("err_velocity_sway_mps") ** 2).mean().sqrt(),
                claimed_mps=(pl.col("sd_velocity_sway_mps") ** 2).mean().sqrt(),
            )
        )
        rows.append(sway.with_columns(n_f=pl.lit(factor)))
table = pl.concat(rows).filter((pl.col("method") == "vb") | (pl.col("n_f") == 1.0)).sort("method", "n_f")
table = table.select("method", "n_f", pl.col("error_mps").round(3), pl.col("claimed_mps").round(4))
table

# %% mystnb={"image": {"alt": "vb: error and claimed σ against n_f, with those of tc as lines"}}
figure, axes = plt.subplots(figsize=(7.2, 3.2))
vb, tc = table.filter(pl.col("method") == "vb"), table.filter(pl.col("method") == "tc")
axes.loglog(vb["n_f"], vb["error_mps"], "o-", label="vb: sway error, RMS")
axes.loglog(vb["n_f"], vb["claimed_mps"], "o--", label="vb: claimed σ")
axes.axhline(tc["error_mps"].item(), color="black", label="tc: sway error, RMS")
axes.axhline(tc["claimed_mps"].item(), color="black", linestyle=":", label="tc: claimed σ")
axes.set(xlabel="n_f", ylabel="m/s, from second 100 on")
axes.legend(fontsize=8)
plt.show()

# %% [markdown]
# With n_f = 1 the filter claims a small fraction of its error. As n_f grows, the claim grows towards that of `tc`,
# and the error with it becomes that of `tc`: at its best the virtual beam is the filter without it. The page
# of the method is [`vb`](../docs/methods/vb.md).
