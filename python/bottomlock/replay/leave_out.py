"""Leave-beams-out validation: the velocity error of each method when beams of a complete ping are withheld.

A ping with all beams valid and a small closure is its own reference: the least-squares velocity of all beams, and the
reading of each withheld beam. Methods without a prior use the ping alone. Methods with a prior also use the velocity
that a random-walk filter predicts from the pings before, each with all its beams.

With `robust` the noise and its tail are those of the log's closure (`replay.beam_noise`), and the pings before are
without identified outliers (`replay.screen_beams`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.replay_tables import SCORES
from bottomlock.kernel import BeamGeometry, FixMethod, VelocityFixes
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.robust import sd_about_zero
from bottomlock.recordings.streams import Flags, Floats, Times
from bottomlock.replay.beam_noise import BeamNoise, claimed_noise, measure_noise
from bottomlock.replay.robust_fix import screen_beams, solve_scaled
from bottomlock.statistics.rms import rms

ALONE: tuple[FixMethod, ...] = ("lc", "nsv", "plcf", "weak_sway")
"""Methods that need no INS: least squares, sway zero, the components that are determined, the weak sway row."""
WITH_PRIOR: tuple[FixMethod, ...] = ("vb", "vhv", "info")
"""Methods that need a prior velocity, here of a random walk; with it the information form is a Kalman update."""


SAME_MPS = 1e-6
"""Standard deviations of a difference below this are rounding: both velocities come from the same rows."""


WALK_MPS_RTS = 0.1
"""Random walk of the velocity, m/s per root second and axis."""
START_SD_MPS = 1.0
"""1 sigma of the velocity before the first ping."""


@dataclass(frozen=True, eq=False)
class Priors:
    """Predicted velocity (n, 3) and covariance (n, 3, 3) at each ping, before its update; platform frame."""

    velocity_p_mps: Floats
    cov_m2ps2: Floats


def random_walk(
    geometry: BeamGeometry,
    time_ns: Times,
    velocity_mps: Floats,
    valid: Flags,
    sd_mps: Floats,
    walk_mps_rts: float = WALK_MPS_RTS,
) -> Priors:
    """Predictions of a Kalman filter of the velocity alone, updated with the valid beams of every ping.

    State v, transition 1, process noise q² Δt per axis, measurement y = B v with one row per valid beam. `sd_mps` is
    (B,) or (n, B).
    """
    sd_mps = np.broadcast_to(sd_mps, velocity_mps.shape)
    B = np.asarray(geometry.directions_p)
    v, P = np.zeros(3), np.eye(3) * START_SD_MPS**2
    velocity, cov = np.empty((len(time_ns), 3)), np.empty((len(time_ns), 3, 3))
    before_ns = int(time_ns[0])
    for k, now_ns in enumerate(time_ns):
        P = P + np.eye(3) * walk_mps_rts**2 * (int(now_ns) - before_ns) * 1e-9
        before_ns = int(now_ns)
        velocity[k], cov[k] = v, P
        rows = valid[k]
        if rows.any():
            v, P = _fuse(v, P, B[rows], velocity_mps[k, rows], sd_mps[k, rows])
    return Priors(velocity, cov)


def _fuse(v: Floats, P: Floats, H: Floats, y: Floats, sd: Floats) -> tuple[Floats, Floats]:
    """Kalman update in information form, which also holds for rank-deficient rows."""
    weights = H.T / sd**2
    information = np.linalg.inv(P) + weights @ H
    cov = np.linalg.inv(information)
    return v + cov @ (weights @ (y - H @ v)), 0.5 * (cov + cov.T)


def leave_out(
    geometry: BeamGeometry,
    time_ns: Times,
    velocity_mps: Floats,
    valid: Flags,
    sd_mps: Floats,
    *,
    beams: int,
    walk_mps_rts: float = WALK_MPS_RTS,
    closure_gate: float | None = 3.0,
    robust: bool = True,
    instrument_valid: Flags | None = None,
) -> pl.DataFrame:
    """Scores of every method with every set of `beams` beams left out (`files.replay_tables.SCORES`).

    Args:
        geometry: four beams or more, of rank 3.
        time_ns: (n,) times of the pings.
        velocity_mps: (n, B) beam velocities.
        valid: (n, B) validity.
        sd_mps: (B,) noise of the beams, 1 sigma.
        beams: number of beams left out at a time.
        walk_mps_rts: random walk of the velocity, for the prior.
        closure_gate: pings whose closure residual exceeds this many robust sigmas (of the recording itself) are not
            scored; None scores all.
        robust: noise and tail as measured on the closure, prior without outliers; otherwise as claimed, and Gaussian.
        instrument_valid: (n,) the instrument's own flag of its velocity, for `robust`.

    Returns:
        Components surge, sway and heave against the least squares of all beams, and "beam": the reading of each beam
        left out against the method's velocity along it, the only score whose noise is independent of the method's.

    Raises:
        DataError: for an instrument without redundant beams, or a recording without a ping of all beams.
    """
    if geometry.beams <= geometry.rank or geometry.rank < 3:
        raise DataError(
            f"the geometry has {geometry.beams} beams, rank {geometry.rank}",
            expected="four or more, rank 3: without redundancy no beam can be left out",
        )
    if not 1 <= beams < geometry.beams:
        raise DataError(f"{beams} beams to leave out", expected=f"1 to {geometry.beams - 1}")
    noise, shown_before, sd_before = claimed_noise(len(valid)), valid, sd_mps
    if robust:
        noise = measure_noise(geometry, velocity_mps, valid, sd_mps, instrument_valid)
        screened = screen_beams(geometry, time_ns, velocity_mps, valid, sd_mps, noise)
        shown_before, sd_before = screened.valid, screened.factor[:, None] * sd_mps
    priors = random_walk(geometry, time_ns, velocity_mps, shown_before, sd_before, walk_mps_rts)
    scored = reference_pings(geometry, velocity_mps, valid, closure_gate)
    if not scored.any():
        raise DataError(
            "no ping has all beams valid", expected="some: there is no reference to score against"
        )
    pings = _Scored(
        geometry,
        np.ascontiguousarray(velocity_mps[scored]),
        sd_mps,
        Priors(priors.velocity_p_mps[scored], priors.cov_m2ps2[scored]),
        # The closure of a ping that loses a beam would not be known: its noise is that of the log.
        BeamNoise(noise.factor[scored], noise.halfwidths[scored], noise.groups),
    )
    everything = np.ones(pings.y.shape, dtype=bool)
    all_beams = pings.fixes(everything, "lc")
    rows = []
    for lost in combinations(range(geometry.beams), beams):
        shown = everything.copy()
        shown[:, list(lost)] = False
        for method in (*ALONE, *WITH_PRIOR):
            rows += _scores(pings, lost, method, shown, all_beams)
    return pl.DataFrame(rows, schema=dict(SCORES), orient="row")


def reference_pings(
    geometry: BeamGeometry, velocity_mps: Floats, valid: Flags, closure_gate: float | None
) -> Flags:
    """(n,) pings with all beams valid whose closure is not an outlier."""
    every = np.asarray(valid.all(axis=1))
    if closure_gate is None or not every.any():
        return np.asarray(every)
    closure = np.where(every[:, None], velocity_mps, 0.0) @ closure_rows(geometry.directions_p).T
    sigma = sd_about_zero(closure[every], axis=0)
    return np.asarray(every & (np.abs(closure) <= closure_gate * sigma).all(axis=1))


@dataclass(frozen=True, eq=False)
class _Scored:
    """The scored pings: readings (n, B), claimed noise (B,), prior, and the noise to be used."""

    geometry: BeamGeometry
    y: Floats
    sd_mps: Floats
    priors: Priors
    noise: BeamNoise

    def fixes(self, shown: Flags, method: FixMethod, y: Floats | None = None) -> VelocityFixes:
        """Fixes of the shown beams (n, B), of other readings if given."""
        return solve_scaled(
            self.geometry,
            self.y if y is None else y,
            shown,
            self.noise.factor,
            method=method,
            beam_sd_mps=self.sd_mps,
            prior_velocity_p_mps=self.priors.velocity_p_mps if method in WITH_PRIOR else None,
            prior_cov_m2ps2=self.priors.cov_m2ps2 if method in WITH_PRIOR else None,
        )

    def solve(self, shown: Flags, method: FixMethod, y: Floats | None = None) -> tuple[Floats, Floats]:
        """Velocities (n, 3), NaN where unsolved, and their covariances."""
        fixes = self.fixes(shown, method, y)
        if method != "info":
            return fixes.velocity_p_mps, fixes.cov_m2ps2
        # Λ of the rows and the velocity in its row space, fused with the prior: P⁺ = (P⁻¹ + Λ)⁻¹.
        information = fixes.information_s2pm2
        cov = np.linalg.inv(np.linalg.inv(self.priors.cov_m2ps2) + information)
        innovation = fixes.observed_velocity_p_mps - self.priors.velocity_p_mps
        change = (cov @ information @ innovation[:, :, None])[:, :, 0]
        return np.asarray(self.priors.velocity_p_mps + change), np.asarray(cov)

    def response(self, shown: Flags, method: FixMethod) -> Floats:
        """(n, 3, 3) derivative of a method's velocity by the true velocity, through the beams only.

        Every method is linear in the beams, so that three velocities of 1 m/s give the derivative exactly.
        """
        B = np.asarray(self.geometry.directions_p)
        base, _ = self.solve(shown, method)
        moved = [self.solve(shown, method, self.y + B[:, k])[0] - base for k in range(3)]
        return np.stack(moved, axis=2)


def _scores(
    pings: _Scored, lost: Sequence[int], method: FixMethod, shown: Flags, all_beams: VelocityFixes
) -> list[tuple[object, ...]]:
    """Rows of `files.replay_tables.SCORES` of one method without these beams.

    The remaining beams are in both velocities. With response J, covariance C of the method and W of all beams, the
    covariance of the difference is C + W − J W − W Jᵀ.
    """
    velocity, cov = pings.solve(shown, method)
    name = "+".join(str(beam + 1) for beam in lost)
    rows = []
    shared = pings.response(shown, method) @ all_beams.cov_m2ps2
    difference = cov + all_beams.cov_m2ps2 - shared - np.swapaxes(shared, 1, 2)
    halfwidths = pings.noise.halfwidths
    for k, axis in enumerate(("surge", "sway", "heave")):
        sd = np.sqrt(np.maximum(difference[:, k, k], 0.0))
        error = all_beams.velocity_p_mps[:, k] - velocity[:, k]
        rows.append((name, method, axis, *_numbers(error, sd, halfwidths)))
    directions = np.asarray(pings.geometry.directions_p)
    errors, sds = [], []
    for beam in lost:
        b = directions[beam]
        errors.append(pings.y[:, beam] - velocity @ b)
        reading_sd = pings.noise.factor * pings.sd_mps[beam]
        sds.append(np.sqrt(np.einsum("i,nij,j->n", b, cov, b) + reading_sd**2))
    halfwidths = np.tile(halfwidths, (len(lost), 1))
    rows.append((name, method, "beam", *_numbers(np.concatenate(errors), np.concatenate(sds), halfwidths)))
    return rows


def _numbers(error: Floats, error_sd: Floats, halfwidths: Floats) -> tuple[object, ...]:
    """Columns of `files.replay_tables.SCORES` from `pings` on; `halfwidths` (n, 3) are in standard deviations."""
    solved = np.isfinite(error)
    if not solved.any():
        return (len(error), 0, *[None] * 9)
    size, sd = np.abs(error[solved]), error_sd[solved]
    # Where the same rows solve both, the difference has no standard deviation and there is no ratio.
    apart = sd > SAME_MPS
    ratio = size[apart] / sd[apart]
    has_ratio = ratio.size > 0
    covered = (ratio[:, None] <= halfwidths[solved][apart]).mean(axis=0) if has_ratio else [None] * 3
    return (
        len(error),
        int(solved.sum()),
        float(np.median(size)),
        float(rms(size)),
        float(np.percentile(size, 95.0)),
        float(np.median(sd)),
        float(rms(ratio)) if has_ratio else None,
        float(sd_about_zero(ratio)) if has_ratio else None,
        *(None if part is None else float(part) for part in covered),
    )


def over_sets(scores: pl.DataFrame) -> pl.DataFrame:
    """A row per method and component: medians over the sets of beams left out, and how many sets were solvable."""
    numbers = [name for name, dtype in SCORES.items() if dtype == pl.Float64()]
    return scores.group_by("method", "component", maintain_order=True).agg(
        pl.len().cast(pl.Int64).alias("sets"),
        (pl.col("solved") > 0).sum().cast(pl.Int64).alias("sets_solved"),
        *(pl.col(name).median() for name in numbers),
    )
