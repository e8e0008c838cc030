"""Vehicle files: every number has unit and source, derived ones recompute, bad ones are rejected."""

import copy
import math
import tomllib
from importlib import resources
from typing import Any

import numpy as np
import pytest

from bottomlock.errors import ScenarioError
from bottomlock.plant import Vehicle, load_vehicle, packaged_vehicles
from bottomlock.plant.equations import myring_radius_m
from bottomlock.plant.hovering_vehicle import parse_vehicle
from bottomlock.plant.trim import check_stability
from tests.plant import derivations
from tests.plant.helpers import GRAVITY_MPS2


@pytest.fixture
def tables() -> dict[str, Any]:
    text = (resources.files("bottomlock.config") / "vehicles" / "tauv.toml").read_text(encoding="utf-8")
    return copy.deepcopy(tomllib.loads(text))


@pytest.mark.parametrize("name", ["remus100", "tauv"])
def test_packaged_vehicles_load_and_are_stable_under_their_autopilot(name: str) -> None:
    assert name in packaged_vehicles()
    check_stability(load_vehicle(name), GRAVITY_MPS2)


def test_units_are_turned_into_si(tauv: Vehicle) -> None:
    assert tauv.hull.length == 3.0
    assert tauv.hull.diameter == pytest.approx(0.3)
    assert tauv.fins.azimuth[0] == pytest.approx(math.pi / 4)
    assert tauv.propeller.max_speed == pytest.approx(30.0)
    assert tauv.fins.area == pytest.approx(0.0171)


def test_tauv_coefficients_recompute_from_the_methods_they_cite(tauv: Vehicle) -> None:
    hull, fins, water = tauv.hull, tauv.fins, tauv.water.density
    integrals = derivations.hull_integrals(hull)
    k1, _, _ = derivations.lamb_factors(hull.length, hull.diameter)
    chord, tip = 0.14, 0.22
    sway, coupling, yaw = derivations.strip_added_mass(hull, water, fins.position_x, chord, tip)
    axial = derivations.axial_drag_kgpm(
        integrals.wetted_area_m2, hull, water, speed_mps=2.0, viscosity_m2ps=1.2e-6, allowance=0.3
    )
    lift, pressure_point = derivations.body_lift_kgpm(hull, water)
    roll_inertia, pitch_inertia = derivations.uniform_inertia(hull, tauv.rigid_body.mass)
    (root,) = myring_radius_m(hull, np.array([hull.centre_of_buoyancy_from_nose - fins.position_x]))
    expected = {
        "displaced_volume": (tauv.rigid_body.displaced_volume, integrals.volume_m3),
        "mass": (tauv.rigid_body.mass, water * integrals.volume_m3 / 1.003),
        "centre": (hull.centre_of_buoyancy_from_nose, integrals.centre_from_nose_m),
        "inertia_xx": (tauv.rigid_body.inertia_xx, roll_inertia),
        "inertia_yy": (tauv.rigid_body.inertia_yy, pitch_inertia),
        "axial_drag": (hull.axial_drag, axial),
        "lift": (hull.lift, lift),
        "pressure_point": (hull.centre_of_pressure_x, pressure_point),
        "x_udot": (-tauv.added_mass.x_udot, k1 * tauv.rigid_body.mass),
        "y_vdot": (-tauv.added_mass.y_vdot, sway),
        "n_rdot": (-tauv.added_mass.n_rdot, yaw),
        "y_rdot": (-tauv.added_mass.y_rdot, coupling),
        "z_qdot": (tauv.added_mass.z_qdot, coupling),
        "k_pdot": (-tauv.added_mass.k_pdot, derivations.cross_fins_roll_added_inertia(water, chord, tip)),
        "fin_radius": (fins.centre_radius, 0.5 * (root + tip)),
        "fin_area": (fins.area, chord * (tip - root)),
        "lift_slope": (fins.lift_slope, derivations.fin_lift_slope(fins.aspect_ratio)),
        "roll_drag": (hull.roll_drag, derivations.rolling_friction_kgm2(hull, water, friction=0.004) * 1.5),
    }
    for name, (written, derived) in expected.items():
        assert written == pytest.approx(derived, rel=0.006), name


def test_lamb_factors_of_known_spheroids() -> None:
    """Lamb 1932, his table of spheroids: a/b = 5.01 gives 0.059 and 0.895; a sphere gives one half."""
    k1, k2, k_rotation = derivations.lamb_factors(5.01, 1.0)
    assert (k1, k2, k_rotation) == pytest.approx((0.059, 0.895, 0.701), abs=2e-3)
    near_sphere = derivations.lamb_factors(1.001, 1.0)
    assert near_sphere[:2] == pytest.approx((0.5, 0.5), abs=2e-3)


def _set(tables: dict[str, Any], path: str, **entries: object) -> None:
    *parents, last = path.split(".")
    place = tables
    for parent in parents:
        place = place[parent]
    place[last].update(entries)


@pytest.mark.parametrize(
    ("path", "entries", "words"),
    [
        ("rigid_body.inertia_yy", {"value": -105.0}, r"rigid_body\.inertia_yy.*above 0"),
        (
            "rigid_body.mass",
            {"unit": "lb"},
            r"rigid_body\.mass: unit 'lb' is not one of this coefficient, expected kg",
        ),
        (
            "hull.length",
            {"unit": "kg"},
            r"hull\.length: unit 'kg' is not one of this coefficient, expected m or mm",
        ),
        ("hull.lift", {"value": float("nan")}, r"hull\.lift: value nan is not a finite number"),
        ("hull.lift", {"source": " "}, r"hull\.lift: 'source' is empty"),
        ("hull.lift", {"uncertainty": 3.0}, r"hull\.lift: unknown key 'uncertainty'"),
        ("rigid_body.centre_of_gravity_z", {"value": -0.02}, "below the centre of buoyancy"),
        ("rigid_body.inertia_zz", {"value": 500.0}, "largest inertia exceeds"),
        ("added_mass.y_vdot", {"value": 199.0}, r"added_mass\.y_vdot: must not be positive"),
        ("added_mass.y_rdot", {"value": 900.0}, r"added_mass\.y_rdot: .*negative eigenvalue"),
        ("rigid_body.displaced_volume", {"value": 1.8}, r"buoyancy is 9\.981 of the weight"),
        ("propeller.rotation", {"value": 0}, r"propeller\.rotation: expected 1"),
        ("limits.min_speed", {"value": 2.5}, "min_speed <= cruise_speed <= max_speed"),
        ("hull.nose_length", {"value": 2.9}, "longer than the hull"),
    ],
)
def test_bad_coefficients_are_named(
    tables: dict[str, Any], path: str, entries: dict[str, Any], words: str
) -> None:
    _set(tables, path, **entries)
    with pytest.raises(ScenarioError, match=words):
        parse_vehicle(tables, "bad")


def test_a_missing_coefficient_and_a_bare_number_are_named(tables: dict[str, Any]) -> None:
    tables["hull"]["length"] = 3.0
    with pytest.raises(ScenarioError, match=r"hull\.length: expected a table"):
        parse_vehicle(tables, "bad")
    del tables["hull"]["length"]
    with pytest.raises(ScenarioError, match=r"'hull\.length' is missing"):
        parse_vehicle(tables, "bad")


def test_an_unstable_trim_is_refused(tables: dict[str, Any]) -> None:
    """Without rate feedback a stiff pitch loop oscillates ever wider."""
    _set(tables, "autopilot.pitch.derivative", value=0.0)
    _set(tables, "autopilot.pitch.proportional", value=30.0)
    with pytest.raises(ScenarioError, match=r"trim at .* m/s is unstable under its autopilot"):
        check_stability(parse_vehicle(tables, "bad"), GRAVITY_MPS2)


def test_a_trim_beyond_the_shaft_is_refused(tables: dict[str, Any]) -> None:
    _set(tables, "propeller.max_speed", value=400.0)
    with pytest.raises(ScenarioError, match=r"needs the shaft at .* rpm, beyond its limit"):
        check_stability(parse_vehicle(tables, "bad"), GRAVITY_MPS2)


def test_every_coefficient_of_the_packaged_files_has_a_source() -> None:
    def walk(table: dict[str, Any]) -> int:
        if "value" in table:
            assert table["source"].strip()
            assert table["unit"]
            return 1
        rows = [row for value in table.values() for row in (value if isinstance(value, list) else [value])]
        return sum(walk(row) for row in rows if isinstance(row, dict))

    for name in packaged_vehicles():
        text = (resources.files("bottomlock.config") / "vehicles" / f"{name}.toml").read_text(
            encoding="utf-8"
        )
        assert walk(tomllib.loads(text)) > 70
