"""A tuned case as a file: the user's text with the new values, each with its 1 sigma and gain, and a record in JSON."""

import hashlib
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock import kernel
from bottomlock.config.toml_edit import edited
from bottomlock.config.toml_file import read_text
from bottomlock.errors import OutputError
from bottomlock.files.atomic_write import plain, write_text
from bottomlock.files.overwriting import check_apart, check_free
from bottomlock.files.records import write_record
from bottomlock.files.versions import library_versions
from bottomlock.io.beams import geometry_text
from bottomlock.replay.case import parse_case
from bottomlock.replay.run import file_digests
from bottomlock.replay.tune.run import Tuned, TunedParameter

KIND = "tune"


def record_of(out: Path) -> Path:
    """The record beside a tuned case."""
    return out.with_suffix(".json")


def require_free(path: Path, out: Path, *, inputs: Iterable[Path] = (), force: bool) -> None:
    """Checks where the tuned case is to go.

    Raises:
        OutputError: for a name that is not that of a TOML file, the case itself or one of the files it reads, another
            folder, and a file that is there already without `force`.
    """
    if out.suffix.lower() != ".toml":
        raise OutputError(place=out, expected="a name that ends in .toml, the tuned case to write")
    if out.parent.resolve() != path.parent.resolve():
        raise OutputError(
            f"the case names its files relative to {path.parent}",
            place=out,
            hint="write the tuned case into the same folder",
        )
    check_apart([record_of(out)], [path, *inputs])
    check_free(out, inputs=[path, *inputs], force=force)


def rounded(one: TunedParameter) -> float:
    """The value to as many digits as its 1 sigma is worth: two of the 1 sigma, but three at least."""
    digits = 3
    if one.sd > 0.0 and one.value != 0.0:
        digits = max(3, 2 + int(np.floor(np.log10(abs(one.value))) - np.floor(np.log10(one.sd))))
    return float(f"{one.value:.{digits}g}")


def remark(one: TunedParameter) -> str:
    """The comment beside a tuned value."""
    old = f"{one.old:.3g}" if one.old != 0.0 else "none"
    return f"tuned: ± {one.sd:.2g} (1 sigma), was {old}, log-likelihood gain {one.gain:.3g}"


def tuned_text(path: Path, tuned: Tuned) -> str:
    """The text of the case with its tuned values, and with its ends of lines.

    Raises:
        ScenarioError: for a key that is not on a line of its own.
    """
    chosen = [one for one in tuned.parameters if one.key in tuned.values]
    values = {one.key: rounded(one) for one in chosen}
    text = edited(read_text(path), values, {one.key: remark(one) for one in chosen}, place=str(path))
    parse_case(text, place=str(path), folder=path.parent)
    return text.replace("\n", "\r\n") if b"\r\n" in path.read_bytes() else text


def write_tuned(path: Path, tuned: Tuned, out: Path, *, force: bool = False) -> None:
    """Writes the tuned case, and beside it the record of how it was found.

    Raises:
        OutputError: as `require_free`, or where a file cannot be written.
        ScenarioError: as `tuned_text`.
    """
    require_free(path, out, force=force)
    digests = {out.name: write_text(out, tuned_text(path, tuned))}
    write_record(record_of(out), {"status": "complete"} | record(tuned), digests)


def record(tuned: Tuned) -> dict[str, Any]:
    """What was tuned, by versions, case and files with their SHA-256, and what was found, as JSON holds it."""
    case = tuned.case
    found = {
        one.name: getattr(tuned, one.name) for one in fields(tuned) if one.name not in {"case", "parameters"}
    }
    content: dict[str, Any] = plain(
        {
            "kind": KIND,
            "version": kernel.kernel_version(),
            "versions": library_versions(),
            "case": case.name,
            "configuration_hash": case.content_hash(),
            "files": file_digests(case),
            "dvl_file": hashlib.sha256(geometry_text(case.dvl.geometry).encode()).hexdigest(),
            "is_better": tuned.is_better,
            "parameters": [vars(one) | {"is_written": one.key in tuned.values} for one in tuned.parameters],
        }
        | found
    )
    return content
