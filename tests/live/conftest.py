"""What the tests of live use share."""

from collections.abc import Iterator

import pytest

from tests.live.world import probe_registered


@pytest.fixture(scope="module", autouse=True)
def probe() -> Iterator[None]:
    """The port that the tests read, by name."""
    with probe_registered():
        yield
