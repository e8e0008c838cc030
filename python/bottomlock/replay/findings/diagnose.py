"""The findings of a replay: the verdict, then the likely causes with their numbers and the key to change."""

from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.replay.case import Case
from bottomlock.replay.findings import checks
from bottomlock.replay.findings.beam_noise_finding import beam_noise_finding
from bottomlock.replay.findings.claims import claims_findings
from bottomlock.replay.findings.finding import Finding, ranked
from bottomlock.replay.findings.hypotheses import compare, tight_priors
from bottomlock.replay.findings.motion_findings import motion_findings
from bottomlock.replay.findings.verdict import ABSORBED, verdict_finding
from bottomlock.replay.motion.closure import LEAST_PINGS
from bottomlock.replay.motion.fit import Recorded
from bottomlock.replay.motion.velocity import ping_velocity
from bottomlock.replay.rerun import PreparedRun

Floats = NDArray[np.float64]


def diagnose(
    case: Case, prepared: PreparedRun, samples: pl.DataFrame, innovations: pl.DataFrame
) -> list[Finding]:
    """Findings of the recording as it is: the verdict, the likely causes, and claims that a reference contradicts.

    Args:
        case: the case.
        prepared: its first run.
        samples: `tables.replay.REPLAY_SAMPLES` of the recording, first run.
        innovations: the same, `tables.replay.innovations_schema`.
    """
    causes = _causes(case, prepared, samples)
    beams = pl.Series(prepared.streams.beams.valid[prepared.pings].sum(axis=1))
    verdict, state = verdict_finding(innovations, case.replay.methods, causes[0] if causes else None, beams)
    if state == ABSORBED:
        causes = [replace(one, severity="warning") for one in causes]
    return [verdict, *causes, *claims_findings(samples, case.replay.methods)]


def _causes(case: Case, prepared: PreparedRun, samples: pl.DataFrame) -> list[Finding]:
    streams, alignment = prepared.streams, prepared.alignment
    geometry = streams.instrument.geometry
    B = np.asarray(geometry.directions_p)
    found = [checks.order_finding(streams) or beam_noise_finding(case, streams)]
    time_ns, velocity = ping_velocity(
        B, streams.beams.time_ns, np.nan_to_num(streams.beams.velocity_mps), streams.beams.valid
    )
    inside = time_ns >= alignment.time_ns
    time_ns, velocity = time_ns[inside], velocity[inside] / geometry.sound_speed_scale
    if len(time_ns) > LEAST_PINGS:
        found += _against_imu(case, prepared, time_ns, velocity)
    found += [
        checks.velocity_finding(alignment, time_ns, velocity),
        checks.heading_finding(case, alignment, streams),
    ]
    found.append(_track(case, prepared, samples))
    return ranked([one for one in found if one is not None])


def _against_imu(
    case: Case, prepared: PreparedRun, time_ns: NDArray[np.int64], velocity: Floats
) -> list[Finding | None]:
    streams, alignment = prepared.streams, prepared.alignment
    inertial = streams.inertial
    rows = slice(int(np.searchsorted(inertial.time_ns, alignment.time_ns)), None)
    omega = inertial.omega_p_radps
    recorded = Recorded(
        inertial.time_ns[rows], inertial.force_p_mps2[rows], omega[rows], time_ns,
        _at_imu(prepared, time_ns, velocity),
    )  # fmt: skip
    model = prepared.model.imu
    tight = tight_priors(model.gyro_bias_sd_radps, model.accel_bias_sd_mps2)
    B = np.asarray(streams.instrument.geometry.directions_p)
    noise = float(streams.instrument.beam_sd_mps.mean() * np.sqrt(np.trace(np.linalg.pinv(B.T @ B)) / 3.0))
    comparison = compare(recorded, tight, noise)
    if comparison is None:
        return []
    down = np.abs(B @ _mean_down(prepared))
    tilt = float(np.mean(np.arccos(np.clip(down, -1.0, 1.0))))
    found: list[Finding | None] = [*motion_findings(case, comparison, tilt)]
    # Not the free fit: at a constant speed it may lean on a mounting that nothing shows.
    best = comparison.causes[0].match if comparison.causes else comparison.stated
    gyros = comparison.causes[0].gyros if comparison.causes else 1.0
    if gyros == 1.0 and abs(best.gravity - 9.81) < 0.5:
        found.append(checks.level_finding(alignment, best))
        found.append(checks.depth_finding(case, streams, recorded, best))
    return found


def _mean_down(prepared: PreparedRun) -> Floats:
    """(3,) the axis about which the beams are arranged, platform frame."""
    mean = np.asarray(prepared.streams.instrument.geometry.directions_p).mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-9))


def _at_imu(prepared: PreparedRun, time_ns: NDArray[np.int64], velocity: Floats) -> Floats:
    """(p, 3) velocities carried from the DVL to the IMU over the stated lever arm."""
    lever = np.asarray(prepared.streams.instrument.geometry.lever_arms_p_m).mean(axis=0)
    if not lever.any():
        return velocity
    inertial = prepared.streams.inertial
    at = np.clip(np.searchsorted(inertial.time_ns, time_ns), 0, len(inertial.time_ns) - 1)
    return np.asarray(velocity - np.cross(inertial.omega_p_radps[at], lever))


def _track(case: Case, prepared: PreparedRun, samples: pl.DataFrame) -> Finding | None:
    forward = samples.filter(pl.col("pass") == "forward")
    methods = [m for m in ("tc", "lc", *case.replay.methods) if m in case.replay.methods and m != "ins"]
    if not methods:
        return None
    rows = forward.filter(pl.col("method") == methods[0])
    place = rows.select("north_m", "east_m", "down_m").to_numpy()
    return checks.track_finding(case, rows["time_ns"].to_numpy(), place, prepared.streams)


def findings_json(findings: list[Finding]) -> list[dict[str, Any]]:
    """The findings as the manifest holds them."""
    return [one.to_json() for one in findings]
