"""Selections of the selecting methods, counted over runs at each ping."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.kernel import NO_CHOICE, SELECTION_REASONS, SELECTOR_METHODS, SOURCES
from bottomlock.tables.campaign import CHOICES

_AXES = ("surge", "sway", "heave")


def choice_counts(
    choice: NDArray[np.uint8], *, trajectory: str, methods: Sequence[str], dvl_time_ns: NDArray[np.int64]
) -> pl.DataFrame:
    """Counts of a batch's choices (runs, methods, pings, 3), `tables.campaign.CHOICES`.

    The selector of the paper has a source for each component, the consistent selector a filter and a reason.
    """
    times, counts = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    keys: list[tuple[str, str, str]] = []
    for number, method in enumerate(methods):
        codes = choice[:, number]
        if not codes.size or (codes[..., 0] == NO_CHOICE).all():
            continue
        words = (
            (SELECTOR_METHODS, SELECTION_REASONS) if (codes[..., 2] == NO_CHOICE).all() else (SOURCES,) * 3
        )
        names = ("filter", "reason") if len(words) == 2 else _AXES
        for k, (name, known) in enumerate(zip(names, words, strict=True)):
            for code, source in enumerate(known):
                count = (codes[..., k] == code).sum(axis=0)
                seen = np.flatnonzero(count)
                times.append(dvl_time_ns[seen])
                counts.append(count[seen])
                keys += [(method, name, source)] * len(seen)
    of_method, components, sources = zip(*keys, strict=True) if keys else ((), (), ())
    columns = {
        "trajectory": [trajectory] * len(keys),
        "method": of_method,
        "time_ns": np.concatenate(times),
        "component": components,
        "source": sources,
        "runs_chosen": np.concatenate(counts),
    }
    return pl.DataFrame(columns, schema_overrides=dict(CHOICES)).select(list(CHOICES))


def merged(tables: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """The counts of several batches added up."""
    keys = [name for name in CHOICES if name != "runs_chosen"]
    return pl.concat(tables).group_by(keys, maintain_order=True).agg(pl.col("runs_chosen").sum()).sort(keys)
