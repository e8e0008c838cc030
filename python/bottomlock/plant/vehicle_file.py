"""Vehicle files: the packaged ones, and reading and checking of a user's own."""

from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from bottomlock.config.toml_file import note_file_beside, parse_toml, read_text
from bottomlock.config.validation import refusal
from bottomlock.errors import ScenarioError
from bottomlock.plant.hovering_vehicle import AnyVehicle, HoveringVehicle
from bottomlock.plant.vehicle import Vehicle
from bottomlock.support.nearest import guess


def packaged_vehicles() -> list[str]:
    """Names of the vehicles that ship with the package, sorted."""
    folder = resources.files("bottomlock.config") / "vehicles"
    return sorted(
        entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")
    )


def load_vehicle(name_or_path: str | Path) -> AnyVehicle:
    """Read and check a vehicle: a packaged name such as `tauv`, or a path to a TOML file.

    Raises:
        ScenarioError: naming table and coefficient, for one that is missing, has a wrong unit or is unphysical.

    >>> load_vehicle("tauv").limits.cruise_speed
    2.0
    """
    text, label = _read(name_or_path)
    return parse_vehicle(parse_toml(text, place=f"vehicle {label}", kind="vehicle"), label)


def parse_vehicle(tables: dict[str, Any], label: str) -> AnyVehicle:
    """Check vehicle tables already read from TOML; with `[thrusters]` they are those of a hovering vehicle.

    Raises:
        ScenarioError: with every fault found.
    """
    kind: type[AnyVehicle] = HoveringVehicle if "thrusters" in tables else Vehicle
    try:
        return kind.model_validate(tables)
    except ValidationError as error:
        raise refusal(error, f"vehicle {label}", kind) from error


def _read(name_or_path: str | Path) -> tuple[str, str]:
    if isinstance(name_or_path, str) and name_or_path in packaged_vehicles():
        note_file_beside("vehicle", name_or_path)
        entry = resources.files("bottomlock.config") / "vehicles" / f"{name_or_path}.toml"
        return entry.read_text(encoding="utf-8"), name_or_path
    path = Path(name_or_path)
    if not path.is_file():
        known = packaged_vehicles()
        raise ScenarioError(
            "is neither a packaged vehicle nor a file",
            key=f"vehicle '{name_or_path}'",
            expected=f"a file, or one of {', '.join(known)}",
            hint=guess(str(name_or_path), known),
        )
    return read_text(path), str(path)
