# %% [markdown]
# # Observability in pictures
#
# A state is observable if two different values of it cannot give the same readings over a window. Which states are
# depends on the beams **and** on the motion: a vehicle that flies straight repeats itself, a turn asks a new
# question.

# %%
import matplotlib.pyplot as plt
import numpy as np

import bottomlock
from bottomlock.observability.analysis import Aiding, describe, deviations, observe
from bottomlock.simulation.manoeuvres import MANOEUVRES, manoeuvre_truth

janus = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
aidings = {
    "one beam": Aiding(beams=(1,)),
    "two beams": Aiding(beams=(1, 2)),
    "three beams": Aiding(beams=(1, 2, 3)),
    "four beams": Aiding(beams=(1, 2, 3, 4)),
    "two beams, depth": Aiding(beams=(1, 2), depth=True),
    "two beams, compass": Aiding(beams=(1, 2), attitude=True),
}
truths = {name: manoeuvre_truth(one, rate_hz=50.0, earth_rate_radps=0.0) for name, one in MANOEUVRES.items()}

# %% [markdown]
# ## How many of the 20 error states a minute of motion shows
#
# For each cell the rows of all measurements, H Φ, are stacked, and their rank is counted from the singular values. A
# cell without a clear gap between kept and dropped values says "?".

# %% mystnb={"image": {"alt": "Table of observable states: more with more beams and more turns"}}
found = {
    name: observe(truth, janus, list(aidings.values()), earth_rate_radps=0.0)
    for name, truth in truths.items()
}
ranks = np.array([[one.rank for one in line] for line in found.values()])
decided = np.array([[one.decided for one in line] for line in found.values()])
figure, axes = plt.subplots(figsize=(7.4, 3.6))
axes.imshow(ranks, cmap="viridis", vmin=0, vmax=20, aspect="auto")
axes.set_xticks(range(len(aidings)), aidings, rotation=25, ha="right")
axes.set_yticks(range(len(found)), found)
axes.grid(visible=False)
for row, line in enumerate(ranks):
    for column, rank in enumerate(line):
        text = str(rank) if decided[row, column] else f"{rank}?"
        axes.text(column, row, text, ha="center", va="center", color="black" if rank > 12 else "white")
plt.show()

# %% [markdown]
# Down a column only the motion changes, along a row only the aiding.

# %%
straight, turning = list(found).index("straight"), list(found).index("dive_and_turn")
print(f"straight flight, one beam to four: {ranks[straight, 0]} to {ranks[straight, 3]} states")
print(f"one beam, straight flight to a dive with a turn: {ranks[straight, 0]} to {ranks[turning, 0]} states")

# What stays hidden in one cell:
one = found["figure_eight"][list(aidings).index("four beams")]
print(f"four beams in a figure of eight: rank {one.rank} of 20; unobservable directions:")
for row, pivot in zip(one.basis, one.pivots, strict=True):
    print("  ", describe(row, one.states, one.scales, 9.8, pivot=int(pivot)))

# %% [markdown]
# ## Observable is not yet known well
#
# A rank says whether, not how well. The filter's own covariance along the motion says how well: σ of the sway with
# beams 1 and 2, straight and in the figure of eight, with the inertial errors of the paper.

# %% mystnb={"image": {"alt": "σ of the sway: it grows on a straight leg, less in a turn, least in an eight"}}
scenario = bottomlock.load_scenario("straight")
model = scenario.kernel_model(bottomlock.normal_gravity_mps2(np.arctan2(3.0, 4.0)))
figure, axes = plt.subplots(figsize=(7.2, 3.2))
for name, style in (("straight", "-"), ("yaw_turn", "--"), ("figure_eight", "-.")):
    history = deviations(truths[name], janus, aidings["two beams"], model)
    sway = history.sd[:, history.states.index("velocity y")]
    axes.plot(history.time_ns / 1e9, sway, style, label=name)
    print(f"{name:14} σ of sway after a minute: {sway[-1]:.3f} m/s")
axes.set(xlabel="time, s", ylabel="σ of the sway, m/s", yscale="log")
axes.legend()
plt.show()

# %% [markdown]
# [Observability](../docs/observability.md) has the proofs, among them that no manoeuvre shows the heading to a DVL on
# an Earth at rest. The [planner](planner.py) ranks manoeuvres for a question of your own.
