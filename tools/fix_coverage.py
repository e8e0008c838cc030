"""The tables of docs/robust.md on fixes without a filter: `python -m tools.fix_coverage [--write docs/robust.md]`.

How much of the errors the covariance of `bottomlock fix` covers, in % of 1, 2 and 3 sigma: of simulated logs and of the
shipped dive, whose truth is known; and of recordings, where each beam of a ping with four is left out and the fix of
the other three predicts it. Prints the tables, of recordings where BOTTOMLOCK_RECORDINGS has a folder.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.io.beams import read_beams, read_geometry
from bottomlock.kernel import BeamGeometry
from bottomlock.replay.beam_noise import GAUSSIAN, BeamNoise, claimed_noise, measure_noise
from bottomlock.replay.ping_scale import ping_noise
from bottomlock.replay.robust_fix import solve_scaled
from bottomlock.replay.screen_beams import screen_beams
from tools.audit_worlds import SHIPPED, World, others, recorded
from tools.recorded_tables import table
from tools.score_recorded import print_or_write

PINGS, SEEDS = 1500, range(401, 407)
"""Pings of one half of a simulated log, and the seed of each log."""
NOISE_MPS, WALK_MPS, GREATEST_MPS, THREE_BEAMS = 0.03, 0.003, 5.0, 0.2
KINDS = {
    "1.5": "Student's t, 1.5 degrees",
    "2": "Student's t, 2 degrees",
    "3": "Student's t, 3 degrees",
    "contaminated": "3 % of the readings 12 times noisier",
    "together": "all beams of a ping noisy together, 1.5 degrees",
    "gaussian": "Gaussian",
}
BLOCKS, RESAMPLES = 25, 2000

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Log:
    """Pings of a log: times (n,), beams (n, 4) of claimed noise (4,), the instrument's flag, and the truth (n, 3)."""

    geometry: BeamGeometry
    sd_mps: Array
    time_ns: NDArray[np.int64]
    velocity_mps: Array
    valid: Flags
    instrument_valid: Flags | None = None
    truth_mps: Array | None = None

    @property
    def first(self) -> Flags:
        """(n,) the pings of the first half."""
        return np.arange(len(self.valid)) < len(self.valid) // 2

    def noise_of(self, measured: Flags) -> BeamNoise:
        """The noise of every ping, measured on some of them: the others count as without every beam."""
        valid = self.valid & measured[:, None]
        return measure_noise(self.geometry, self.velocity_mps, valid, self.sd_mps, self.instrument_valid)


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors (n,) or (n, 3) with their standard deviations, of the noise of the log and of the ping."""

    error_mps: Array
    of_log_mps: Array
    of_ping_mps: Array


def of_fixes(log: Log, noise: BeamNoise, where: Flags) -> Errors:
    """Errors of the fixes of some pings of a log whose truth is known; only these pings are screened."""
    assert log.truth_mps is not None
    part = dataclasses.replace(
        log, time_ns=log.time_ns[where], velocity_mps=log.velocity_mps[where], valid=log.valid[where]
    )
    noise = dataclasses.replace(
        noise, factor=noise.factor[where], halfwidths=noise.halfwidths[where], degrees=noise.degrees[where]
    )
    screened = screen_beams(part.geometry, part.time_ns, part.velocity_mps, part.valid, part.sd_mps, noise)
    own, _ = ping_noise(part.geometry, part.velocity_mps, part.sd_mps, noise, screened)
    sd = []
    for factor in (screened.factor, own):
        fixes = solve_scaled(
            part.geometry, part.velocity_mps, screened.valid, factor, method="lc", beam_sd_mps=part.sd_mps
        )
        sd.append(np.sqrt(np.diagonal(fixes.cov_m2ps2, axis1=1, axis2=2)))
    error = fixes.velocity_p_mps - log.truth_mps[where]
    solved = np.isfinite(error).all(axis=1)
    return Errors(error[solved], sd[0][solved], sd[1][solved])


def of_left_out(log: Log, noise: BeamNoise, where: Flags) -> Errors:
    """Each beam of the pings with four against the fix of the other three, whose outlier those three cannot show."""
    where = where & log.valid.all(axis=1)
    screened = screen_beams(log.geometry, log.time_ns, log.velocity_mps, log.valid, log.sd_mps, noise)
    errors: list[Array] = []
    claims: list[list[Array]] = []
    for beam, b in enumerate(np.asarray(log.geometry.directions_p)):
        shown = log.valid.copy()
        shown[:, beam] = False
        three = dataclasses.replace(screened, valid=shown, factor=noise.factor)
        own, _ = ping_noise(log.geometry, log.velocity_mps, log.sd_mps, noise, three)
        sd = []
        for factor in (noise.factor, own):
            fixes = solve_scaled(
                log.geometry, log.velocity_mps, shown, factor, method="lc", beam_sd_mps=log.sd_mps
            )
            of_fix = np.einsum("i,nij,j->n", b, fixes.cov_m2ps2, b)
            sd.append(np.sqrt(of_fix + (factor * log.sd_mps[beam]) ** 2)[where])
        errors.append((log.velocity_mps[:, beam] - fixes.velocity_p_mps @ b)[where])
        claims.append(sd)
    return Errors(np.stack(errors, axis=1), *(np.stack(sd, axis=1) for sd in zip(*claims, strict=True)))


def covered(error: Array, sd: Array, halfwidths: Array | tuple[float, ...] = GAUSSIAN) -> Array:
    """Percent of the errors within 1, 2 and 3 sigma, or within `halfwidths` ((3,) or (n, 3)) times sigma."""
    limits = np.broadcast_to(np.asarray(halfwidths), (len(error), 3))
    ratio = (np.abs(error) / sd).reshape(len(error), -1)
    return np.asarray(100.0 * (ratio[:, :, None] <= limits[:, None]).mean(axis=(0, 1)))


def drawn(kind: str, rng: np.random.Generator, pings: int) -> Array:
    """(pings, 4) noise of unit scale."""
    if kind == "gaussian":
        return rng.normal(size=(pings, 4))
    if kind == "contaminated":
        return rng.normal(size=(pings, 4)) * np.where(rng.random((pings, 4)) < 0.03, 12.0, 1.0)
    if kind == "together":
        return rng.normal(size=(pings, 4)) * np.sqrt(1.5 / rng.chisquare(1.5, size=(pings, 1)))
    return rng.standard_t(float(kind), (pings, 4))


def simulated(kind: str, seed: int) -> Log:
    """A 25° Janus on a vehicle whose velocity walks; a fifth of the pings has three beams."""
    rng = np.random.default_rng(seed)
    geometry, pings = BeamGeometry.janus(np.deg2rad(25.0)), 2 * PINGS
    velocity = np.array([1.0, 0.0, 0.1]) + np.cumsum(rng.normal(size=(pings, 3)) * WALK_MPS, axis=0)
    noise = np.clip(NOISE_MPS * drawn(kind, rng, pings), -GREATEST_MPS, GREATEST_MPS)
    valid = np.ones((pings, 4), dtype=bool)
    lost = np.flatnonzero(rng.random(pings) < THREE_BEAMS)
    valid[lost, rng.integers(0, 4, len(lost))] = False
    return Log(
        geometry, np.full(4, 0.02), np.arange(pings) * 350_000_000, geometry.beam_velocities(velocity) + noise, valid,
        truth_mps=velocity,
    )  # fmt: skip


def second_half(kind: str, seed: int) -> Errors:
    """Errors of the fixes of the second half of a simulated log, with the noise of the first."""
    log = simulated(kind, seed)
    return of_fixes(log, log.noise_of(log.first), ~log.first)


def percents(values: Array) -> str:
    """Three of them."""
    return ", ".join(f"{value:.1f}" for value in values)


def simulated_row(kind: str, words: str) -> list[str]:
    """Coverage of six logs with one kind of noise, mean and range, and 3 sigma of surge beside its errors."""
    halves = [second_half(kind, seed) for seed in SEEDS]
    of_log = np.array([covered(half.error_mps, half.of_log_mps) for half in halves])
    of_ping = np.array([covered(half.error_mps, half.of_ping_mps) for half in halves])
    spread = zip(of_ping.mean(axis=0), of_ping.min(axis=0), of_ping.max(axis=0), strict=True)
    claim = 3.0 * np.concatenate([half.of_ping_mps[:, 0] for half in halves])
    errors = np.abs(np.concatenate([half.error_mps[:, 0] for half in halves]))
    return [
        words,
        percents(of_log.mean(axis=0)),
        ", ".join(f"{mean:.1f} ({least:.1f}–{most:.1f})" for mean, least, most in spread),
        f"{np.median(claim):.2f}, {np.quantile(claim, 0.99):.2f}; {np.quantile(errors, 0.997):.2f}",
    ]


def simulated_table() -> str:
    """A row for each kind of noise."""
    head = ["Noise of a reading", "with the noise of the log", "with the noise of the ping", "3 σ, m/s"]
    return table(head, [simulated_row(kind, words) for kind, words in KINDS.items()], left=4)


def caves(recordings: Path) -> Log | None:
    """The pings of the caves recording, where it is."""
    path = recordings / "caves_girona_linkquest" / "dvl_linkquest.csv"
    if not path.is_file():
        return None
    instrument = read_geometry("linkquest_caves")
    pings = read_beams(path, geometry=instrument)
    return Log(
        instrument.geometry, np.broadcast_to(instrument.beam_sd_mps, (4,)), pings.time_ns, pings.velocity_mps,
        pings.valid, pings.instrument_valid,
    )  # fmt: skip


def with_interval(within: Flags) -> list[str]:
    """Percent of (n, 4, 3) within 1, 2 and 3 sigma, and their 95 % from resampled blocks of consecutive pings."""
    blocks = np.array_split(within, BLOCKS)
    inside = np.array([block.sum(axis=(0, 1)) for block in blocks], dtype=float)
    count = np.array([block[..., 0].size for block in blocks], dtype=float)
    chosen = np.random.default_rng(0).integers(0, BLOCKS, size=(RESAMPLES, BLOCKS))
    means = inside[chosen].sum(axis=1) / count[chosen].sum(axis=1)[:, None]
    low, high = 100.0 * np.quantile(means, [0.025, 0.975], axis=0)
    whole = 100.0 * within.mean(axis=(0, 1))
    return [f"{m:.1f} ({a:.1f}–{b:.1f})" for m, a, b in zip(whole, low, high, strict=True)]


def caves_table(log: Log) -> str:
    """The noise of the log on the caves' pings, all and those that the instrument accepts."""
    assert log.instrument_valid is not None
    every = np.ones(len(log.valid), dtype=bool)
    pooled = dataclasses.replace(log, instrument_valid=None)
    claimed = claimed_noise(len(log.valid))
    measured = log.noise_of(every)
    gaussian = dataclasses.replace(measured, halfwidths=claimed.halfwidths)
    halves = (log.noise_of(log.first), log.noise_of(~log.first))
    accepted = {
        "measured": (measured, every),
        "claimed, `--no-robust`": (claimed, every),
        "measured, multiples of one σ": (gaussian, every),
        "measured without the flag": (pooled.noise_of(every), every),
        "first half measured, second covered": (halves[0], ~log.first),
        "second half measured, first covered": (halves[1], log.first),
    }
    rows = []
    for words, flag, cases in (
        ("accepted by the instrument", log.instrument_valid, accepted),
        ("all with four beams", every, dict(list(accepted.items())[:2])),
    ):
        count = int((flag & log.valid.all(axis=1)).sum())
        for number, (noise_words, (noise, covers)) in enumerate(cases.items()):
            where = flag & covers & log.valid.all(axis=1)
            errors = of_left_out(log, noise, where)
            ratio = np.abs(errors.error_mps) / errors.of_log_mps
            within = ratio[:, :, None] <= noise.halfwidths[where][:, None]
            rows.append(["" if number else f"{words} ({count:,})", noise_words, *with_interval(within)])
    return table(["Pings", "Noise", "1 sigma", "2 sigma", "3 sigma"], rows, left=2)


def of_world(world: World) -> Log:
    """The log of a recording; a claim of 2 cm/s, since the measured noise takes its place."""
    assert world.geometry is not None
    log = world.log
    return Log(
        world.geometry, np.full(log.beams, 0.02), log.time_ns, log.velocity_mps, log.valid, log.instrument_valid
    )  # fmt: skip


def shipped_dive(log: Log) -> Log:
    """With the truth of the dive that ships."""
    truth = pl.read_csv(SHIPPED / "survey_dive" / "truth.csv")
    axes = [truth[f"{name}_mps"].to_numpy() for name in ("surge", "sway", "heave")]
    stamps = truth["time_ns"].to_numpy()
    velocity = np.stack(
        [np.interp(log.time_ns - stamps[0], stamps - stamps[0], axis) for axis in axes], axis=1
    )
    return dataclasses.replace(log, truth_mps=velocity)


def logs(recordings: Path | None, scratch: Path) -> Iterator[tuple[str, Log, Flags]]:
    """Name, log and pings that are judged."""
    by_name = {world.name: world for world in (*others(recordings, scratch), *recorded(recordings, scratch))}
    dive = shipped_dive(of_world(by_name["Workhorse, IMU and compass"]))
    yield "survey dive", dive, np.ones(len(dive.valid), dtype=bool)
    of_caves = caves(recordings) if recordings else None
    if of_caves is not None and of_caves.instrument_valid is not None:
        yield "caves, accepted", of_caves, of_caves.instrument_valid
    for words, name in (("river profiler", "river profiler"), ("A50 circle", "A50, circle")):
        if name in by_name:
            log = of_world(by_name[name])
            yield words, log, np.ones(len(log.valid), dtype=bool)


def halves_table(recordings: Path | None, scratch: Path) -> str:
    """Either half of a log measured, and the other covered."""
    rows = []
    for name, log, judged in logs(recordings, scratch):
        for words, half in (("first half", log.first), ("second half", ~log.first)):
            of = of_left_out if log.truth_mps is None else of_fixes
            errors = of(log, log.noise_of(half), judged & ~half)
            what = "pings" if log.truth_mps is None else "fixes"
            rows.append([
                f"{name}, {len(errors.error_mps):,} {what}", words,
                percents(covered(errors.error_mps, errors.of_log_mps)),
                percents(covered(errors.error_mps, errors.of_ping_mps)),
            ])  # fmt: skip
    return table(
        ["Log", "Measured on", "with the noise of the log", "with the noise of the ping"], rows, left=4
    )


def main() -> None:
    """Prints or writes the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", type=Path, help="page to write the tables into")
    arguments = parser.parse_args()
    folder = os.environ.get("BOTTOMLOCK_RECORDINGS")
    recordings = Path(folder) if folder else None
    made = {"simulated": simulated_table()}
    of_caves = caves(recordings) if recordings else None
    if of_caves is not None:
        made["caves"] = caves_table(of_caves)
    with tempfile.TemporaryDirectory() as scratch:
        made["halves"] = halves_table(recordings, Path(scratch))
    print_or_write(arguments.write, made)


if __name__ == "__main__":
    main()
