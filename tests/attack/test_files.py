"""Single bits of the files of a replay are flipped: an error of one line, or the same tables."""

import hashlib
import io
import random
from pathlib import Path

import polars as pl

from bottomlock.errors import BottomlockError
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.replay.report import read_replay
from bottomlock.replay.run import KIND, TABLES, write_replay


def digest_of(folder: Path) -> str:
    """SHA-256 of all that is read: columns, types and every value."""
    tables = read_replay(folder)
    stated = pl.DataFrame({"manifest": [repr(sorted(tables.manifest.items()))]})
    digest = hashlib.sha256()
    for frame in (stated, *(getattr(tables, name) for name in (*TABLES, "path"))):
        content = io.BytesIO()
        frame.write_ipc(content)
        digest.update(content.getvalue())
    return digest.hexdigest()


def silent_flips(folder: Path, count: int) -> list[str]:
    """Of so many flipped bits of a replay those that change what is read without an error of one line."""
    part = pl.DataFrame({"run": range(20), "error_m": [0.1 * k for k in range(20)]})
    frames = {name: part.with_columns(table=pl.lit(name)) for name in (*TABLES, "path")}
    manifest = {"kind": KIND, "status": "complete", "configuration_hash": "a" * 64, "wall_time_s": 1.5}
    write_replay(ReplayTables(**frames, manifest=manifest), folder)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    expected, rng, silent = digest_of(folder), random.Random(16), []
    for _ in range(count):
        path = rng.choice(files)
        whole = path.read_bytes()
        bit = rng.randrange(8 * len(whole))
        path.write_bytes(whole[: bit // 8] + bytes([whole[bit // 8] ^ 1 << bit % 8]) + whole[bit // 8 + 1 :])
        try:
            is_told = digest_of(folder) == expected
        except BottomlockError as error:
            is_told = "\n" not in str(error)
        path.write_bytes(whole)
        silent += [] if is_told else [f"bit {bit} of {path.name}"]
    return silent


def test_no_bit_changes_a_table_in_silence(tmp_path: Path) -> None:
    assert silent_flips(tmp_path, 40) == []
