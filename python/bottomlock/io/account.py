"""The account of a file: what became of each of its records."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.sentences import show

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass
class Reason:
    """Count of records with one outcome, and the position of the first."""

    count: int
    first: int
    detail: str = ""


# What is told of a record, by its index.
Detail = Callable[[int], str | bytes]


def in_file_order(reasons: Mapping[str, Reason]) -> list[tuple[str, Reason]]:
    """Reasons by the first record of each."""
    return sorted(reasons.items(), key=lambda one: one[1].first)


@dataclass
class Account:
    """Outcome of every record of a file.

    Attributes:
        unit: what positions count: "byte" (offset from 0) or "line" (from 1).
        read: records found, good or bad.
        kept: rows of the table.
        skipped: records that gave no row, by reason.
        flagged: rows that are kept, but with beams marked invalid by the reader or with something missing, by reason.
        other: well-formed records of kinds that carry no pings (replies, attitude, positions), by kind.
    """

    unit: str
    read: int = 0
    kept: int = 0
    skipped: dict[str, Reason] = field(default_factory=dict)
    flagged: dict[str, Reason] = field(default_factory=dict)
    other: dict[str, Reason] = field(default_factory=dict)

    def skip(self, reason: str, position: int, detail: str | bytes = "", *, count: int = 1) -> None:
        """Counts lost records, the first at a position; of `detail` in bytes its beginning is shown."""
        _count(self.skipped, reason, position, detail, count)

    def flag(self, reason: str, position: int, detail: str | bytes = "", *, count: int = 1) -> None:
        """Counts records that are kept with a change, the first at a position."""
        _count(self.flagged, reason, position, detail, count)

    def pass_by(self, kind: str, position: int, *, count: int = 1) -> None:
        """Counts well-formed records without a ping, the first at a position."""
        _count(self.other, kind, position, "", count)

    def skip_where(
        self, reason: str, chosen: Flags, position: Integers, detail: Detail = lambda _: ""
    ) -> None:
        """Counts the chosen ones of many records; `detail` gives that of the first from its index."""
        _count_where(self.skipped, reason, chosen, position, detail)

    def flag_where(
        self, reason: str, chosen: Flags, position: Integers, detail: Detail = lambda _: ""
    ) -> None:
        """The same of records that are kept with a change."""
        _count_where(self.flagged, reason, chosen, position, detail)

    @property
    def lost(self) -> int:
        """Number of skipped records."""
        return sum(reason.count for reason in self.skipped.values())

    def to_json(self) -> dict[str, Any]:
        """Content of the JSON file beside the table."""

        def fates(reasons: Mapping[str, Reason]) -> dict[str, dict[str, Any]]:
            return {
                name: {"count": reason.count, f"first_{self.unit}": reason.first}
                | ({"first": reason.detail} if reason.detail else {})
                for name, reason in in_file_order(reasons)
            }

        return {
            "position": self.unit,
            "records_read": self.read,
            "rows_kept": self.kept,
            "skipped": fates(self.skipped),
            "flagged": fates(self.flagged),
            "other": fates(self.other),
        }


def _count(reasons: dict[str, Reason], name: str, position: int, detail: str | bytes, count: int) -> None:
    """Adds to a reason; the first of its records in the file is the one that is told."""
    before = reasons.get(name)
    if before is not None and before.first <= position:
        before.count += count
        return
    told = show(detail) if isinstance(detail, bytes) else detail
    reasons[name] = Reason(count + (before.count if before else 0), position, told)


def _count_where(reasons: dict[str, Reason], name: str, chosen: Flags, at: Integers, detail: Detail) -> None:
    if count := int(np.count_nonzero(chosen)):
        first = int(np.argmax(chosen))
        _count(reasons, name, int(at[first]), detail(first), count)
