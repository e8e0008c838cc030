"""Readers are linear: twice the bytes cost about twice the time, and not more."""

import contextlib
import time

import pytest

from bottomlock.errors import DataError
from bottomlock.io.formats import BYTES
from bottomlock.io.rows import Options
from tests.attack import logs
from tests.attack.adversaries import ADVERSARIES

FORMS = {form.name: form for form in BYTES}
SIZE = 100_000


def cost(name: str, data: bytes, readings: int) -> float:
    """Least processor time of some readings, s."""
    took = []
    for _ in range(readings):
        start = time.process_time()
        with contextlib.suppress(DataError):
            FORMS[name].read(data, "log", Options())
        took.append(time.process_time() - start)
    return min(took)


@pytest.mark.first_cases(3)
@pytest.mark.parametrize("name", sorted(logs.BUILDERS))
def test_time_of_a_reader_is_linear(name: str) -> None:
    """Below 3 for twice the size, for a good log and for each hostile one; a quadratic reader has 4."""
    for data in (logs.joined(logs.build(name, 0).records), *ADVERSARIES[name]):
        one = (data * (SIZE // len(data) + 1))[:SIZE]
        # Three readings, and once more, only where one leaves a doubt; a quadratic reader fails every time.
        tries = [(1, 2.5), (3, 3.0), (3, 3.0)]
        assert any(cost(name, one + one, n) < most * cost(name, one, n) + 0.005 for n, most in tries)
