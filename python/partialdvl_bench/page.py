"""The leaderboard as one self-contained page, made from the table of scores alone."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from bottomlock.figures.palette import STROKES
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result
from bottomlock.files.table_file import read_parquet
from bottomlock.io.beam_table import sha256_of
from bottomlock.pages.numbers import number
from bottomlock.pages.page import Block, Coloured, Page, Part, Picture, Table, Terms, html
from bottomlock.pages.pieces import difference, interval
from bottomlock.statistics.chi_squared import mean_band
from bottomlock.tables.check import check
from bottomlock.tables.spreadsheet import csv_text
from partialdvl_bench.beam_tasks import PINGS_TASK, VELOCITY_TASK
from partialdvl_bench.figure import leaderboard_figure
from partialdvl_bench.leaderboard import OVERALL, leaderboard
from partialdvl_bench.mission_list import FACTORS, SPLITS, levels, mission_list
from partialdvl_bench.tables import SCORES
from partialdvl_bench.tasks import BLACKOUT, CURRENT, NAVIGATION, RANKED, RECOVERY

NAME = "leaderboard"
"""Of the written files: `leaderboard.html`, `.parquet` and `.csv`."""

BAND = 0.95
TIE = 1e-9
"""Nats a component, below which two methods have answered the same."""

TOP = 6
"""Methods in the table by factor."""

COLUMNS: Mapping[str, tuple[str, ...]] = {
    VELOCITY_TASK: (
        f"{RANKED}, 1 beam", f"{RANKED}, 2 beams", f"{RANKED}, 3 beams", f"{RANKED}, 4 beams", "energy score, m/s",
        "RMS, m/s", "NEES a component", "availability",
    ),
    NAVIGATION: (
        "velocity energy score, m/s", "position energy score, m", "surge RMS, m/s", "sway RMS, m/s", "heave RMS, m/s",
        "position RMS, m", "drift, % DT", "velocity NEES a component", "position NEES a component",
        "velocity availability", "time a reading, µs",
    ),
    RECOVERY: (
        "velocity energy score, m/s", "surge RMS, m/s", "sway RMS, m/s", "heave RMS, m/s",
        "velocity NEES a component", "velocity availability",
    ),
    BLACKOUT: (
        "horizontal error at the end, m", "error at the end over σ", "position energy score, m", "velocity RMS, m/s",
        "velocity NEES a component", "position NEES a component", "velocity availability",
    ),
    CURRENT: ("current energy score, m/s", "current RMS, m/s", "current NEES a component", "current availability"),
    PINGS_TASK: ("energy score, m/s", "RMS, m/s", "NEES a component", "availability"),
}  # fmt: skip
"""Scores beside the ranking one, by task."""

WORDS: Mapping[str, str] = {
    OVERALL: "Mean over T2, T3, T4 and, where there is one, T6 of the ranking score.",
    VELOCITY_TASK: "The velocity from the beams of one ping, for every set of beams that could be left.",
    NAVIGATION: "Velocity and position at every second of every mission.",
    RECOVERY: "Velocity in the 30 s after beams determine it again, where they had not for 15 s or more.",
    CURRENT: "The velocity of the water at every second.",
    BLACKOUT: "Velocity and position while no beam returns from the bottom for a minute or more, with water track.",
    PINGS_TASK: "Pings of a RiverPro with four beams: what the beams left out read, from the others and earlier pings.",
}

_ABOUT = "Navigation with whatever beams of a Doppler velocity log return."
_RANKED = (
    "Ranked by the negative log-likelihood of the truth under each answer's Gaussian, in nats a component: less is "
    "better, and a claim of too much or too little certainty costs. Each mission counts alike. A row without an "
    "answer is scored as the mean and covariance over the train split."
)
_MADE = (
    "`bottomlock bench make` makes the missions from seeds, and compares their digests with the published ones; the "
    "seed of the test split is not in the package. `bottomlock bench run` and `beams` make the submissions, `score` "
    "scores them, and `page` writes this page from the scores alone."
)
_SAME = (
    "Two machines give the same missions bit for bit unless their last bits put a reading on the other side of a "
    "rounding step, which the digests show; scores then agree to the six digits of `leaderboard.csv` as far as the "
    "filters do, all but the times, which are those of one machine."
)


def write_page(
    file: str | Path, out: str | Path, *, reference: str | None = None, force: bool = False
) -> Path:
    """Writes the page and the table of the leaderboard.

    Args:
        file: Parquet file of scores (`tables.SCORES`).
        out: directory for `leaderboard.html`, `.parquet` and `.csv`.
        reference: method to which differences are taken; the one that leads by default.
        force: replace the leaderboard of other scores.

    Raises:
        DataError: for a file that holds no scores.
        OutputError: for a directory of something else, or of other scores without `force`, and where it cannot be
            written.
    """
    file, out = Path(file), Path(out)
    scores = check(read_parquet(file), SCORES, place=str(file))
    made_from = {"scores": sha256_of(file), "reference": reference or ""}
    result = Result(out, NAME, "bench page", made_from, [file])
    result.check(force=force)
    table = leaderboard(scores, reference)
    missions = set(scores["mission"])
    specs = [spec for spec in mission_list() if spec.name in missions]
    counts = {split: sum(spec.split == split for spec in specs) for split in ("train", "validation", "test")}
    told = ", ".join(f"{count} {split}" for split, count in counts.items() if count)
    version = " and ".join(dict.fromkeys(spec.version for spec in specs))
    led = _led(scores)
    names = table["method"].unique(maintain_order=True)
    page = Page(
        f"PartialDVL-Bench v{version}",
        [],
        [
            *(_task(table, task, led.get(task, [])) for task in (OVERALL, *COLUMNS) if task in table["task"]),
            _factors(scores, table),
            Part("entries", "Entries", [Terms([(f"`{name}`", _words(name)) for name in names])]),
            Part("made", "How it was made", [_MADE, _SAME]),
        ],
        "bottomlock",
        about=f"{_ABOUT} {table['method'].n_unique()} entries on {told} missions.\n\n{_RANKED}",
    )
    files: Files = {
        f"{NAME}.parquet": parquet_bytes(table),
        f"{NAME}.csv": csv_text(table, float_precision=6),
        f"{NAME}.html": html(page),
    }
    result.write(files, force=force)
    return out / f"{NAME}.html"


def _words(name: str) -> str:
    return STROKES[name].words if name in STROKES else "a rival; its model card says what it is"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


def _task(table: pl.DataFrame, task: str, led: Sequence[tuple[str, int]]) -> Part:
    """A task's part of the page: its ranking with a figure, and the other scores of each method."""
    rows = table.filter((pl.col("task") == task) & (pl.col("score") == RANKED))
    key, name = task.split(maxsplit=1)[0].lower(), _sentence(task)
    caption = f"{name}: {RANKED}, mean over missions with its 95 % interval; less is better."
    values = {
        score: dict(
            table.filter((pl.col("task") == task) & (pl.col("score") == score))
            .select("method", "value")
            .iter_rows()
        )
        for score in COLUMNS.get(task, ())
    }
    available = next((one for score, one in values.items() if "availability" in score), {})
    silent = {method for method, share in available.items() if share == 0.0}
    missions = int(rows["missions"].max() or 1)  # type: ignore[arg-type] # an Int64 column
    reference = rows["reference"][0]
    ranking = [
        [
            f"`{row['method']}`" + (" no answer" if row["method"] in silent else ""),
            interval(row["value"], row["lo"], row["hi"], nats),
            difference(row, nats),
        ]
        for row in rows.iter_rows(named=True)
    ]
    blocks: list[Block] = [
        WORDS[task],
        Picture.of(leaderboard_figure(rows, f"{RANKED} (less is better)"), key, caption, kind=""),
        Table(
            ["Entry", "nats", f"to {reference}"],
            ranking,
            f"Nats a component with 95 % intervals over missions, and the difference to {reference}, paired by "
            "mission.",
        ),
    ]
    if led:
        best = ", ".join(f"{method} {count}" for method, count in led)
        of = "blocks of pings" if task == PINGS_TASK else "missions"
        blocks.append(f"Best, ties counted for each, on: {best} of {missions} {of}.")
    if values:
        # Scores of a method without an answer are those of the climatology, of which only the ranking one counts.
        answering = [row["method"] for row in rows.iter_rows(named=True) if row["method"] not in silent]
        blocks += _other_scores(values, answering, missions)
    return Part(key, name, blocks)


def _other_scores(
    values: Mapping[str, Mapping[str, float]], methods: Sequence[str], missions: int
) -> list[Block]:
    """The scores beside the ranking one, and the bands in which NEES should be."""
    # Rows of one mission are correlated: the band is that of a value a mission, which is the widest it can be.
    sizes = {"velocity": 3, "position": 3, "current": 2}
    bands = {
        score: tuple(bound / size for bound in mean_band(size, missions, BAND))
        for score in values
        if (size := sizes.get(score.split()[0], 0)) and "NEES" in score
    }
    rows = []
    for method in methods:
        cells = [f"`{method}`"]
        for score, of in values.items():
            value, band = of.get(method), bands.get(score)
            colour = ""
            if band is not None and value is not None:
                colour = "more" if value > band[1] else "conservative" if value < band[0] else "less"
            cells.append(Coloured(number(value), colour))
        rows.append(cells)
    blocks: list[Block] = [Table(["Entry", *map(_sentence, values)], rows, "The other scores.")]
    if bands:
        told = ", ".join(
            f"{number(low)} to {number(high)} ({score.split()[0]})" for score, (low, high) in bands.items()
        )
        blocks.append(
            "NEES over its number of components, 1 for a consistent filter; green within, red above, grey below the "
            f"95 % band {told} of one independent value a mission."
        )
    return blocks


def nats(value: float) -> str:
    """A score in nats: two decimals, none from a hundred on, as a third says nothing of missions like these.

    >>> nats(-0.3264), nats(2664.7)
    ('−0.33', '2665')
    """
    return f"{value:.{0 if abs(value) >= 100.0 else 2}f}".replace("-", "−")


def _factors(scores: pl.DataFrame, table: pl.DataFrame) -> Part:
    """Ranking score of T2 by the level of each factor, for the methods that lead it."""
    lead = table.filter((pl.col("task") == NAVIGATION) & (pl.col("score") == RANKED))["method"].to_list()[
        :TOP
    ]
    part = scores.filter(
        (pl.col("task") == NAVIGATION) & (pl.col("score") == RANKED) & pl.col("method").is_in(lead)
    )
    specs = {spec.name: spec for spec in mission_list()}
    rows = []
    for factor in ("split", *FACTORS):
        level_of = {name: str(getattr(spec, factor)) for name, spec in specs.items()}
        known = part.with_columns(level=pl.col("mission").replace_strict(level_of))
        title = factor.upper() if factor in ("imu", "dvl") else factor.replace("_", " ").capitalize()
        for level in SPLITS if factor == "split" else levels()[factor]:
            group = known.filter(pl.col("level") == level)
            if group.height:
                means = dict(group.group_by("method").agg(pl.col("value").mean()).iter_rows())
                least = min(means.values())
                shown = [
                    f"**{nats(means[name])}**" if means[name] == least else nats(means[name]) for name in lead
                ]
                rows.append([f"{title}: {level.replace('_', ' ')}", str(group["mission"].n_unique()), *shown])
    words = "Nats a component of the entries that lead T2, over the missions with each level of a factor."
    by_level = Table(["Factor and level", "Missions", *lead], rows, "The least of each row is in bold.")
    return Part("factors", "T2 by factor", [words, by_level])


def _led(scores: pl.DataFrame) -> dict[str, list[tuple[str, int]]]:
    """By task, on how many missions each method has the best ranking score, or one within `TIE` of it."""
    part = scores.filter(pl.col("score") == RANKED)
    best = part.filter(pl.col("value") <= pl.col("value").min().over("task", "mission") + TIE)
    counted = (
        best.group_by("task", "method").len().sort(["task", "len", "method"], descending=[False, True, False])
    )
    led: dict[str, list[tuple[str, int]]] = {}
    for task, method, count in counted.iter_rows():
        led.setdefault(task, []).append((method, count))
    return led
