"""State histories cached on disk under a hash of everything that determines them."""

import contextlib
import hashlib
import io
import json
import os
import sys
import zipfile
from dataclasses import asdict
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np

from bottomlock.errors import DataError, OutputError, note
from bottomlock.files.atomic_write import write_bytes
from bottomlock.files.records import MissingFileError, read_record, read_recorded, record_of, write_record
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.mission import Mission
from bottomlock.plant.swim import StateHistory

_ARRAYS = ("time_ns", "state", "acceleration", "velocity_through_water_p_mps", "segment")


def cache_folder() -> Path:
    """Cache folder: BOTTOMLOCK_CACHE if set, else the platform's own."""
    chosen = os.environ.get("BOTTOMLOCK_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "bottomlock" / "histories"


def history_key(vehicle: AnyVehicle, mission: Mission, *, gravity_mps2: float, imu_rate_hz: float) -> str:
    """SHA-256 over vehicle, mission, gravity, rate and the plant's own source, as 64 hex digits."""
    content = {
        "vehicle": vehicle.model_dump(mode="json"),
        "mission": asdict(mission),
        "settings": {"gravity_mps2": gravity_mps2, "imu_rate_hz": imu_rate_hz},
        "source": _source_digest(),
        "numpy": np.__version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=1)
def _source_digest() -> str:
    digest = hashlib.sha256()
    for entry in sorted(resources.files("bottomlock.plant").iterdir(), key=lambda item: item.name):
        if entry.name.endswith(".py"):
            digest.update(entry.name.encode() + b"\0" + entry.read_bytes() + b"\0")
    return digest.hexdigest()


def load_history(key: str) -> StateHistory | None:
    """The cached history; None where there is none, and, with a note, where it has changed since it was written."""
    path = cache_folder() / f"{key}.npz"
    try:
        record = read_record(record_of(path))
        if record is None:
            return None
        content = read_recorded(path, record, remedy="it is computed again")
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            return StateHistory(**{name: archive[name] for name in _ARRAYS})
    except MissingFileError:
        return None
    except (DataError, OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        note(f"cached truth: {error}")
        return None


def store_history(key: str, history: StateHistory) -> None:
    """Writes a history to the cache, atomically; a cache that cannot be written is ignored."""
    path = cache_folder() / f"{key}.npz"
    content = io.BytesIO()
    np.savez(content, **{name: getattr(history, name) for name in _ARRAYS})
    with contextlib.suppress(OutputError):
        write_record(record_of(path), {"key": key}, {path.name: write_bytes(path, content.getbuffer())})
