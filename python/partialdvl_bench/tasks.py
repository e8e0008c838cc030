"""The tasks T2 to T4 and T6: which rows of a mission each scores, and its scores from estimates and truth."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from importlib import resources

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import DataError
from bottomlock.config.toml_file import parse_toml
from bottomlock.statistics.rms import rms
from partialdvl_bench.mission import Estimates, Mission
from partialdvl_bench.scores import drift_percent, energy_score, nees, negative_log_likelihood
from partialdvl_bench.tables import BODY, SCORES

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NAVIGATION, RECOVERY, CURRENT = "T2 navigation", "T3 recovery", "T4 current"
BLACKOUT = "T6 without bottom"
TASKS = (NAVIGATION, RECOVERY, CURRENT, BLACKOUT)

SEGMENT_M = 100.0
"""Distance travelled over which the drift of T2 is taken."""
OUTAGE_S = 15.0
"""T3 begins when the beams determine the velocity again after at least this time in which they did not."""
RECOVERY_S = 30.0
"""Time after an outage that T3 scores."""

BLACKOUT_S = 60.0
"""T6 scores the time without any beam of the bottom, of at least this length, of missions with water track."""

RANKED = "nats a component"
"""The score that ranks: negative log-likelihood over the number of components, mean over the rows of a mission."""


@lru_cache(maxsize=1)
def climatology() -> dict[str, tuple[Floats, Floats]]:
    """Mean and covariance of velocity, position and current over the train split, by block."""
    text = (resources.files("partialdvl_bench") / "climatology.toml").read_text(encoding="utf-8")
    content = parse_toml(text, place="partialdvl_bench/climatology.toml")
    return {block: (np.array(one["mean"]), np.array(one["cov"])) for block, one in content.items()}


def scores_of(mission: Mission, estimates: Estimates, method: str) -> pl.DataFrame:
    """Every score of one method on one mission (`tables.SCORES`).

    A row that is not answered is scored as the climatology of the train split: what is known without sensors. So a
    method does not gain by leaving out what is difficult, and loses no more than by knowing nothing.

    Raises:
        DataError: for a mission without truth.
    """
    truth = mission.truth
    if truth is None:
        raise DataError(f"mission '{mission.name}' has no truth here: it is sealed, or was made without it")
    rows: list[tuple[str, str, str, str, float, int]] = []

    def add(task: str, named: Iterator[tuple[str, float, int]]) -> None:
        rows.extend((method, mission.name, task, score, value, count) for score, value, count in named)

    velocity = _filled("velocity", estimates.velocity_p_mps, estimates.velocity_cov, truth.velocity_p_mps)
    position = _filled("position", estimates.position_t_m, estimates.position_cov, truth.position_t_m)
    current = _filled("current", estimates.current_t_mps, estimates.current_cov, truth.current_t_mps)
    every = np.ones(len(truth.time_ns), dtype=np.bool_)
    add(NAVIGATION, _proper([velocity, position], every))
    add(NAVIGATION, _of_block("velocity", velocity, every, BODY))
    add(NAVIGATION, _of_block("position", position, every, ()))
    if estimates.position_t_m is not None and np.isfinite(estimates.position_t_m).all():
        drift = drift_percent(estimates.position_t_m, truth.position_t_m, SEGMENT_M)
        if len(drift):
            add(NAVIGATION, iter([("drift, % DT", float(drift.mean()), len(drift))]))
    if estimates.wall_s is not None:
        add(NAVIGATION, iter([("time a reading, µs", 1e6 * estimates.wall_s / len(mission.imu.time_ns), 1)]))
    after = after_outages(mission)
    if after.any():
        add(RECOVERY, _proper([velocity], after))
        add(RECOVERY, _of_block("velocity", velocity, after, BODY))
    without = without_bottom(mission)
    if without.any():
        add(BLACKOUT, _proper([velocity, position], without))
        add(BLACKOUT, _of_block("velocity", velocity, without, BODY))
        add(BLACKOUT, _of_block("position", position, without, ()))
        add(BLACKOUT, _at_the_end(position, without))
    add(CURRENT, _proper([current], every))
    add(CURRENT, _of_block("current", current, every, ()))
    return pl.DataFrame(rows, schema=dict(SCORES), orient="row")


def after_outages(mission: Mission) -> Flags:
    """(n,) times of the grid within `RECOVERY_S` of the first ping that determines the velocity after an outage."""
    directions = np.asarray(mission.geometry.directions_p)
    whole = np.array([np.linalg.matrix_rank(directions[valid]) == 3 if valid.any() else False
                      for valid in mission.pings.valid])  # fmt: skip
    times = mission.pings.time_ns[whole]
    before = np.concatenate([[mission.start.time_ns], times[:-1]])
    ends = times[(times - before) * 1e-9 >= OUTAGE_S]
    since = (mission.grid_ns[:, None] - ends[None, :]) * 1e-9
    return np.asarray(((since >= 0.0) & (since < RECOVERY_S)).any(axis=1))


def without_bottom(mission: Mission) -> Flags:
    """(n,) times of the grid in `BLACKOUT_S` or more without a beam of the bottom; none of missions without water."""
    if mission.water is None:
        return np.zeros(len(mission.grid_ns), dtype=np.bool_)
    seen = mission.pings.time_ns[mission.pings.valid.any(axis=1)]
    before = np.concatenate([[mission.start.time_ns], seen])
    after = np.concatenate([seen, [mission.grid_ns[-1] + 1]])
    long = after - before >= round(1e9 * BLACKOUT_S)
    between = (mission.grid_ns[:, None] > before[long]) & (mission.grid_ns[:, None] < after[long])
    return np.asarray(between.any(axis=1))


class _Block:
    """Errors (n, d), covariances (n, d, d) and which rows were answered (n,)."""

    def __init__(self, error: Floats, cov: Floats, answered: Flags) -> None:
        self.error, self.cov, self.answered = error, cov, answered


def _filled(block: str, value: Floats | None, cov: Floats | None, truth: Floats) -> _Block:
    """The errors of a block, with the climatology where there is no answer."""
    mean, spread = climatology()[block]
    usual = np.tile(spread, (len(truth), 1, 1))
    if value is None or cov is None:
        return _Block(mean - truth, usual, np.zeros(len(truth), dtype=np.bool_))
    answered = np.asarray(np.isfinite(value).all(axis=1) & np.isfinite(cov).all(axis=(1, 2)))
    error = np.where(answered[:, None], value, mean) - truth
    return _Block(error, np.where(answered[:, None, None], cov, usual), answered)


def _proper(blocks: Sequence[_Block], rows: Flags) -> Iterator[tuple[str, float, int]]:
    """The ranking score: likelihoods of the blocks added, over their number of components."""
    total = sum(negative_log_likelihood(block.error[rows], block.cov[rows]) for block in blocks)
    components = sum(block.error.shape[1] for block in blocks)
    yield RANKED, float(np.mean(total)) / components, int(rows.sum())


def _of_block(name: str, block: _Block, rows: Flags, axes: Sequence[str]) -> Iterator[tuple[str, float, int]]:
    """Likelihood, energy score, RMS, NEES a component and availability of a block."""
    error, cov = block.error[rows], block.cov[rows]
    unit = "m" if name == "position" else "m/s"
    count, size = error.shape
    yield f"{name} likelihood, nats", float(negative_log_likelihood(error, cov).mean()), count
    yield f"{name} energy score, {unit}", float(energy_score(error, cov).mean()), count
    yield f"{name} RMS, {unit}", float(rms(np.linalg.norm(error, axis=1))), count
    for axis, column in zip(axes, error.T, strict=False):
        yield f"{axis} RMS, {unit}", float(rms(column)), count
    yield f"{name} NEES a component", float(nees(error, cov).mean()) / size, count
    yield f"{name} availability", float(block.answered[rows].mean()), count


def _at_the_end(position: _Block, rows: Flags) -> Iterator[tuple[str, float, int]]:
    """Horizontal error of the last row of each stretch of rows, and the same over the claimed σ, RMS over them."""
    last = np.flatnonzero(rows & ~np.append(rows[1:], False))
    error, cov = position.error[last][:, :2], position.cov[last][:, :2, :2]
    off = np.linalg.norm(error, axis=1)
    yield "horizontal error at the end, m", float(rms(off)), len(last)
    ratio = off / np.sqrt(np.trace(cov, axis1=1, axis2=2))
    yield "error at the end over σ", float(rms(ratio)), len(last)
