"""A study's directory: claimed when it is new, empty or of the same configuration; finished parts are kept."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.atomic_write import read_json, write_json, write_parquet
from bottomlock.config.scenario import Scenario
from bottomlock.errors import OutputError
from bottomlock.kernel import kernel_version
from bottomlock.tables.versions import library_versions

MANIFEST = "study.json"


def configuration_hash(content: Any) -> str:  # noqa: ANN401 - any JSON value
    """SHA-256 of the settings that determine a study's numbers."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def versions() -> dict[str, str]:
    """Versions of bottomlock and the libraries that computed the numbers."""
    return {"bottomlock": kernel_version()} | library_versions()


def made_with() -> str:
    """The versions in words."""
    return ", ".join(f"{name} {version}" for name, version in versions().items())


def campaign_values(scenarios: Iterable[Scenario], key: str) -> str:
    """The values of a key of `[campaign]` in words, each once: `50`, or `50, 60` where scenarios differ."""
    return ", ".join(dict.fromkeys(str(getattr(scenario.campaign, key)) for scenario in scenarios))


def finished_part(path: Path, run: Callable[[], pl.DataFrame]) -> pl.DataFrame:
    """The table in a file, which is run and written first where the file does not exist.

    Raises:
        OutputError: where it cannot be written.
    """
    if not path.exists():
        write_parquet(path, run())
    return pl.read_parquet(path)


def claim(out: Path, kind: str, configuration: str, *, parts: Iterable[str], force: bool = False) -> None:
    """Makes `out` the directory of this study; with `force` the `parts` of another of the same kind are removed.

    Raises:
        OutputError: for a directory that holds something else, or cannot be read or written.
    """
    try:
        occupied = out.exists() and (not out.is_dir() or any(out.iterdir()))
    except OSError as error:
        raise OutputError(f"{out}: cannot be read ({error.strerror})") from error
    if occupied:
        manifest = read_json(out / MANIFEST) if out.is_dir() else None
        if manifest is None or manifest.get("kind") != kind:
            raise OutputError(
                f"{out}: is not empty and holds no {kind} study of ours; choose another directory"
            )
        same = (
            manifest.get("configuration_hash") == configuration
            and manifest.get("version") == kernel_version()
        )
        if not same and not force:
            raise OutputError(
                f"{out}: holds a {kind} study of another configuration or version; "
                "choose another directory or use --force to start over"
            )
        if force:
            for part in parts:
                path = out / part
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    write_manifest(out, kind, configuration, status="running")


def write_manifest(out: Path, kind: str, configuration: str, *, status: str, **more: Any) -> None:  # noqa: ANN401
    """Writes the manifest of the directory, which the next command reads."""
    write_json(
        out / MANIFEST,
        {
            "kind": kind,
            "status": status,
            "version": kernel_version(),
            "versions": versions(),
            "configuration_hash": configuration,
            **more,
        },
    )
