"""A tuned case as a file: the user's text with the new values, each with its 1 sigma and gain, and a record in JSON."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock import kernel
from bottomlock.atomic_write import write_text
from bottomlock.config.toml_edit import edited
from bottomlock.config.toml_file import read_text
from bottomlock.errors import OutputError
from bottomlock.records import read_record, write_record
from bottomlock.replay.case import Case, parse_case
from bottomlock.replay.tune.run import Tuned, TunedParameter

KIND = "tune"


def record_of(out: Path) -> Path:
    """The record beside a tuned case."""
    return out.with_suffix(".json")


def require_free(path: Path, out: Path, *, force: bool) -> None:
    """Checks where the tuned case is to go.

    Raises:
        OutputError: for a name that is not that of a TOML file, the case itself, another folder, and a file that is
            there already without `force`.
    """
    if out.suffix.lower() != ".toml":
        raise OutputError(f"{out}: expected a name that ends in .toml, the tuned case to write")
    if out.resolve() == path.resolve():
        raise OutputError(f"{out}: is the case itself; choose another name for the tuned one")
    if out.parent.resolve() != path.parent.resolve():
        raise OutputError(
            f"{out}: the case names its files relative to {path.parent}; write the tuned case into the same folder"
        )
    if out.exists() and not force:
        raise OutputError(f"{out}: is there already; choose another name, or use --force to replace it")


def rounded(one: TunedParameter) -> float:
    """The value to as many digits as its 1 sigma is worth: two of the 1 sigma, but three at least."""
    digits = 3
    if one.sd > 0.0:
        digits = max(3, 2 + int(np.floor(np.log10(one.value)) - np.floor(np.log10(one.sd))))
    return float(f"{one.value:.{digits}g}")


def remark(one: TunedParameter) -> str:
    """The comment beside a tuned value."""
    old = f"{one.old:.3g}" if one.old > 0.0 else "none"
    return f"tuned: ± {one.sd:.2g} (1 sigma), was {old}, log-likelihood gain {one.gain:.3g}"


def tuned_text(path: Path, tuned: Tuned) -> str:
    """The text of the case with its tuned values; as it is where the new ones are not better.

    Raises:
        ScenarioError: for a key that is not on a line of its own.
    """
    text = read_text(path)
    chosen = [one for one in tuned.parameters if one.key in tuned.values]
    if not chosen:
        return text
    result = edited(
        text,
        {one.key: rounded(one) for one in chosen},
        {one.key: remark(one) for one in chosen},
        place=str(path),
    )
    parse_case(result, place=str(path), folder=path.parent)
    return result


def write_tuned(path: Path, tuned: Tuned, out: Path, *, force: bool = False) -> None:
    """Writes the tuned case, and beside it the record of how it was found.

    Raises:
        OutputError: as `require_free`, or where a file cannot be written.
        ScenarioError: as `tuned_text`.
    """
    require_free(path, out, force=force)
    digest = write_text(out, tuned_text(path, tuned))
    write_record(record_of(out), {"status": "complete"} | record(tuned), {out.name: digest})


def record(tuned: Tuned) -> dict[str, Any]:
    """What was found, as JSON holds it."""
    content: dict[str, Any] = _finite(
        {
            "kind": KIND,
            "version": kernel.kernel_version(),
            "case": tuned.case.name,
            "configuration_hash": tuned.case.content_hash(),
            "is_better": tuned.is_better,
            "parameters": [asdict(one) for one in tuned.parameters],
            "horizons_s": list(tuned.horizons_s),
            "fraction": tuned.fraction,
            "outliers": list(tuned.outliers),
            "old": None if tuned.old is None else asdict(tuned.old),
            "new": None if tuned.new is None else asdict(tuned.new),
            "gain": tuned.gain,
            "gain_sd": tuned.gain_sd,
            "has_settled": tuned.has_settled,
            "iterations": tuned.iterations,
            "passes": tuned.passes,
            "wall_s": round(tuned.wall_s, 3),
        }
    )
    return content


def _finite(value: Any) -> Any:  # noqa: ANN401 - a value of a record
    """The same without what JSON cannot hold."""
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def write_unfinished(out: Path, case: Case, values: Mapping[str, float]) -> None:
    """Writes the settings that an interrupted search has come to, for `unfinished`."""
    content = {
        "kind": KIND,
        "status": "running",
        "configuration_hash": case.content_hash(),
        "values": dict(values),
    }
    write_record(record_of(out), content, {})


def unfinished(out: Path, case: Case) -> dict[str, float]:
    """The settings of an interrupted search over the same case; empty without one."""
    content = read_record(record_of(out))
    if content is None or content.get("kind") != KIND or content.get("status") != "running":
        return {}
    return dict(content["values"]) if content["configuration_hash"] == case.content_hash() else {}
