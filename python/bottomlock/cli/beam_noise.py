"""Lines about the beam noise that was measured on a log."""

import numpy as np
from numpy.typing import NDArray

from bottomlock.cli.console import console
from bottomlock.replay.beam_noise import BeamNoise
from bottomlock.statistics.rms import rms


def print_noise(noise: BeamNoise, sd_mps: NDArray[np.float64]) -> None:
    """A line per group of pings: claimed and measured standard deviation, their ratio, and the tail."""
    claimed = 1e3 * float(rms(sd_mps))
    for group in noise.groups:
        words = f"beam noise, {group.name}: claimed sd {claimed:.3g} mm/s, "
        if group.fallback:
            use = f"factor {group.factor:.3g} is used" if group.factor != 1.0 else "the claimed sd is used"
            words += f"not measured ({group.fallback}); {use}"
        else:
            _, two, three = group.halfwidths
            words += (
                f"measured {claimed * group.factor:.3g} mm/s on {group.pings} pings with every beam, factor "
                f"{group.factor:.3g}; Student's t with {group.degrees:.3g} degrees of freedom: 95.4 % within "
                f"{two:.3g} sd, 99.7 % within {three:.3g} sd"
            )
        console.print(words, highlight=False)
