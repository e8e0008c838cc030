"""The passes over a recording that a candidate is scored on: all measurements used, and outages of the beams."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bottomlock.kernel import replay_log
from bottomlock.kernel.models import Options, Robust
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.replay import rerun
from bottomlock.replay.case import Case
from bottomlock.replay.model import imu_model, kernel_model, kernel_options
from bottomlock.replay.reading import read_streams
from bottomlock.replay.tune.parameters import (
    BEAM_NOISE,
    INERTIAL_NOISE,
    WATER_NOISE,
    Parameter,
    noise_of,
    with_values,
)

HORIZONS_S = (10.0, 30.0, 100.0)
"""Times after the last beams used at which the beams are predicted."""
RECOVERY_S = 30.0
"""Time with beams between two outages."""
PHASES = 3
"""Passes with outages; each has them a part of a cycle later than the one before."""
OUTAGES = 4
"""Fewest outages of a horizon in a pass; with fewer the horizon is left out."""
OUTLIER_GATE = 0.99999
"""Probability with which a good ping passes the tests that leave beams out of the comparison."""
LOOSE = 30.0
"""Factor on the inertial noise with which outliers are looked for: it is not known yet."""


@dataclass(frozen=True, eq=False)
class Pass:
    """A log as the kernel takes it, and the horizons (n,) of its withheld pings; None where every step is scored."""

    log: Mapping[str, Any]
    horizon_s: Floats | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """A case, prepared for candidates: every candidate sees the same measurements, with no gate.

    Attributes:
        case: as it was read.
        prepared: streams, start and settings.
        valid: (E, B) the beams that are compared, without outliers.
        noise: what may be tuned.
    """

    case: Case
    prepared: rerun.PreparedRun
    valid: Flags
    noise: tuple[Parameter, ...]

    @classmethod
    def read(cls, case: Case) -> "Recording":
        """A case with its streams read, its start found, and what can be tuned of it; outliers count as lost.

        Raises:
            DataError, ScenarioError: as `read_streams` and `prepare`.
        """
        rerun.check_files(case)
        streams = read_streams(case)
        prepared = rerun.prepare(case, streams)
        valid = prepared.streams.beams.valid[prepared.pings]
        recording = cls(case, prepared, valid, tuple(noise_of(case, streams)))
        loose = {one.key: one.start * LOOSE for one in recording.noise if one.key in INERTIAL_NOISE}
        robust = Robust(closure_gate=OUTLIER_GATE, beam_gate=OUTLIER_GATE, tail="gaussian")
        weight = recording.flown(recording.log(valid), loose, robust=robust)["beam_weight"][0]
        return replace(recording, valid=valid & ~(weight == 0.0))

    def until(self, time_ns: int) -> "Recording":
        """The part up to a time."""
        streams = self.prepared.streams
        count = int(np.searchsorted(streams.inertial.time_ns, time_ns, side="right"))
        part = replace(self.prepared, streams=replace(streams, inertial=streams.inertial.rows(slice(count))))
        return replace(self, prepared=part, valid=self.valid[: part.pings.stop - part.pings.start])

    def log(self, used: Flags) -> Any:  # noqa: ANN401 - the kernel's dict
        """The log with the beams (E, B) that are used; readings that are made of beams are made of these."""
        return rerun.kernel_log(self.case, self.prepared, used)

    def flown(self, log: Mapping[str, Any], values: Mapping[str, float], **options: Any) -> Any:  # noqa: ANN401
        """The kernel's results along a log with other settings of the case; no gate, so that all are compared alike.

        Raises:
            KernelError: for settings that the kernel refuses, and where the filter ends in an error.
        """
        case, streams = with_values(self.case, values), self.prepared.streams
        initial, gravity = self.prepared.model.initial, self.prepared.model.environment.gravity_mps2
        own: Options = kernel_options(case, streams.instrument, streams.vehicle_motion).replace(
            gate="off", inflate_after_rejections=0, **({"robust": None} | options)
        )
        begun = {one.key: one.start for one in self.noise}
        changed: Any = dict(log) | {
            column: log[column] * (values[key] / begun[key])
            for column, key in (("beam_sd_mps", BEAM_NOISE), ("water_track_sd_mps", WATER_NOISE))
            if key in values
        }
        return replay_log(
            streams.instrument.geometry, kernel_model(case, streams, imu_model(case, streams), initial, gravity),
            own, ["tc"], changed, rerun.kernel_start(self.prepared.alignment),
            sample_time_ns=log["imu_time_ns"][-1:], innovations="dvl_withheld" not in log,
        )  # fmt: skip

    def innovations(self, one: Pass, values: Mapping[str, float]) -> list[dict[str, Any]]:
        """The scored innovations of a pass, sensor by sensor with their horizons.

        Raises:
            KernelError: as `flown`.
        """
        found = self.flown(one.log, values)["innovations"][0]
        if one.horizon_s is None:
            steps = {name: np.zeros(len(records["rows"])) for name, records in found.items()}
            return [{"sensor": name, "horizon_s": steps[name]} | records for name, records in found.items()]
        if "beams" not in found:
            return []
        scored = {key: column[found["beams"]["withheld"]] for key, column in found["beams"].items()}
        at = np.searchsorted(one.log["dvl_time_ns"][one.log["dvl_withheld"]], scored["time_ns"])
        return [{"sensor": "beams", "horizon_s": one.horizon_s[at]} | scored]

    def passes(self, horizons_s: Sequence[float]) -> list[Pass]:
        """The pass with all measurements, and those with outages as long as the longest horizon.

        Without a horizon there is the first alone.
        """
        found = [Pass(self.log(self.valid))]
        if horizons_s:
            found += [self._with_outages(horizons_s, phase / PHASES) for phase in range(PHASES)]
        return found

    def _with_outages(self, horizons_s: Sequence[float], phase: float) -> Pass:
        """Outages of the beams as long as the longest horizon; the first ping at or after each horizon is predicted."""
        cycle_s = horizons_s[-1] + min(horizons_s[-1], RECOVERY_S)
        start_s = self._since_s() - phase * cycle_s - RECOVERY_S
        into_s = np.where(start_s < 0.0, np.inf, start_s % cycle_s)
        outage = np.floor(start_s / cycle_s)
        horizon = np.zeros(len(start_s))
        for at_s in horizons_s:
            after = np.flatnonzero((start_s >= 0.0) & self.valid.any(axis=1) & (into_s >= at_s))
            rows = after[np.unique(outage[after], return_index=True)[1]]
            horizon[rows[(into_s[rows] - at_s) < 0.5 * at_s]] = at_s
        # With the ping that ends the longest horizon the beams are used again.
        used = self.valid & ~((into_s < horizons_s[-1]) | (horizon > 0.0))[:, None]
        return self._pass(used, self.valid & (horizon > 0.0)[:, None], horizon)

    def _since_s(self) -> Floats:
        """(E,) times of the pings after the start."""
        prepared = self.prepared
        return np.asarray(
            (prepared.streams.beams.time_ns[prepared.pings] - prepared.alignment.time_ns) * 1e-9
        )

    def _pass(self, used: Flags, scored: Flags, horizon_s: Floats) -> Pass:
        """A pass with the beams (E, B) that are used, and those that are predicted a nanosecond after them."""
        log, is_used = self.log(used), np.any(used, axis=1)
        rows = np.sort(np.concatenate([np.flatnonzero(is_used), np.flatnonzero(scored.any(axis=1))]))
        is_second = np.append(False, rows[1:] == rows[:-1])
        withheld = is_second | ~is_used[rows]
        valid = np.where(withheld[:, None], scored[rows], used[rows])
        beams, pings = self.prepared.streams.beams, self.prepared.pings
        pinged = {
            "dvl_time_ns": log["dvl_time_ns"][rows] + is_second,
            "beam_velocity_mps": np.where(valid, beams.velocity_mps[pings][rows], np.nan),
            "beam_valid": valid,
            "beam_sd_mps": log["beam_sd_mps"][rows],
            "dvl_withheld": withheld,
        }
        return Pass(log | pinged, horizon_s[rows[withheld]])


def horizons_of(duration_s: float) -> tuple[float, ...]:
    """The horizons for which a log is long enough: so many outages of each."""
    return tuple(
        horizon for horizon in HORIZONS_S if duration_s >= OUTAGES * (horizon + min(horizon, RECOVERY_S))
    )
