"""State histories cached on disk under a hash of everything that determines them."""

import hashlib
import json
import os
import sys
import tempfile
import zipfile
from dataclasses import asdict
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np

from bottomlock.plant.mission import Mission
from bottomlock.plant.swim import StateHistory
from bottomlock.plant.vehicle import Vehicle

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


def history_key(vehicle: Vehicle, mission: Mission, **settings: float) -> str:
    """SHA-256 over vehicle, mission, settings and the plant's own source, as 64 hex digits."""
    content = {
        "vehicle": vehicle.model_dump(mode="json"),
        "mission": asdict(mission),
        "settings": settings,
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
    """The cached history, or None where there is none or the file is damaged."""
    path = cache_folder() / f"{key}.npz"
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return StateHistory(**{name: archive[name] for name in _ARRAYS})
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def store_history(key: str, history: StateHistory) -> None:
    """Writes a history to the cache, atomically; a cache that cannot be written is ignored."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=folder, suffix=".partial")
    except OSError:
        return
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **{name: getattr(history, name) for name in _ARRAYS})
        Path(temporary).replace(folder / f"{key}.npz")
    except OSError:
        Path(temporary).unlink(missing_ok=True)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
