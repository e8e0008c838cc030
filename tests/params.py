"""Parameters of tests that take seconds each."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def rest_is_long(values: Iterable[tuple[Any, ...]], *, first: int = 1) -> list[Any]:
    """Parameters, of which `make test` takes the first few and `make test-long` the others."""
    return [pytest.param(*one, marks=() if k < first else pytest.mark.long) for k, one in enumerate(values)]
