"""The figure of a flight draws the telemetry that it is given."""

import numpy as np
import polars as pl
import pytest

from bottomlock.figures.drawing import on_paper
from bottomlock.figures.flight import flight_figure, flight_panels
from bottomlock.plant import Flight, telemetry


@pytest.mark.long
def test_a_flight_is_drawn_as_it_was_flown(flights: dict[str, Flight]) -> None:
    """In degrees where the telemetry has radians; ranges where there is a seabed."""
    frame = telemetry(flights["straight"], every=75)
    time_ns = np.arange(251, dtype=np.int64) * 1_000_000_000
    beams = pl.DataFrame({"time_ns": time_ns, **{f"beam{k}_valid": time_ns % k == 0 for k in range(1, 5)}})
    panels = flight_panels(frame, beams)
    titles = [panel.title for panel in panels]
    assert titles == ["depth, m", "speed, m/s", "flow angles, °", "fins, °", "beams valid"]
    curves = {curve.label: curve for panel in panels for curve in panel.curves}
    np.testing.assert_array_equal(curves["actual"].value, frame["depth_m"])
    np.testing.assert_allclose(np.deg2rad(curves["sideslip"].value), frame["sideslip_rad"], rtol=1e-12)
    np.testing.assert_allclose(np.deg2rad(curves["3"].value), frame["fin_3_rad"], rtol=1e-12)
    assert len(on_paper(flight_figure(frame, beams)).axes) == len(panels)
    over_a_seabed = beams.with_columns(pl.lit(20.0).alias(f"beam{k}_range_m") for k in range(1, 5))
    (ranges,) = (panel for panel in flight_panels(frame, over_a_seabed) if panel.title == "range, m")
    assert [curve.value.max() for curve in ranges.curves] == [20.0] * 4
