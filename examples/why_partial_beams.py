# %% [markdown]
# # Why partial beams carry information
#
# A DVL of four beams that has lost two reports no velocity. Yet each beam that returns has measured something: the
# velocity along its own direction, to a few centimetres per second. This page draws what remains.

# %%
import matplotlib.pyplot as plt
import numpy as np

import bottomlock

BEAM_SD_MPS = 0.042
PRIOR_SD_MPS = 0.5
janus = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
print(np.round(janus.directions_p, 3))

# %% [markdown]
# Each row is a beam, its columns are forward, right and down. With the rows B of the beams that return and the noise
# σ of a beam, the information about the velocity is Λ = BᵀB/σ². An inertial system without aid has a velocity with
# some uncertainty of its own, here 0.5 m/s in every direction. The sum of both is what is known after
# the ping.

# %% mystnb={"image": {"alt": "Ellipses of surge and sway: round with one beam, flat with two, small with three"}}
masks = {"no beam": [], "beam 1": [0], "beams 1, 2": [0, 1], "beams 1, 4": [0, 3], "beams 1, 2, 3": [0, 1, 2]}


def after(beams: list[int]) -> np.ndarray:
    """Covariance of surge, sway, heave after a ping with these beams."""
    rows = janus.directions_p[beams]
    return np.linalg.inv(np.eye(3) / PRIOR_SD_MPS**2 + rows.T @ rows / BEAM_SD_MPS**2)


figure, panels = plt.subplots(1, len(masks), sharey=True, figsize=(8.6, 2.6))
circle = np.stack([np.cos(np.linspace(0, 2 * np.pi, 200)), np.sin(np.linspace(0, 2 * np.pi, 200))])
for axes, (words, beams) in zip(panels, masks.items(), strict=True):
    horizontal = after(beams)[:2, :2]
    surge, sway = np.linalg.cholesky(horizontal) @ circle
    axes.fill(sway, surge, alpha=0.35, color="tab:blue")
    axes.set(title=words, aspect="equal", xlim=(-0.6, 0.6), ylim=(-0.6, 0.6), xlabel="sway, m/s")
panels[0].set_ylabel("surge, m/s")
plt.show()
for words, beams in masks.items():
    surge, sway, heave = np.sqrt(np.diag(after(beams)))
    print(f"{words:14} σ of surge {surge:.3f}, sway {sway:.3f}, heave {heave:.3f} m/s")

# %% [markdown]
# Read the figure from left to right. Beams 1 and 2 look to the same side, one ahead and one astern: their difference
# is surge alone, their sum mixes sway with heave, and the ellipse becomes thin one way and stays wide the other.
# Beams 1 and 4 look ahead, one to each side: the same with the axes exchanged. Three beams leave nothing open.
#
# How much there is to gain is a matter of **which** beams, not only of how many:

# %%
print("one ping, principal axes of the information (m/s: 1σ along the axis; ∞: not measured)")
for words, beams in list(masks.items())[1:]:
    rows = janus.directions_p[beams]
    values, vectors = np.linalg.eigh(rows.T @ rows / BEAM_SD_MPS**2)
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        sd = "∞" if value < 1e-6 else f"{1 / np.sqrt(value):.3f}"
        print(f"{words:14} {sd:>6}  along surge, sway, heave {np.round(vector, 2)}")

# %% [markdown]
# The directions marked ∞ have no measurement at all. A method may leave them to the inertial system
# ([`tc`](../docs/methods/tc.md), [`info`](../docs/methods/info.md)), or bring an assumption about them
# ([`nsv`](../docs/methods/nsv.md), [`sway_current`](../docs/methods/sway_current.md)). What it must not do is
# [measure its own estimate](why_vb_is_overconfident.py).
