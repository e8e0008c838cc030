"""A log in which the instrument never had bottom lock: nothing of it may be judged."""

import numpy as np

from bottomlock.audit.logs import BeamLog
from bottomlock.recordings.finding import Finding

ADVICE = "Record in the water, with the bottom within the instrument's range."


def why_never_locked(log: BeamLog) -> str:
    """Why the log never had lock; empty where it had.

    A beam in air or mid-water reads something, zero or the last value, and some instruments flag it valid: the order,
    the closure and the repeats of such readings say nothing of the instrument.
    """
    valid = log.valid & np.isfinite(log.velocity_mps)
    if log.instrument_valid is not None and not log.instrument_valid.any():
        return f"the instrument flags its velocity invalid in all {log.pings} pings"
    if log.beams and not valid.any() and not log.solved.any():
        return f"no beam is valid in any of {log.pings} pings"
    if log.beams and valid.any() and not (log.velocity_mps[valid] != 0.0).any():
        return f"every reading of {log.pings} pings is exactly zero"
    if not log.beams and log.error_velocity_mps is None and not log.solved.any():
        return f"no velocity is valid in any of {log.pings} pings"
    return ""


def lock_findings(log: BeamLog) -> list[Finding]:
    """That the log never had lock, and why; nothing where it had."""
    why = why_never_locked(log)
    if not why:
        return []
    flagged = int(log.full.sum()) if log.beams else 0
    return [
        Finding(
            "never_locked", "warning", 1.0,
            f"The instrument never had bottom lock in this log: {why}.",
            f"{flagged} pings have all beams flagged valid. Beams, closure and mounting are not judged.",
            ADVICE,
            size=float(log.pings), unit="pings",
        )
    ]  # fmt: skip
