# %% [markdown]
# # My A50 log
#
# From the bytes of a Water Linked A50 to velocities with covariance. The log of this page is simulated, so that its
# truth is known: three minutes of a survey, as the instrument sends them on port 16171. With a log of your own begin
# at `convert`.

# %%
import subprocess
import sys
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

folder = Path(mkdtemp(prefix="a50_"))


def bottomlock(command: str) -> None:
    """Runs a command in the folder of this page."""
    program = [sys.executable, "-m", "bottomlock", *command.split()]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=True)
    print("$ bottomlock", command)
    print(done.stdout, end="\n\n")


bottomlock(
    "simulate-dvl survey --geometry waterlinked_a50 --dvl file:a50.json "
    "--truth truth.parquet --speed max --duration-s 180"
)
print((folder / "a50.json").read_text().splitlines()[5][:80], "...")

# %% [markdown]
# ## Convert
#
# The format is recognised from the content. The account says what was kept, what was left out and why.

# %%
bottomlock("convert a50.json --out pings.parquet")

# %% [markdown]
# ## Velocity with covariance, and with two beams
#
# `fix` solves every ping for what its beams determine. Suppose that beams 3 and 4 had been lost between second 40 and
# second 80: the same log with two columns changed. The geometry file of an A50 claims a beam noise of 4 mm/s; `fix`
# measures what this log has, and uses that.

# %%
pings = pl.read_parquet(folder / "pings.parquet")
time_s = (pings["time_ns"] - pings["time_ns"][0]) / 1e9
away = time_s.is_between(40.0, 80.0)
lost = pings.with_columns(
    pl.when(away).then(False).otherwise(pl.col(f"beam{k}_valid")).alias(f"beam{k}_valid") for k in (3, 4)
)
lost.write_parquet(folder / "lost.parquet")
bottomlock("fix lost.parquet --geometry waterlinked_a50 --method plcf --out fixes.parquet")

# %% mystnb={"image": {"alt": "Surge, sway and heave of every ping with ± 2σ about the truth"}}
fixes = pl.read_parquet(folder / "fixes.parquet")
truth = pl.read_parquet(folder / "truth.parquet")
figure, panels = plt.subplots(3, 1, sharex=True, figsize=(7.2, 5.4))
for axes, name in zip(panels, ("surge", "sway", "heave"), strict=True):
    value = fixes[f"{name}_mps"].cast(pl.Float64).to_numpy()
    sd = np.sqrt(fixes[f"cov_{name}_{name}_m2ps2"].cast(pl.Float64).to_numpy())
    axes.errorbar(time_s, value, yerr=2 * sd, fmt=".", markersize=3, elinewidth=0.7, label="fix, ± 2σ")
    axes.plot(time_s, truth[f"true_{name}_mps"], color="black", linewidth=0.8, label="truth")
    axes.set_ylabel(f"{name}, m/s")
panels[0].legend(ncols=2, loc="upper right")
panels[-1].set_xlabel("time, s")
plt.show()
for name in ("surge", "sway", "heave"):
    known = fixes.filter(away)[f"{name}_mps"].is_not_null().sum()
    print(f"{name}: solved in {known} of {int(away.sum())} pings with two beams")

# %% [markdown]
# Beams 1 and 2 of an A50 look astern, one to starboard and one to port. What differs between them is sway; surge and
# heave move both alike, and two beams cannot tell one from the other. What is not determined is left out and not
# guessed. `--method info` returns the mixture as it is, for an INS that takes a full covariance; with an IMU beside
# the log `bottomlock replay` navigates through.
#
# Next: [check the mounting](audit_mis_mounted.py), [velocity from recorded beams](../docs/howto/velocity.md), and
# [the formats](../docs/formats.md) that are read.
