# %% [markdown]
# # A campaign on a cluster
#
# Runs are grouped in chunks whose boundaries the scenario alone decides. So a campaign can be cut into shards that
# know nothing of each other, on as many machines as there are, and `merge` makes the campaign that one machine would
# have made: the same bits.

# %%
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import bottomlock

scenarios = [
    bottomlock.load_scenario(name)
    .with_trajectory(duration_s=20.0)
    .with_overrides(runs=200, methods=["tc", "sway_current"])
    for name in ("straight", "figure_eight", "lawn_mower")
]
folder = Path(mkdtemp(prefix="cluster_"))

# %% [markdown]
# ## Three machines
#
# In a shell it is `bottomlock run straight figure_eight lawn_mower --out part1 --shard
# 1/3` on the first, and so on. Here one after the other.

# %%
parts = []
for k in (1, 2, 3):
    parts.append(folder / f"part{k}")
    manifest = bottomlock.run_shard(scenarios, parts[-1], f"{k}/3")
    files = sorted(str(path.relative_to(parts[-1])) for path in parts[-1].rglob("samples*.parquet"))
    print(f"shard {k}/3, {manifest['wall_time_s']:.1f} s: {', '.join(files)}")
merged = bottomlock.merge_shards(folder / "merged", parts)
merged

# %% [markdown]
# ## One machine
#
# The whole campaign again, in one go, and compared number by number.

# %%
whole = bottomlock.run_campaign(scenarios, folder / "whole")
for name in ("runs", "ensemble", "consistency"):
    print(f"{name}: equal {getattr(whole, name).equals(getattr(merged, name))}")

# %% [markdown]
# ## How many runs are enough?
#
# The interval of a result shrinks with the square root of the number of runs: that is what a cluster buys.

# %% mystnb={"image": {"alt": "The 95 % interval narrows as one over the square root of the runs."}}
straight = (pl.col("trajectory") == "straight") & (pl.col("method") == "tc")
final = merged.runs.filter(straight)["velocity_final_mps"].to_numpy()
rng = np.random.default_rng(0)
counts = np.array([10, 20, 50, 100, 200])
widths = []
for count in counts:
    drawn = final[rng.integers(0, count, size=(2000, count))]
    low, high = np.quantile(np.sqrt((drawn**2).mean(axis=1)), [0.025, 0.975])
    widths.append(high - low)
    print(
        f"{count:4} runs: RMS {np.sqrt((final[:count] ** 2).mean()):.3f} m/s, 95 % interval {low:.3f} … {high:.3f}"
    )
figure, axes = plt.subplots(figsize=(7.2, 3.2))
axes.loglog(counts, widths, "o-", label="width of the interval")
axes.loglog(counts, widths[-1] * np.sqrt(counts[-1] / counts), ":", color="black", label="1/√runs")
axes.set(xlabel="runs", ylabel="m/s", title="95 % interval of tc's velocity RMS after 20 s, straight")
axes.legend()
plt.show()

# %% [markdown]
# With Dask the chunks are handed out by a scheduler: `bottomlock run survey --engine dask --scheduler
# tcp://10.0.0.5:8786`; without `--scheduler` it starts processes on this machine. Its tables are the same bits again.
# [More than one machine](../docs/howto/cluster.md) says what the workers need.
