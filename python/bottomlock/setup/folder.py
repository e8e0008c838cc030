"""The folder of a vehicle's set-up: configuration, geometry, the form that they were made from, raw logs."""

import contextlib
import hashlib
import os
import secrets
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from bottomlock.errors import DataError, OutputError, ScenarioError
from bottomlock.files.atomic_write import read_json, write_json, write_text
from bottomlock.live.config import LiveConfig, load_config, parse_config
from bottomlock.setup.addresses import check_by_hand
from bottomlock.setup.form import LOGS, SetupForm, config_text, geometry_of

CONFIG, STATE, TOKEN = "live.toml", "setup.json", "token"


@dataclass(frozen=True)
class RawLogFile:
    """A raw log: name, bytes, time of its last change, s since 1970."""

    name: str
    bytes: int
    changed_s: float


class SetupFolder:
    """Reads and writes that folder; every file whole or not at all.

    Args:
        folder: made where it is missing, at the first file that is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config = folder / CONFIG

    def _state(self) -> dict[str, Any]:
        """What was saved; nothing where it cannot be read, and the form then has its defaults."""
        try:
            return read_json(self.folder / STATE) or {}
        except DataError:
            return {}

    def form(self) -> SetupForm | None:
        """The form that was saved last; None for none, or one of another version that is no longer valid."""
        try:
            return SetupForm.model_validate(self._state()["form"])
        except (KeyError, ValidationError):
            return None

    @property
    def shall_run(self) -> bool:
        """Whether live was running when this was last said: it begins again after a loss of power."""
        return self._state().get("running") is True

    @shall_run.setter
    def shall_run(self, running: bool) -> None:
        write_json(self.folder / STATE, self._state() | {"running": running})

    def token(self) -> str:
        """The secret part of the page's address beyond the loopback address, made once; for its owner's eyes alone.

        Raises:
            OutputError: where it can neither be read nor made.
        """
        file = self.folder / TOKEN
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with (
                contextlib.suppress(FileExistsError),
                os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as new,
            ):
                new.write(secrets.token_urlsafe(16))
            token = file.read_text(encoding="ascii").strip()
        except (OSError, ValueError) as error:
            raise OutputError(f"cannot be made or read ({error})", place=file) from error
        if not token:
            raise OutputError("is empty", place=file, hint="remove it")
        return token

    def text(self) -> str | None:
        """The configuration; None for none."""
        try:
            return self.config.read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            return None

    def by_hand(self) -> bool:
        """Whether the configuration is another than the one that the form made."""
        text = self.text()
        return text is not None and _digest(text) != self._state().get("sha256")

    def save(self, form: SetupForm) -> None:
        """Writes geometry and configuration of a form, once `bottomlock live` would accept them.

        The geometry is named after its content, so that the one step of replacing the configuration replaces both.

        Raises:
            ScenarioError: as `load_config`; nothing is then changed.
            OutputError: where a file cannot be written.
        """
        geometry = geometry_of(form)
        name = f"geometry-{_digest(geometry)[:8]}.toml"
        text = config_text(form, name)
        with tempfile.TemporaryDirectory() as trial:
            (Path(trial) / name).write_text(geometry, encoding="utf-8")
            parse_config(text, place=CONFIG, folder=Path(trial))
        write_text(self.folder / name, geometry)
        write_text(self.config, text)
        write_json(self.folder / STATE, self._state() | {"form": form.model_dump(), "sha256": _digest(text)})
        for old in self.folder.glob("geometry-????????.toml"):
            if old.name != name:
                old.unlink(missing_ok=True)

    def settings(self) -> LiveConfig:
        """The configuration, read and checked.

        Raises:
            ScenarioError: as `load_config` and `check_by_hand`, and where nothing was saved yet.
        """
        if not self.config.exists():
            raise ScenarioError("there is no configuration yet: save the form first")
        config = load_config(self.config)
        check_by_hand(config, str(self.config))
        return config

    def logs(self) -> list[RawLogFile]:
        """The raw logs, the last one first."""
        try:
            entries = list(os.scandir(self.folder / LOGS))
        except (FileNotFoundError, NotADirectoryError):
            return []
        found = []
        for entry in entries:
            if entry.name.endswith(".mcap") and entry.is_file(follow_symlinks=False):
                known = entry.stat(follow_symlinks=False)
                found.append(RawLogFile(entry.name, known.st_size, known.st_mtime))
        return sorted(found, key=lambda one: one.name, reverse=True)

    def log(self, name: str) -> Path | None:
        """The raw log of a name, only if it is one of `logs`: no path leads out of the folder."""
        return self.folder / LOGS / name if name in {one.name for one in self.logs()} else None


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
