"""Mounting, clock and scale of the DVL as a replay's filter estimates them, and the DVL's file with them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_text
from bottomlock.files.overwriting import check_free
from bottomlock.files.replay_tables import CALIBRATION, RECORDED
from bottomlock.io.beams import Instrument, geometry_text
from bottomlock.io.calibrated_file import Calibrated, calibrated_text
from bottomlock.kernel import STATES
from bottomlock.kernel.models import Calibration, DvlModel
from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.streams import Floats
from bottomlock.replay.case import Case
from bottomlock.replay.rerun import Rerun

PARAMETERS = ("mounting_forward", "mounting_right", "mounting_down", "clock_offset", "scale")
UNITS = ("deg", "deg", "deg", "s", "%")
_TO_UNITS = np.array([180.0 / np.pi] * 3 + [1.0, 100.0])
CONTRADICTION = 4.0
"""An estimate of more standard deviations of its prior than this is none that the prior allows."""
WRITES = ("tc", "info", "weak_sway", "lc")
"""Methods whose estimate is written, the first that was run; none of them assumes anything of the motion but the last
two of a velocity that the beams leave open."""


def calibration_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method and parameter, from the whole log (`replay_tables.CALIBRATION`); empty without the states."""
    result = rerun.result
    parts = []
    for index, method in enumerate(case.replay.filters if "calibration" in result else ()):
        value = np.append(result["calibration"][index, -1], result["dvl_scale"][index, -1])
        # The scale factor is the last of the error states.
        sd = np.append(result["calibration_sd"][index, -1], result["sd"][index, -1, STATES - 1])
        columns: dict[str, Any] = {
            "case": [case.name] * len(PARAMETERS),
            "what_if": what_if,
            "method": method,
        }
        columns |= {"parameter": PARAMETERS, "unit": UNITS}
        columns |= {"value": value * _TO_UNITS, "sd": sd * _TO_UNITS, "prior_sd": _prior(rerun) * _TO_UNITS}
        parts.append(pl.DataFrame(columns, schema=dict(CALIBRATION)))
    return pl.concat(parts) if parts else pl.DataFrame(schema=dict(CALIBRATION))


def _prior(rerun: Rerun) -> Floats:
    """(5,) 1 sigma of each parameter beforehand, SI."""
    prior = rerun.prepared.options.calibration
    return np.array(
        [*prior.mounting_sd_rad, prior.clock_sd_s, rerun.prepared.model.of(DvlModel).scale_factor_sd]
    )


def calibration_words(table: pl.DataFrame | None, methods: Sequence[str]) -> list[str]:
    """The estimates of each method in the recording as it is, a line each, with what was known beforehand."""
    lines: list[str] = []
    if table is None:
        return lines
    for method in methods:
        rows = table.filter((pl.col("what_if") == RECORDED) & (pl.col("method") == method))
        parts = [
            f"{row['parameter'].replace('_', ' ')} {row['value']:+.3g} ± {row['sd']:.2g} {row['unit']} "
            f"(before: ± {row['prior_sd']:.2g}{_contradiction(row)})"
            for row in rows.iter_rows(named=True)
            if row["prior_sd"] > 0.0
        ]
        if rows.height and (rows["sd"] == rows["prior_sd"]).all():
            parts = ["nothing learnt"]
        if parts:
            lines.append(f"calibration by {method}: {'; '.join(parts)}")
    return lines


def _contradiction(row: dict[str, Any]) -> str:
    """Words for an estimate that what was known beforehand excludes: one of the two is wrong."""
    beyond = abs(row["value"]) / row["prior_sd"]
    return "" if beyond <= CONTRADICTION else f", of which it is {beyond:.1f}: prior or log is wrong"


def writing_method(case: Case, instrument: Instrument) -> str:
    """The method whose estimates are written.

    Raises:
        ScenarioError: for a case that estimates none.
    """
    method = next((name for name in WRITES if name in case.replay.methods), None)
    if method is None or case.calibration.prior(instrument.calibration) == Calibration():
        raise ScenarioError(
            "no calibration to write",
            place=f"case {case.name}",
            expected="a section [calibration] with mounting_sd_deg or clock_sd_s, and one of the methods "
            f"{', '.join(WRITES)}",
        )
    return method


def found(instrument: Instrument, table: pl.DataFrame | None, case: Case) -> Calibrated:
    """The estimates of the recording as it is together with what the DVL's file says.

    Raises:
        ScenarioError: as `writing_method`.
    """
    method = writing_method(case, instrument)
    assert table is not None  # a case with a prior has the states
    rows = table.filter((pl.col("what_if") == RECORDED) & (pl.col("method") == method))
    value, sd, prior = (rows[name].to_numpy() / _TO_UNITS for name in ("value", "sd", "prior_sd"))
    stated = instrument.stated
    mounting = Rotation.from_rotvec(value[:3]) * from_angles(*instrument.mounting_rpy_rad)
    has_mounting, has_clock = bool((prior[:3] > 0.0).any()), prior[3] > 0.0
    return Calibrated(
        source=f"replay of case {case.name}, method {method}",
        mounting_rpy_rad=mounting.as_euler("ZYX")[::-1] if has_mounting else None,
        mounting_sd_rad=sd[:3] if has_mounting else None,
        scale=(1.0 + stated.scale_percent / 100.0) * (1.0 + value[4]) - 1.0,
        scale_sd=float(sd[4]) if sd[4] > 0.0 else None,
        clock_offset_s=stated.clock_offset_s + float(value[3]) if has_clock else None,
        clock_sd_s=float(sd[3]) if has_clock else None,
    )


def write_calibration(
    path: Path, instrument: Instrument, table: pl.DataFrame | None, case: Case, *, force: bool
) -> None:
    """Writes a copy of the DVL's file with the estimates and their 1 sigma, which a replay takes as its prior.

    Raises:
        OutputError: for a file that is there already without `force`, is read, or cannot be written.
        ScenarioError: as `writing_method`.
    """
    check_free(path, inputs=[Path(case.dvl.geometry)], force=force)
    write_text(path, calibrated_text(geometry_text(case.dvl.geometry), found(instrument, table, case)))
