"""The garbage collector of a live process."""

import weakref

from bottomlock.live.runner import YOUNG, collected_between_readings


class Cycle:
    """An object that only the collector can free."""

    def __init__(self) -> None:
        self.myself = self


def test_nothing_is_collected_but_where_it_is_asked_for() -> None:
    """Cycles stay while readings come, and are gone after `collect`."""
    with collected_between_readings() as collect:
        gone = weakref.ref(Cycle())
        kept = [[k] for k in range(20 * YOUNG)]
        assert gone() is not None, "the automatic collector ran"
        collect()
        assert gone() is None
        assert len(kept) == 20 * YOUNG
