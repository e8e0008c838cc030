"""Leave beams out of recorded pings that have them all, and see how far each method's velocity is off without them.

A ping whose every beam returned, and fits the others, is its own reference: the velocity of all beams by least
squares, and the reading of the beam that a method was not shown. Methods without a prior see the ping alone. Methods
with one see, too, the velocity that a random walk carries over from the pings before, every one of them with all its
beams.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, VelocityFixes, solve_velocity
from bottomlock.replay.dive import Flags, Floats, Times
from bottomlock.replay.random_errors import closure_directions
from bottomlock.statistics.rms import rms
from bottomlock.tables.replay import SCORES

ALONE = ("lc", "nsv", "plcf", "weak_sway")
"""Methods that need no INS: least squares, sway zero, the components that are determined, the weak sway row."""
WITH_PRIOR = ("vb", "vhv", "info")
"""Methods that need a velocity to expect, here a random walk's; with it the information form is a Kalman update."""


SAME_MPS = 1e-6
"""Claimed differences below this are rounding: both velocities come from the same rows."""


@dataclass(frozen=True)
class Walk:
    """A velocity that walks at random, m/s per root second and axis, from a start known to `start_sd_mps`."""

    walk_mps_rts: float = 0.1
    start_sd_mps: float = 1.0


@dataclass(frozen=True, eq=False)
class Priors:
    """What the random walk expects at each ping, before it: velocity (n, 3) and covariance (n, 3, 3)."""

    velocity_p_mps: Floats
    cov_m2ps2: Floats


def random_walk(
    geometry: BeamGeometry, time_ns: Times, velocity_mps: Floats, valid: Flags, sd_mps: Floats, walk: Walk
) -> Priors:
    """Priors of a Kalman filter of the velocity alone, fed every ping with the beams that it has.

    State v, transition 1, process noise q² Δt per axis, measurement y = B v with one row per valid beam.
    """
    B = np.asarray(geometry.directions_p)
    v, P = np.zeros(3), np.eye(3) * walk.start_sd_mps**2
    velocity, cov = np.empty((len(time_ns), 3)), np.empty((len(time_ns), 3, 3))
    before_ns = int(time_ns[0])
    for k, now_ns in enumerate(time_ns):
        P = P + np.eye(3) * walk.walk_mps_rts**2 * (int(now_ns) - before_ns) * 1e-9
        before_ns = int(now_ns)
        velocity[k], cov[k] = v, P
        rows = valid[k]
        if rows.any():
            v, P = _fuse(v, P, B[rows], velocity_mps[k, rows], sd_mps[rows])
    return Priors(velocity, cov)


def _fuse(v: Floats, P: Floats, H: Floats, y: Floats, sd: Floats) -> tuple[Floats, Floats]:
    """Kalman update in information form, which a rank-deficient set of rows does not trouble."""
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
    walk: Walk | None = None,
    closure_gate: float | None = 3.0,
) -> pl.DataFrame:
    """Scores of every method with every set of so many beams left out (`tables.replay.SCORES`).

    Args:
        geometry: four beams or more, of rank 3.
        time_ns: (n,) of the pings.
        velocity_mps: (n, B).
        valid: (n, B).
        sd_mps: (B,) noise of the beams, 1 sigma.
        beams: how many are left out at a time.
        walk: of the prior.
        closure_gate: pings whose closure residual is greater than so many of its sigmas are no reference and are not
        scored;
            None scores all. The sigma is the robust one of the recording itself.

    Returns:
        Components surge, sway and heave against least squares of all beams, and "beam": the reading of each beam
        that was left out against what the method's velocity says of it, the only score that shares no noise with the
        method.

    Raises:
        DataError: for an instrument without redundant beams, or a recording without a ping of all beams.
    """
    if geometry.beams <= geometry.rank or geometry.rank < 3:
        raise DataError(
            f"{geometry.beams} beams of rank {geometry.rank} hold no redundancy: there is nothing to leave out"
        )
    if not 1 <= beams < geometry.beams:
        raise DataError(f"{beams} beams to leave out, expected 1 to {geometry.beams - 1}")
    priors = random_walk(geometry, time_ns, velocity_mps, valid, sd_mps, walk or Walk())
    scored = reference_pings(geometry, velocity_mps, valid, closure_gate)
    if not scored.any():
        raise DataError("no ping has every beam: there is no reference to score against")
    y = np.ascontiguousarray(velocity_mps[scored])
    whole = solve_velocity(geometry, y, np.ones(y.shape, dtype=bool), method="lc", beam_sd_mps=sd_mps)
    here = Priors(priors.velocity_p_mps[scored], priors.cov_m2ps2[scored])
    rows = []
    for lost in combinations(range(geometry.beams), beams):
        shown = np.ones(y.shape, dtype=bool)
        shown[:, list(lost)] = False
        for method in (*ALONE, *WITH_PRIOR):
            solution = _solve(geometry, y, shown, sd_mps, method, here)
            response = _response(geometry, y, shown, sd_mps, method, here)
            rows += _scores(lost, method, solution, response, whole, y, geometry, sd_mps)
    return pl.DataFrame(rows, schema=dict(SCORES), orient="row")


def reference_pings(
    geometry: BeamGeometry, velocity_mps: Floats, valid: Flags, closure_gate: float | None
) -> Flags:
    """(n,) pings of all beams whose closure is not an outlier."""
    every = np.asarray(valid.all(axis=1))
    if closure_gate is None or not every.any():
        return np.asarray(every)
    closure = np.where(every[:, None], velocity_mps, 0.0) @ closure_directions(geometry).T
    sigma = 1.4826 * np.median(np.abs(closure[every]), axis=0)
    return np.asarray(every & (np.abs(closure) <= closure_gate * sigma).all(axis=1))


def _solve(
    geometry: BeamGeometry, y: Floats, shown: Flags, sd_mps: Floats, method: str, priors: Priors
) -> tuple[Floats, Floats]:
    """Velocities (n, 3), NaN where unsolved, and their covariances."""
    fixes: VelocityFixes = solve_velocity(
        geometry,
        y,
        shown,
        method=method,
        beam_sd_mps=sd_mps,
        prior_velocity_p_mps=priors.velocity_p_mps if method in WITH_PRIOR else None,
        prior_cov_m2ps2=priors.cov_m2ps2 if method in WITH_PRIOR else None,
    )
    if method != "info":
        return fixes.velocity_p_mps, fixes.cov_m2ps2
    # Λ of the rows and the velocity along what they see, fused with the prior: P⁺ = (P⁻¹ + Λ)⁻¹.
    information = fixes.information_s2pm2
    cov = np.linalg.inv(np.linalg.inv(priors.cov_m2ps2) + information)
    innovation = fixes.observed_velocity_p_mps - priors.velocity_p_mps
    gain = cov @ information
    return np.asarray(priors.velocity_p_mps + np.einsum("nij,nj->ni", gain, innovation)), np.asarray(cov)


def _response(
    geometry: BeamGeometry, y: Floats, shown: Flags, sd_mps: Floats, method: str, priors: Priors
) -> Floats:
    """(n, 3, 3) how a method's velocity answers, through the beams alone, to a change of the true velocity.

    Every method is linear in the beams: three velocities of 1 m/s tell the whole of it.
    """
    B = np.asarray(geometry.directions_p)
    base, _ = _solve(geometry, y, shown, sd_mps, method, priors)
    moved = [_solve(geometry, y + B[:, k], shown, sd_mps, method, priors)[0] - base for k in range(3)]
    return np.stack(moved, axis=2)


def _scores(
    lost: Sequence[int],
    method: str,
    solution: tuple[Floats, Floats],
    response: Floats,
    whole: VelocityFixes,
    y: Floats,
    geometry: BeamGeometry,
    sd_mps: Floats,
) -> list[tuple[object, ...]]:
    """Rows of `tables.replay.SCORES` of one method without these beams.

    The beams that are left are in both velocities. With response J, covariance C of the method and W of all beams, the
    difference of the two has C + W − J W − W Jᵀ.
    """
    velocity, cov = solution
    name = "+".join(str(beam + 1) for beam in lost)
    rows = []
    shared = response @ whole.cov_m2ps2
    difference = cov + whole.cov_m2ps2 - shared - np.swapaxes(shared, 1, 2)
    for k, axis in enumerate(("surge", "sway", "heave")):
        claimed = np.sqrt(np.maximum(difference[:, k, k], 0.0))
        rows.append((name, method, axis, *_numbers(whole.velocity_p_mps[:, k] - velocity[:, k], claimed)))
    directions = np.asarray(geometry.directions_p)
    errors, claims = [], []
    for beam in lost:
        b = directions[beam]
        errors.append(y[:, beam] - velocity @ b)
        claims.append(np.sqrt(np.einsum("i,nij,j->n", b, cov, b) + sd_mps[beam] ** 2))
    rows.append((name, method, "beam", *_numbers(np.concatenate(errors), np.concatenate(claims))))
    return rows


def _numbers(error: Floats, claimed: Floats) -> tuple[object, ...]:
    solved = np.isfinite(error)
    if not solved.any():
        return (len(error), 0, None, None, None, None, None, None)
    size, sd = np.abs(error[solved]), claimed[solved]
    # Where nothing was claimed to differ (the same rows solve both), there is no ratio.
    apart = sd > SAME_MPS
    ratio = size[apart] / sd[apart]
    told = ratio.size > 0
    return (
        len(error),
        int(solved.sum()),
        float(np.median(size)),
        float(rms(size)),
        float(np.percentile(size, 95.0)),
        float(np.median(sd)),
        float(rms(ratio)) if told else None,
        float(1.4826 * np.median(ratio)) if told else None,
    )


def over_sets(scores: pl.DataFrame) -> pl.DataFrame:
    """A row per method and component: medians over the sets of beams left out, and how many sets were solvable."""
    numbers = [name for name, dtype in SCORES.items() if dtype == pl.Float64()]
    return scores.group_by("method", "component", maintain_order=True).agg(
        pl.len().cast(pl.Int64).alias("sets"),
        (pl.col("solved") > 0).sum().cast(pl.Int64).alias("sets_solved"),
        *(pl.col(name).median() for name in numbers),
    )
