"""The numbers of a small campaign stay where they are unless somebody moves them on purpose."""

import polars as pl
import pytest
from polars.testing import assert_frame_equal

from tools import update_golden

# Elementary functions differ between C libraries in the last bit, and 37,500 steps add that up.
RELATIVE = 1e-6


@pytest.mark.slow
@pytest.mark.golden
def test_runs_of_the_packaged_scenarios() -> None:
    """Every method of every scenario: errors, consistency and fixes counted. `make golden` rewrites the file."""
    runs = update_golden.golden_runs()
    golden = pl.read_csv(update_golden.GOLDEN, schema=runs.schema)
    assert_frame_equal(runs, golden, rel_tol=RELATIVE, abs_tol=0.0)
