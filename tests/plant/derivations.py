"""Derivations of the coefficients for which no published value exists.

Each function is one method; the vehicle files cite them, and a test recomputes every value that cites one.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from bottomlock.plant.equations import myring_radius_m
from bottomlock.plant.vehicle import Hull


@dataclass(frozen=True)
class HullIntegrals:
    """Volume (m³), its centre aft of the nose (m), wetted and plan area (m²)."""

    volume_m3: float
    centre_from_nose_m: float
    wetted_area_m2: float
    plan_area_m2: float


def hull_integrals(hull: Hull, points: int = 20001) -> HullIntegrals:
    """Integrate Myring's shape by the trapezoid rule."""
    x = np.linspace(0.0, hull.length, points)
    radius = myring_radius_m(hull, x)
    section = np.pi * radius**2
    volume = float(trapezoid(section, x))
    slope = np.hypot(1.0, np.gradient(radius, x))
    return HullIntegrals(
        volume_m3=volume,
        centre_from_nose_m=float(trapezoid(section * x, x)) / volume,
        wetted_area_m2=float(trapezoid(2.0 * np.pi * radius * np.minimum(slope, 5.0), x)),
        plan_area_m2=float(trapezoid(2.0 * radius, x)),
    )


def lamb_factors(length_m: float, diameter_m: float) -> tuple[float, float, float]:
    """Lamb's k1, k2 and k' of a prolate spheroid.

    Sources: Lamb 1932 and Imlay 1961, as in MSS imlay61.m, which refers to Fossen 2021, section 8.4.2.
    """
    eccentricity2 = 1.0 - (diameter_m / length_m) ** 2
    e = math.sqrt(eccentricity2)
    log = math.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - eccentricity2) / e**3 * (0.5 * log - e)
    beta = 1.0 / eccentricity2 - (1.0 - eccentricity2) / (2.0 * e**3) * log
    difference = beta - alpha
    rotation = (
        eccentricity2**2
        * difference
        / ((2.0 - eccentricity2) * (2.0 * eccentricity2 - (2.0 - eccentricity2) * difference))
    )
    return alpha / (2.0 - alpha), beta / (2.0 - beta), rotation


def strip_added_mass(
    hull: Hull, density_kgpm3: float, fin_station_m: float, fin_chord_m: float, fin_tip_radius_m: float
) -> tuple[float, float, float]:
    """Cross-flow added mass by strips: -y_vdot (kg), -y_rdot (kg m), -n_rdot (kg m²) about the origin.

    A bare section has rho pi R²; along the fins' chord the section is a circle with a cross of fins, which
    has rho pi (a² - R² + R⁴ / a²) with a the tip radius (Prestero 2001, Eqs. 4.18 to 4.20, after Newman 1977
    and Blevins 1979). A cross has the same added mass at any roll angle, so the formula serves + and x.
    """
    x = np.linspace(0.0, hull.length, 20001)
    radius = myring_radius_m(hull, x)
    station = hull.centre_of_buoyancy_from_nose - x
    per_length = np.pi * density_kgpm3 * radius**2
    finned = np.abs(station - fin_station_m) <= 0.5 * fin_chord_m
    tip = fin_tip_radius_m
    per_length = np.where(
        finned, np.pi * density_kgpm3 * (tip**2 - radius**2 + radius**4 / tip**2), per_length
    )
    return (
        float(trapezoid(per_length, x)),
        float(trapezoid(per_length * station, x)),
        float(trapezoid(per_length * station**2, x)),
    )


def cross_fins_roll_added_inertia(density_kgpm3: float, fin_chord_m: float, fin_tip_radius_m: float) -> float:
    """-k_pdot of four equal fins along their chord, kg m²: (2/pi) rho a⁴ per length.

    Source: Prestero 2001, Eq. 4.21, after Blevins 1979.
    """
    return 2.0 / math.pi * density_kgpm3 * fin_tip_radius_m**4 * fin_chord_m


def axial_drag_kgpm(
    wetted_area_m2: float,
    hull: Hull,
    density_kgpm3: float,
    speed_mps: float,
    viscosity_m2ps: float,
    allowance: float,
) -> float:
    """Hull drag k of X = -k u|u|, kg/m.

    ITTC-57 friction (as in MSS XuuITTC.m), Hoerner's form factor of a body of revolution (Fluid-Dynamic Drag,
    1965; equation number not verified), and an allowance for roughness and appendages.
    """
    reynolds = speed_mps * hull.length / viscosity_m2ps
    friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2
    slenderness = hull.diameter / hull.length
    form = 1.0 + 1.5 * math.pow(slenderness, 1.5) + 7.0 * slenderness**3
    return 0.5 * density_kgpm3 * wetted_area_m2 * friction * form * (1.0 + allowance)


def body_lift_kgpm(hull: Hull, density_kgpm3: float) -> tuple[float, float]:
    """Hoerner's lift of a streamlined body: (k in Y = -k|u|v, centre of pressure x from the origin, m).

    k = rho d² c / 2 with c = 0.003 (l/d) per degree, stated for l/d from 6.7 to 10; it acts at 0.65 l from the
    nose (Prestero 2001, Eqs. 4.27 to 4.35, after Hoerner and Borst, Fluid-Dynamic Lift, 1985, page 13-3).
    """
    slope = 0.003 * hull.length / hull.diameter * 180.0 / math.pi
    return (
        0.5 * density_kgpm3 * hull.diameter**2 * slope,
        hull.centre_of_buoyancy_from_nose - 0.65 * hull.length,
    )


def fin_lift_slope(aspect_ratio: float) -> float:
    """Hoerner's lift slope of a low-aspect wing, per rad.

    1 / (1 / (2 pi 0.9) + 1 / (pi AR)); Prestero 2001, Eq. 4.38, after Hoerner and Borst 1985, page 3-2.
    """
    return 1.0 / (1.0 / (2.0 * math.pi * 0.9) + 1.0 / (math.pi * aspect_ratio))


def uniform_inertia(hull: Hull, mass_kg: float) -> tuple[float, float]:
    """Roll and pitch inertia (kg m²) about the origin of a mass spread evenly through the hull."""
    x = np.linspace(0.0, hull.length, 20001)
    area = np.pi * myring_radius_m(hull, x) ** 2
    station = hull.centre_of_buoyancy_from_nose - x
    density = mass_kg / float(trapezoid(area, x))
    half_square = area / (4.0 * np.pi)
    roll = density * float(trapezoid(2.0 * area * half_square, x))
    return roll, density * float(trapezoid(area * (station**2 + half_square), x))


def rolling_friction_kgm2(hull: Hull, density_kgpm3: float, friction: float) -> float:
    """Skin friction of a hull turning about its axis: k of K = -k |p| p, kg m².

    rho/2 c_f times the integral of 2 pi R⁴ dx.
    """
    x = np.linspace(0.0, hull.length, 20001)
    radius = myring_radius_m(hull, x)
    return 0.5 * density_kgpm3 * friction * float(trapezoid(2.0 * np.pi * radius**4, x))
