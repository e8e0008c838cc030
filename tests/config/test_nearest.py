"""A name that is not known gets the nearest one proposed."""

import pytest

from bottomlock.text import did_you_mean, nearest


@pytest.mark.parametrize(
    ("name", "known", "found"),
    [
        ("TC", ["tc", "vb"], "tc"),
        ("tcc", ["tc", "vb"], "tc"),
        ("weak-sway", ["weak_sway", "nsv"], "weak_sway"),
        ("Survey", ["Survey_2", "survey"], "survey"),
        ("qqq", ["tc", "vb"], None),
        ("", ["tc"], None),
        ("tc", [], None),
    ],
)
def test_the_nearest_name(name: str, known: list[str], found: str | None) -> None:
    """Letters of any case are alike; nothing is proposed for what is like no name."""
    assert nearest(name, known) == found
    assert did_you_mean(name, known, "!") == ("!" if found is None else f", did you mean '{found}'?")
