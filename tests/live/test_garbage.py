"""The garbage collector of a live process."""

import gc
import weakref

import pytest

from bottomlock.live.garbage import YOUNG, collected_between_readings


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


def test_few_objects_are_not_worth_a_collection() -> None:
    """Below the bound nothing is looked at."""
    with collected_between_readings() as collect:
        gone = weakref.ref(Cycle())
        collect()
        assert gone() is not None


def fail_while_collected_between_readings() -> None:
    with collected_between_readings():
        assert not gc.isenabled()
        _ = 1 / 0


def test_the_collector_is_afterwards_as_before() -> None:
    """Also after an error, and where it was off."""
    assert gc.isenabled()
    frozen = gc.get_freeze_count()
    with pytest.raises(ZeroDivisionError):
        fail_while_collected_between_readings()
    assert gc.isenabled()
    assert gc.get_freeze_count() == frozen
    gc.disable()
    try:
        with collected_between_readings():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
