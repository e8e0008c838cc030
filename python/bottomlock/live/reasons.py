"""Counts of what was not used, by reason."""

from collections import Counter

MOST = 40
"""Reasons that are counted apart: some hold words from the line, which may be anything."""


class Reasons(Counter[str]):
    """Counts by reason, for as long as a process runs.

    >>> reasons = Reasons()
    >>> for k in range(50): reasons.add(f"reason {k}")
    >>> len(reasons), reasons["other reasons"]
    (41, 10)
    """

    def add(self, reason: str) -> None:
        """Counts a reason; beyond `MOST` of them as another one."""
        self[reason if reason in self or len(self) < MOST else "other reasons"] += 1
