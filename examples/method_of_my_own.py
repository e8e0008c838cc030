# %% [markdown]
# # A method of my own
#
# A class with a name and a method `ping` flies beside the built-in methods, with the same noise in every run. This one
# uses the beams as `tc` does, and adds what its author knows of the vehicle: it neither climbs nor sinks by more than
# 5 cm/s on this leg.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import bottomlock
from bottomlock.own_method import Beams, Prior, Rows

HEAVE_SD_MPS = 0.05
VELOCITY = slice(6, 9)  # of the 20 error states


class LevelFlight:
    """The valid beams, and heave that is zero within 5 cm/s."""

    name = "level_flight"

    def ping(self, beams: Beams, prior: Prior) -> Rows | None:
        """The rows of the beams with one more."""
        rows = beams.rows
        heave = np.zeros((1, rows.jacobian.shape[1]))
        heave[0, VELOCITY] = [0.0, 0.0, 1.0]
        noise = np.zeros((len(rows.residual) + 1,) * 2)
        noise[:-1, :-1] = rows.noise
        noise[-1, -1] = HEAVE_SD_MPS**2
        return Rows(
            np.append(rows.residual, 0.0 - prior.velocity_p_mps[2]), np.vstack([rows.jacobian, heave]), noise
        )


# %%
scenario = bottomlock.load_scenario("straight").with_trajectory(duration_s=60.0)
scenario = scenario.with_overrides(runs=10, methods=["tc", LevelFlight, "sway_current"])
with TemporaryDirectory() as folder:
    results = bottomlock.run_campaign(scenario, Path(folder) / "own")
results

# %% mystnb={"image": {"alt": "Velocity errors against time: tc, the own method level_flight, sway_current"}}
axes = results.plot_velocity_error()
axes.set_title("beams 1 and 2 of 4", loc="right")
plt.show()

# %%
verdicts = results.consistency.filter(pl.col("quantity") == "nees_velocity_attitude").select(
    "method", "mean", "band_lo", "band_hi", "verdict"
)
verdicts

# %% [markdown]
# Beams 1 and 2 measure surge and a mixture of heave and sway; whoever knows the heave can solve for the sway. The
# verdict is the part to read twice. The assumption is held at every ping anew, as if it were a new measurement each
# second. Where the true heave departs from zero in a way that lasts, the filter counts one error many times, and the
# NEES shows it. On this leg it passes or fails as the table says; `bottomlock study --methods FILE.py:CLASS`
# tries it on all.
#
# [A method of your own](../docs/own_method.md) has the contract, the faults and the cost.
