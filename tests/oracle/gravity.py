"""Normal gravity by latitude (WGS 84, Somigliana) and its growth with depth in the sea.

Going down in a mass of water, gravity grows by the free-air gradient (the Earth's centre is nearer) and falls by the
attraction of the water left above. Poisson's equation, div g = −4πGρ + 2Ω², gives for a level layer
dg/dz = 2g/r − 4πGρ: 3.086e-6 less 8.6e-7, that is 2.2e-6 m/s² per metre. The kernel keeps 2.226e-6.
"""

import numpy as np

GRAVITATIONAL_CONSTANT = 6.6743e-11
SEA_WATER_KGPM3 = 1025.0

# Defining constants of WGS 84; the formula constant k follows from them.
SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1 / 298.257223563
EQUATOR_MPS2 = 9.7803253359
POLE_MPS2 = 9.8321849378


def somigliana(latitude_rad: float) -> float:
    """Normal gravity on the ellipsoid, m/s², in Somigliana's own symmetric form.

    (a γ_e cos²φ + b γ_p sin²φ) / √(a² cos²φ + b² sin²φ)
    """
    a, b = SEMI_MAJOR_M, SEMI_MAJOR_M * (1 - FLATTENING)
    c2, s2 = np.cos(latitude_rad) ** 2, np.sin(latitude_rad) ** 2
    return float((a * EQUATOR_MPS2 * c2 + b * POLE_MPS2 * s2) / np.sqrt(a**2 * c2 + b**2 * s2))


def free_air_gradient() -> float:
    """Mean free-air gradient 2 g (1 + f + m − ...)/r over the ellipsoid, 1/s²; 3.086e-6 by convention."""
    return 3.086e-6


def depth_gradient(density_kgpm3: float = SEA_WATER_KGPM3) -> float:
    """Growth of gravity per metre downwards in water, 1/s²."""
    return free_air_gradient() - 4 * np.pi * GRAVITATIONAL_CONSTANT * density_kgpm3
