"""The leaderboard as one self-contained page, made from the table of scores alone."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl
from markupsafe import Markup

from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import STROKES, svg_text
from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.overwriting import Files, Result
from bottomlock.files.table_file import read_parquet
from bottomlock.io.beam_table import sha256_of
from bottomlock.pages.render import render
from bottomlock.statistics.chi_squared import mean_band
from bottomlock.tables.check import check
from bottomlock.tables.spreadsheet import csv_text
from partialdvl_bench.beam_tasks import PINGS_TASK, VELOCITY_TASK
from partialdvl_bench.figure import leaderboard_figure
from partialdvl_bench.leaderboard import OVERALL, leaderboard
from partialdvl_bench.mission_list import FACTORS, SPLITS, levels, mission_list
from partialdvl_bench.tables import SCORES
from partialdvl_bench.tasks import CURRENT, NAVIGATION, RANKED, RECOVERY

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
    CURRENT: ("current energy score, m/s", "current RMS, m/s", "current NEES a component", "current availability"),
    PINGS_TASK: ("energy score, m/s", "RMS, m/s", "NEES a component", "availability"),
}  # fmt: skip
"""Scores beside the ranking one, by task."""

WORDS: Mapping[str, str] = {
    OVERALL: "Mean over T2, T3 and T4 of the ranking score.",
    VELOCITY_TASK: "The velocity from the beams of one ping, for every set of beams that could be left.",
    NAVIGATION: "Velocity and position at every second of every mission.",
    RECOVERY: "Velocity in the 30 s after beams determine it again, where they had not for 15 s or more.",
    CURRENT: "The velocity of the water at every second.",
    PINGS_TASK: "Pings of a RiverPro with four beams: what the beams left out read, from the others and earlier pings.",
}


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
    content = {
        "tasks": [_task(table, task) for task in (OVERALL, *COLUMNS) if task in table["task"]],
        "factors": _factors(scores, table),
        "led": _led(scores),
        "words": {name: look.words for name, look in STROKES.items()},
        "counts": {
            split: sum(spec.split == split for spec in specs) for split in ("train", "validation", "test")
        },
        "version": " and ".join(dict.fromkeys(spec.version for spec in specs)),
        "methods": table["method"].n_unique(),
    }
    files: Files = {
        f"{NAME}.parquet": parquet_bytes(table),
        f"{NAME}.csv": csv_text(table, float_precision=6),
        f"{NAME}.html": render("leaderboard.html.j2", content, package="partialdvl_bench"),
    }
    result.write(files, force=force)
    return out / f"{NAME}.html"


def _task(table: pl.DataFrame, task: str) -> dict[str, Any]:
    """A task's part of the page: its ranking with a figure, and the other scores of each method."""
    rows = table.filter((pl.col("task") == task) & (pl.col("score") == RANKED))
    key = task.split(maxsplit=1)[0].lower()
    caption = (
        f"{task[:1].upper()}{task[1:]}: {RANKED}, mean over missions with its 95 % interval; less is better."
    )
    svg = svg_text(leaderboard_figure(rows, f"{RANKED} (less is better)"))
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
    # Its scores are those of the climatology, of which only the ranking one counts.
    others = {
        score: {method: value for method, value in one.items() if method not in silent}
        for score, one in values.items()
    }
    missions = int(rows["missions"].max() or 1)  # type: ignore[arg-type] # an Int64 column
    return {
        "key": key,
        "name": task,
        "words": WORDS[task],
        "rows": list(rows.iter_rows(named=True)),
        "nats": nats,
        "others": others,
        "silent": silent,
        "reference": rows["reference"][0],
        "missions": missions,
        "svg": Markup(inline_svg(svg, key, caption)),  # noqa: S704 - our own, escaped there
        "caption": caption,
        # Rows of one mission are correlated: the band is that of a value a mission, which is the widest it can be.
        "bands": {
            score: tuple(one / size for one in mean_band(size, missions, BAND))
            for score in COLUMNS.get(task, ())
            if (size := {"velocity": 3, "position": 3, "current": 2}.get(score.split()[0], 0))
            and "NEES" in score
        },
    }


def nats(value: float) -> str:
    """A score in nats: two decimals, none from a hundred on, as a third says nothing of missions like these.

    >>> nats(-0.3264), nats(2664.7)
    ('−0.33', '2665')
    """
    return f"{value:.{0 if abs(value) >= 100.0 else 2}f}".replace("-", "−")


def _factors(scores: pl.DataFrame, table: pl.DataFrame) -> dict[str, Any]:
    """Ranking score of T2 by the level of each factor, for the methods that lead it."""
    lead = table.filter((pl.col("task") == NAVIGATION) & (pl.col("score") == RANKED))["method"].to_list()[
        :TOP
    ]
    part = scores.filter(
        (pl.col("task") == NAVIGATION) & (pl.col("score") == RANKED) & pl.col("method").is_in(lead)
    )
    specs = {spec.name: spec for spec in mission_list()}
    rows: dict[str, dict[str, tuple[int, dict[str, float]]]] = {}
    for factor in ("split", *FACTORS):
        level_of = {name: str(getattr(spec, factor)) for name, spec in specs.items()}
        known = part.with_columns(level=pl.col("mission").replace_strict(level_of))
        for level in SPLITS if factor == "split" else levels()[factor]:
            group = known.filter(pl.col("level") == level)
            if group.height:
                means = group.group_by("method").agg(pl.col("value").mean())
                rows.setdefault(factor, {})[level] = (group["mission"].n_unique(), dict(means.iter_rows()))
    return {"methods": lead, "rows": rows, "nats": nats}


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
