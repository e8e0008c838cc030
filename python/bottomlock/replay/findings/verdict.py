"""The verdict on a replay: fixes rejected, and NIS against what a consistent filter has."""

from collections.abc import Sequence

import polars as pl

from bottomlock.replay.findings.finding import Finding, Severity
from bottomlock.statistics.chi_squared import CONSISTENT, OVERCONFIDENT, mean_band

ABSORBED = "absorbed"
PROBABILITY = 0.9999
WRONG_REJECTED, MANY_REJECTED = 0.15, 0.04
WRONG_RATIO, HIGH_RATIO = 2.5, 1.5
"""NIS over its degrees: a little too small a noise gives up to the second; beyond the first the filter is wrong."""
PREFERRED = ("tc", "lc")


def verdict_finding(
    innovations: pl.DataFrame, methods: Sequence[str], cause: Finding | None, beams: pl.Series
) -> tuple[Finding, str]:
    """The first finding, and "consistent", "overconfident" or "wrong".

    Args:
        innovations: of the recording as it is.
        methods: of the case.
        cause: the likeliest cause, or None.
        beams: (n,) valid beams of each ping, in the order of the innovations.
    """
    used = [m for m in (*PREFERRED, *methods) if m in methods]
    for method in dict.fromkeys(used):
        pings = innovations.filter(pl.col("method") == method)
        rows = pings.filter(pl.col("nis").is_not_null())
        if rows.height:
            # What the method can use is shown by the pings that it did use.
            enough = beams >= beams.filter(pings["nis"].is_not_null()).min()
            return _of(rows, method, cause, unused=int((enough & pings["nis"].is_null()).sum()))
    text = "No method had a single fix: no ping lies within the navigation, or no beam of them is valid."
    return (
        Finding(
            "no_fix",
            "fault",
            float("inf"),
            text,
            "",
            "Check dvl.clock, and which pings have beams.",
            "dvl.clock",
        ),
        "wrong",
    )


def _of(rows: pl.DataFrame, method: str, cause: Finding | None, unused: int) -> tuple[Finding, str]:
    count = rows.height + unused
    # A ping whose beams were all left out as outliers never becomes a fix: it counts as rejected.
    lost = int((rows["status"] == "rejected").sum()) + unused
    rejected = lost / count
    degrees = float(rows["degrees"].mean() or 1.0)  # type: ignore[arg-type]
    nis = float(rows["nis"].mean() or 0.0)  # type: ignore[arg-type]
    low, high = mean_band(degrees, rows.height, PROBABILITY)
    ratio = nis / degrees
    numbers = (
        f"Method {method}: {100.0 * rejected:.3g} % of {count} pings with beams rejected; NIS {nis:.3g}, "
        f"expected {degrees:.3g} "
        f"({low:.3g} to {high:.3g} for a consistent filter)."
    )
    state, severity, text, advice = CONSISTENT, "note", "Nothing is wrong with the filter's innovations.", ""
    if rejected > WRONG_REJECTED or ratio > WRONG_RATIO:
        state, severity, text = "wrong", "fault", "Something is wrong: the beams do not fit the navigation."
        if cause is not None:
            advice = f"The likeliest cause: {cause.text} {cause.advice}"
        else:
            advice = (
                "No single cause stands out: check start, mounting, axes and clock; are IMU and DVL of the same dive? "
                "`bottomlock audit` tests the log."
            )
    elif rejected > MANY_REJECTED or ratio > HIGH_RATIO:
        state, severity = OVERCONFIDENT, "warning"
        text = "The filter claims more than the beams confirm."
        advice = (
            f"The likeliest cause: {cause.text}" if cause is not None else
            "Larger dvl.beam_noise_mps or imu.errors would make it consistent."
        )  # fmt: skip
    elif cause is not None:
        state, severity = ABSORBED, "warning"
        text = "The innovations look consistent, but the filter has absorbed an error."
        advice = f"The likeliest: {cause.text} {cause.advice}"
    elif nis > high:
        text = "NIS is a little high: the claimed noise of the beams or the IMU is a little small."
    elif nis < low:
        text = "NIS is low: the claimed noise is larger than the real one."
    level: Severity = "fault" if severity == "fault" else "warning" if severity == "warning" else "note"
    return Finding("verdict", level, float(count) * max(ratio, rejected), text, numbers, advice), state
