"""The columns of every table: each RMS and mean says over what, and the written tables have them."""

import importlib
import pkgutil
import re
from collections.abc import Mapping

import numpy as np
import polars as pl
import pytest

from bottomlock import files
from bottomlock.config.imu import ImuLimits
from bottomlock.config.scenario_sections import Filter, Robust
from bottomlock.errors import DataError
from bottomlock.files.columns import check
from bottomlock.kernel import DEFAULT_OPTIONS, FIX_METHODS, METHODS
from bottomlock.kernel.models import Options
from bottomlock.statistics.rms import combined_rms, rms, rms_column


def schemas() -> dict[str, Mapping[str, pl.DataType]]:
    """Every table of the package by its name."""
    found: dict[str, Mapping[str, pl.DataType]] = {}
    for module in pkgutil.iter_modules(files.__path__):
        content = vars(importlib.import_module(f"bottomlock.files.{module.name}"))
        found |= {
            f"{module.name}.{name}": value
            for name, value in content.items()
            if isinstance(value, dict) and value and all(isinstance(t, pl.DataType) for t in value.values())
        }
    return found


def test_every_rms_and_mean_says_over_what() -> None:
    """`velocity_rms_mps` would be over time in one table and over runs in the next."""
    found = schemas()
    assert len(found) > 15
    vague = re.compile(r"_(rms|mean)(?!_over_(time|runs|fixes|pings))")
    assert [(table, name) for table, columns in found.items() for name in columns if vague.search(name)] == []


def test_the_defaults_of_a_scenario_are_the_kernels() -> None:
    """Stated in the kernel alone; a rate stands for its period."""
    own = {"imu_limits": ImuLimits().kernel_limits(), "robust": Robust().kernel_options()}
    assert Options.of(Filter().kernel_options(), own) == Options()
    assert set(Options().as_dict()) == set(DEFAULT_OPTIONS)


def test_every_method_of_a_fix_is_a_method_of_navigation() -> None:
    assert set(FIX_METHODS) <= set(METHODS)


@pytest.mark.parametrize("shape", [(7,), (5, 40)])
def test_both_definitions_of_rms_agree(shape: tuple[int, ...]) -> None:
    """The array's and the column's, and the one of groups from their mean squares."""
    values = np.random.default_rng(3).normal(size=shape)
    by_hand = np.sqrt(sum(float(value) ** 2 for value in values.ravel()) / values.size)
    assert float(rms(values)) == pytest.approx(by_hand, rel=1e-14)
    assert pl.DataFrame({"x": values.ravel()}).select(rms_column("x")).item() == pytest.approx(
        by_hand, rel=1e-14
    )
    groups = np.mean(values.reshape(shape[0], -1) ** 2, axis=1)
    assert float(combined_rms(groups)) == pytest.approx(by_hand, rel=1e-14)
    weights = np.full(len(groups), 1.0 / len(groups))
    assert float(combined_rms(groups, weights)) == pytest.approx(by_hand, rel=1e-14)


def test_what_is_read_back_has_the_columns_and_types_of_its_table() -> None:
    columns = {"run": pl.Int64(), "error_m": pl.Float64()}
    whole = pl.DataFrame({"error_m": [0.5], "run": [1]})
    assert check(whole, columns, place="t").columns == ["run", "error_m"]
    with pytest.raises(DataError, match=r"^t: column 'run' is missing, expected run, error_m$"):
        check(whole.drop("run"), columns, place="t")
    with pytest.raises(DataError, match=r"^t: column 'error_m' is String, expected Float64$"):
        check(whole.cast({"error_m": pl.String}), columns, place="t")
    with pytest.raises(DataError, match=r"^t: column 'errror' is unknown, expected run, error_m$"):
        check(whole.with_columns(errror=1.0), columns, place="t")
