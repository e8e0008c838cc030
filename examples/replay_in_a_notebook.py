# %% [markdown]
# # A replay in a notebook
#
# 23 minutes of a simulated survey, with every sensor and its truth, navigated again: `run_replay` does what
# `bottomlock replay` does, and `Replay` reads what either of them has written. The log is in the folder of bottomlock's
# sources, where this page is to be run.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

import bottomlock
from bottomlock.replay.case import load_case

here = Path.cwd()
sources = next(folder for folder in (here, *here.parents) if (folder / "data" / "logs").is_dir())
case = load_case(sources / "data" / "logs" / "survey_dive" / "case.toml").with_methods(
    ["ins", "tc", "sway_current"]
)
with TemporaryDirectory() as folder:
    replay = bottomlock.run_replay(case, Path(folder) / "dive")
    alone = bottomlock.run_replay(case.model_copy(update={"attitude": None}), Path(folder) / "no_compass")
replay

# %% [markdown]
# The figures are those of the page `report.html`, one call each; without a name they show the recording as it is, and
# the method whose track is to be taken.

# %%
replay.verdict, replay.method, replay.what_ifs

# %% mystnb={"image": {"alt": "Map of the dive: the tracks of the methods, the truth and two-sigma ellipses"}}
replay.plot_map()
plt.show()

# %% mystnb={"image": {"alt": "Surge, sway and heave of the methods against time, each with its sigma"}}
replay.plot_state("velocity")
plt.show()

# %% [markdown]
# With beams 3 and 4 lost, on axes of one's own:

# %% mystnb={"image": {"alt": "With two beams lost: the map, and the sigma of the position against time"}}
figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.4), gridspec_kw={"wspace": 0.55})
replay.plot_map("lost_34", axes=left)
replay.plot_state("position_sd", what_if="lost_34", axes=[right])
plt.show()

# %% [markdown]
# Tables are Polars data frames: `runs`, `samples`, `innovations`, `pings`, `reference`.

# %%
replay.pings.filter(replay.pings["what_if"] == "lost_34").head(4)

# %% [markdown]
# Without the compass: what do the ends of the tracks and their claims lose? Two replays of one log share everything but
# the setting, so their difference is that of the setting.

# %%
ends = ["north_m", "east_m", "sd_position_north_m", "sd_position_east_m"]
forward = {"what_if": "recorded", "method": "tc", "pass": "forward"}
without, given = (one.samples.filter(**forward).select(ends).tail(1) for one in (alone, replay))
without - given
