"""Vehicle files: the packaged ones, and reading and checking of a user's own."""

from pathlib import Path
from typing import Any

from bottomlock.config.packaged import packaged_names, text_of
from bottomlock.config.toml_file import parse_toml
from bottomlock.config.validation import checked
from bottomlock.plant.hovering_vehicle import AnyVehicle, HoveringVehicle
from bottomlock.plant.vehicle import Vehicle


def packaged_vehicles() -> list[str]:
    """Names of the vehicles that ship with the package, sorted."""
    return packaged_names("vehicles")


def load_vehicle(name_or_path: str | Path) -> AnyVehicle:
    """Read and check a vehicle: a packaged name such as `tauv`, or a path to a TOML file.

    Raises:
        ScenarioError: naming table and coefficient, for one that is missing, has a wrong unit or is unphysical.

    >>> load_vehicle("tauv").limits.cruise_speed
    2.0
    """
    text, place = text_of("vehicle", name_or_path)
    return parse_vehicle(parse_toml(text, place=place, kind="vehicle"), place)


def parse_vehicle(tables: dict[str, Any], place: str) -> AnyVehicle:
    """Check vehicle tables already read from TOML; with `[thrusters]` they are those of a hovering vehicle.

    Raises:
        ScenarioError: with every fault found.
    """
    kind: type[AnyVehicle] = HoveringVehicle if "thrusters" in tables else Vehicle
    return checked(kind, tables, place)
