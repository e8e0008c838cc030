"""The flight figure draws what it is given, the same bytes each time, and names what is missing."""

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import OutputError
from bottomlock.figures.flight import flight_figure
from bottomlock.figures.palette import svg_text
from bottomlock.plant import Flight, telemetry


@pytest.fixture(scope="module")
def validity() -> pl.DataFrame:
    time_ns = np.arange(251, dtype=np.int64) * 1_000_000_000
    return pl.DataFrame(
        {"time_ns": time_ns, **{f"beam{beam}_valid": time_ns % (beam + 1) == 0 for beam in range(1, 5)}}
    )


@pytest.mark.parametrize(
    "name",
    ["lawn_mower", *(pytest.param(name, marks=pytest.mark.long) for name in ("straight", "figure_eight"))],
)
def test_a_flight_is_drawn_the_same_twice(
    flights: dict[str, Flight], validity: pl.DataFrame, name: str
) -> None:
    frame = telemetry(flights[name], every=75)
    first, second = (svg_text(flight_figure(frame, validity)) for _ in range(2))
    assert first == second
    assert len(flight_figure(frame, validity).axes) == 6
    assert len(flight_figure(frame).axes) == 5


def test_missing_columns_are_named(flights: dict[str, Flight], validity: pl.DataFrame) -> None:
    frame = telemetry(flights["straight"], every=750)
    with pytest.raises(OutputError, match="column 'depth_m' is missing"):
        flight_figure(frame.drop("depth_m"))
    with pytest.raises(OutputError, match="needs time_ns"):
        flight_figure(frame, validity.drop("time_ns"))
