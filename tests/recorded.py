"""Records stated again: for tests that change files on purpose and want the change to be believed."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.records import DIGESTS, OWN_DIGEST, write_record


def edit_record(path: Path, edit: Callable[[dict[str, Any]], object] = lambda _: None) -> None:
    """Changes entries of a record and states its files as they are now, so that its digests are right again."""
    content = json.loads(path.read_text(encoding="utf-8"))
    content.pop(OWN_DIGEST, None)
    digests = {
        name: hashlib.sha256((path.parent / name).read_bytes()).hexdigest()
        for name in content.pop(DIGESTS, {})
        if (path.parent / name).is_file()
    }
    edit(content)
    write_record(path, content, digests)


def add_table(folder: Path, name: str, frame: pl.DataFrame) -> None:
    """Writes a table of a campaign, and states it in the campaign's manifest."""
    record = folder / "manifest.json"
    content = json.loads(record.read_text(encoding="utf-8"))
    content.pop(OWN_DIGEST, None)
    digests = content.pop(DIGESTS, {})
    write_record(record, content, digests | {name: write_parquet(folder / name, frame)})
