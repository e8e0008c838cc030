"""What a digest of a mission is of: whole numbers of steps, so that neither the file format nor last bits matter.

Every value of a mission is a whole number of steps of its column (`STEPS`), to which it was rounded when it was made.
The digest is the SHA-256 of the columns' names and of these whole numbers, as little-endian int64.
Another machine's arithmetic may differ in the last bits; a value then changes only if it lies that near the middle
between two steps.
"""

import hashlib
from collections.abc import Mapping
from importlib import resources

import numpy as np
import polars as pl

from bottomlock.config.toml_file import parse_toml

STEPS: Mapping[str, float] = {
    "radps": 2.0**-22,
    "mps2": 2.0**-16,
    "mps": 2.0**-20,
    "m": 2.0**-13,
    "rad": 2.0**-20,
    "attitude": 2.0**-30,
    "quality": 1.0,
}
"""Step of a column by the last word of its name (rad/s, m/s², m/s, m, rad, counts), and of parts of a quaternion."""

MISSING = np.iinfo(np.int64).min


def step_of(column: str) -> float | None:
    """The step of a column; None for times and flags, which are whole already.

    >>> step_of("beam1_mps") == 2.0**-20, step_of("time_ns"), step_of("attitude_w") == 2.0**-30
    (True, None, True)
    """
    return STEPS.get("attitude" if column.startswith("attitude_") else column.rsplit("_", 1)[-1])


def rounded(frame: pl.DataFrame) -> pl.DataFrame:
    """The table with every value rounded to the step of its column."""
    changes = [
        ((pl.col(name) / step).round() * step).alias(name)
        for name in frame.columns
        if (step := step_of(name)) is not None
    ]
    return frame.with_columns(changes)


def digest(tables: Mapping[str, pl.DataFrame], text: str = "") -> str:
    """SHA-256, 64 hex digits, of tables by name and of a text.

    Examples:
        >>> one = pl.DataFrame({"time_ns": [1], "beam1_mps": [0.5]})
        >>> digest({"beams": one}) == digest({"beams": one.with_columns(pl.col("beam1_mps") + 1e-9)})
        True
        >>> digest({"beams": one}) == digest({"beams": one.with_columns(pl.col("beam1_mps") + 1e-6)})
        False
    """
    total = hashlib.sha256(text.encode())
    for name in sorted(tables):
        for column in tables[name].iter_columns():
            total.update(f"\0{name}.{column.name}\0".encode())
            total.update(_whole(column).astype("<i8").tobytes())
    return total.hexdigest()


def _whole(column: pl.Series) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    step = step_of(column.name)
    if step is None:
        return column.cast(pl.Int64).to_numpy()
    values = column.cast(pl.Float64).fill_null(np.nan).to_numpy()
    known = np.isfinite(values)
    whole = np.rint(np.where(known, values, 0.0) / step).astype(np.int64)
    return np.where(known, whole, MISSING)


def published() -> dict[str, dict[str, str]]:
    """The committed digests: of each mission its `data` and its `truth` (digests.toml)."""
    text = (resources.files("partialdvl_bench") / "digests.toml").read_text(encoding="utf-8")
    content: dict[str, dict[str, str]] = parse_toml(text, place="partialdvl_bench/digests.toml")
    return content
