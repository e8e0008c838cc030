"""Noise of the beams as their closure shows it, against what the case claims."""

import numpy as np

from bottomlock.recordings.finding import Finding
from bottomlock.replay.beam_noise import measure_noise
from bottomlock.replay.case import Case
from bottomlock.replay.streams import Streams

SMALL_CLAIM, WRONG_CLAIM = 1.5, 2.5
"""Measured over claimed noise from which the claim is a warning, and a fault."""


def beam_noise_finding(case: Case, streams: Streams) -> Finding | None:
    """A claimed noise that the closure of the beams exceeds by far; None without redundant beams."""
    beams = streams.beams
    if beams.velocity_d_mps is not None or case.dvl.beam_noise_from == "recording":
        return None
    claimed = streams.instrument.beam_sd_mps
    noise = measure_noise(streams.instrument.geometry, beams.velocity_mps, beams.valid, claimed)
    group = noise.groups[-1]
    if group.fallback or group.factor < SMALL_CLAIM:
        return None
    claim_mps = float(np.mean(claimed))
    measured_mps = claim_mps * group.factor
    return Finding(
        "beam_noise", "fault" if group.factor > WRONG_CLAIM else "warning", group.pings * group.factor**2,
        f"The beams are {group.factor:.1f} times as noisy as the case claims.",
        f"Closure of {group.pings} pings of all beams: {1e3 * measured_mps:.1f} mm/s a beam, claimed "
        f"{1e3 * claim_mps:.1f} mm/s.",
        f"Set dvl.beam_noise_mps = {measured_mps:.2g}; where single beams are off, `bottomlock audit` names them.",
        "dvl.beam_noise_mps",
    )  # fmt: skip
