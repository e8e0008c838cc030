"""A finished replay laid out: can it be trusted, results of each what-if case, beams, calibration, start, clocks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl
from matplotlib.figure import Figure

from bottomlock.files.replay_tables import FORWARD, ReplayTables
from bottomlock.pages.page import Block, Coloured, Detail, Page, Part, Picture, Table, Terms, Viewer, listed
from bottomlock.pages.pieces import featured, findings_part, glossaries, json_part, title_of
from bottomlock.pages.plots import Plots
from bottomlock.replay.findings.verdict import NOTHING
from bottomlock.statistics.replay import summary_table, track_table
from bottomlock.text import number

_ERRORS = {
    "End, m": "position_final_m",
    "% DT": "position_final_percent",
    "Velocity, m/s": "velocity_rms_over_time_mps",
    "Attitude, °": "attitude_rms_over_time_deg",
}
"""Columns of the first table by their heads."""
_RATIOS = {
    "Position RMS, m": "position_rms_over_time_m",
    "Error/σ of position": "position_normalised_rms_over_time",
    "of velocity": "velocity_normalised_rms_over_time",
    "of attitude": "attitude_normalised_rms_over_time",
}
"""Columns of the second."""
_RESULTS_WORDS = (
    "Errors against the reference where there is one: of position at the end, also in percent of the distance "
    "travelled (% DT); RMS over time of velocity and attitude. σ: horizontal, claimed at the end. NIS: mean over "
    "fixes, of what it should be. Fixes, and how many the gate rejects."
)
_DETAIL_WORDS = (
    "Error/σ: RMS over time of the error over its claimed standard deviation; 1 for a consistent filter. Where each "
    "track ends, from the origin, with its claimed 1 sigma; its way over ground, horizontally, and mean speed."
)
_CALIBRATION_WORDS = (
    "Estimated from the whole log, 1 sigma. Mounting: rotation from the stated one about forward, right, down. Clock: "
    "to be added to the DVL's stamps. What the motion does not show keeps the σ that it had before."
)
_SENSOR_WORDS = (
    "Readings that reached the filter; rows left out because they hold none; the part that the gate rejected; how "
    "often rejections, or a mean, inflated the covariance; NIS and its degrees of freedom, means; the largest "
    "estimate of the sensor's slow errors (bias, offset, walk, deviation) in σ of what the case states."
)
_CLOCK_WORDS = "Seconds on the case's clock. A gap is a step longer than the length given."


@dataclass(frozen=True)
class Drawing:
    """A figure of the page.

    Attributes:
        name: of its files.
        caption: below it.
        figure: itself.
        what_if: case that it is of, None for all.
    """

    name: str
    caption: str
    figure: Figure
    what_if: str | None = None


def page_of(
    tables: ReplayTables, figures: Sequence[tuple[Drawing, Picture]] = (), plots: Plots | None = None
) -> Page:
    """A finished replay as a page, with its figures where there are any.

    Args:
        tables: of the replay.
        figures: drawn from them.
        plots: what the reader can look into.
    """
    summary, tracks = summary_table(tables.runs), track_table(tables.samples)
    manifest, answer = tables.manifest, tables.manifest.get("answer")
    parts = [
        *([_trust(answer)] if answer else []),
        *([_dive(manifest, figures, plots)] if plots else []),
        _results(manifest, summary),
        findings_part(manifest.get("findings", []), listed(manifest.get("answers", []))),
        *(_case(manifest, name, words, summary, tracks, figures) for name, words in manifest["what_if"]),
        Part(
            "beams",
            "Which beams returned",
            [picture for drawing, picture in figures if drawing.name == VALIDITY],
        ),
        *([_sensors(manifest)] if manifest.get("sensors") and answer else []),
        *([_calibration(tables.calibration)] if tables.calibration is not None else []),
        Part("start", "Start", [Terms([(name, manifest["alignment"][name]) for name in _START])]),
        _clocks(manifest),
        json_part("manifest", "Manifest", "manifest.json", manifest),
    ]
    return Page(
        f"{title_of(manifest['case'])}, replayed", parts, f"bottomlock {manifest['version']}",
        about=_about(manifest), headline=headline(answer) if answer else (),
    )  # fmt: skip


def headline(answer: Mapping[str, Any]) -> list[str]:
    """Whether the replay can be trusted."""
    verdict = answer["verdict"]
    return ["Can I trust this?", Coloured(f"{verdict.capitalize()}:", verdict), answer["sentence"]]


def best_of(summary: pl.DataFrame, what_if: str) -> dict[str, Any] | None:
    """The row of the forward method with the least final position error in a case, None without positions."""
    rows = summary.filter(
        (pl.col("what_if") == what_if)
        & (pl.col("pass") == FORWARD)
        & pl.col("position_final_m").is_not_null()
    )
    return rows.sort("position_final_m").row(0, named=True) if rows.height else None


def featured_in(manifest: Mapping[str, Any], summary: pl.DataFrame, what_if: str) -> list[str]:
    """The methods that the first figures of a case show."""
    best = best_of(summary, what_if)
    return featured(manifest["methods"], [best["method"]] if best else [])


def _about(manifest: Mapping[str, Any]) -> str:
    made_of = f"bottomlock {manifest['version']}, configuration `{manifest['configuration_hash'][:12]}`"
    paragraphs = [manifest["description"], made_of]
    if manifest["semi_synthetic"]:
        conditions = "; ".join(manifest["semi_synthetic"])
        paragraphs.append(f"**Semi-synthetic:** {conditions}. These conditions were not measured.")
    if manifest["reference_note"]:
        paragraphs.append(f"**Reference:** {manifest['reference_note']}")
    return "\n\n".join(words for words in paragraphs if words)


def _trust(answer: Mapping[str, Any]) -> Part:
    """What decides whether it can be trusted, and the track to take."""
    keys = answer.get("assumed", ())
    take = "Until it is changed, take" if answer["verdict"] == "no" else "Take the track of"
    rows = [
        (take, f"`{answer['method']}`" if answer["method"] else "none of these tracks"),
        *([("Change", answer["change"])] if answer["change"] != NOTHING else []),
        *zip(("Beams", "Position"), answer["numbers"], strict=False),
        *([("This vehicle", answer["vehicle"])] if answer["vehicle"] else []),
        *([("Open", f"{len(keys)} keys of the case: {', '.join(keys)}")] if keys else []),
    ]
    return Part("trust", "What decides it", [Terms(rows)])


def _dive(manifest: Mapping[str, Any], figures: Sequence[tuple[Drawing, Picture]], plots: Plots) -> Part:
    """Map and curves against time, to look into, and the figures that stand for them."""
    first_map = f"map_{manifest['what_if'][0][0]}"
    by_name = {drawing.name: picture for drawing, picture in figures}
    still = [by_name[name] for name in (first_map, TIMELINE)]
    terms = [
        (
            "±σ",
            "one standard deviation as the filter claims it; the error should be within it two times of three",
        ),
        (
            "dead reckoning",
            "the DVL's velocity turned by the recorded attitude and summed up: what a filter has to beat",
        ),
    ]
    return Part("dive", "The dive", [Viewer(plots, still), Terms(terms)])


TIMELINE, VALIDITY = "timeline", "validity"
"""Names of the figures of the curves and of the valid beams."""


def _results(manifest: Mapping[str, Any], summary: pl.DataFrame) -> Part:
    """The best of each case, and the methods."""
    names = [name for name, _ in manifest["what_if"]]
    rows = []
    for name, words in manifest["what_if"]:
        best = best_of(summary, name)
        cells = ["–"] * 4
        if best is not None:
            numbers = (best[key] for key in ("position_final_m", "position_final_percent", "distance_m"))
            cells = [f"`{best['method']}`", *(number(value) for value in numbers)]
        rows.append([title_of(name), words, *cells])
    columns = ["What-if case", "Conditions", "Best", "Position at the end, m", "% DT", "Distance, m"]
    known = any(best_of(summary, name) is not None for name in names)
    caption = "Least position error at the end, forward pass" if known else "There is no reference position"
    first = list(dict.fromkeys(method for name in names for method in featured_in(manifest, summary, name)))
    shown = len(columns) if known else 2
    blocks: list[Block] = [
        Table(columns[:shown], [row[:shown] for row in rows], f"{caption}.", left=min(3, shown)),
        *glossaries(manifest["methods"], first, {"lc": _LC}),
    ]
    return Part("summary", "What-if cases and results", blocks)


_LC = "velocity by least squares from the valid beams; no fix with fewer than three"
"""What `lc` is in a replay, where beams are lost to it too."""


def _case(
    manifest: Mapping[str, Any],
    what_if: str,
    words: str,
    summary: pl.DataFrame,
    tracks: pl.DataFrame,
    figures: Sequence[tuple[Drawing, Picture]],
) -> Part:
    """A what-if case: figures, errors, ends of the tracks, fixes."""
    rows, tracks_of = _rows_of(summary, tracks, what_if)
    of_case = [(drawing, picture) for drawing, picture in figures if drawing.what_if == what_if]
    first_map = f"map_{manifest['what_if'][0][0]}"
    beams = f"{number(rows[0]['beams_mean_over_pings'])} of {manifest['beams']} beams a ping."
    blocks: list[Block] = [
        f"{words[:1].upper()}{words[1:]}. {beams}",
        *(picture for one, picture in of_case if one.name != first_map),
    ]
    blocks += [_results_of(rows, tracks_of), _detail_of(rows, tracks_of)]
    label = " (semi-synthetic)" if manifest["semi_synthetic"] else ""
    return Part(what_if, f"{title_of(what_if)}{label}", blocks)


def results_table(runs: pl.DataFrame, samples: pl.DataFrame, what_if: str) -> Table:
    """Errors at the end, claims and fixes of a what-if case, a row for each method and pass."""
    return _results_of(*_rows_of(summary_table(runs), track_table(samples), what_if))


def _rows_of(
    summary: pl.DataFrame, tracks: pl.DataFrame, what_if: str
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The rows of a what-if case, and where the track of each ends."""
    rows = summary.filter(pl.col("what_if") == what_if).to_dicts()
    ends = {
        (row["method"], row["pass"]): row for row in tracks.iter_rows(named=True) if row["what_if"] == what_if
    }
    return rows, [ends[row["method"], row["pass"]] for row in rows]


def _results_of(rows: Sequence[Mapping[str, Any]], tracks: Iterable[Mapping[str, Any]]) -> Table:
    """A row per method and pass: errors, or where the track ends, what is claimed, fixes."""
    errors = _known(_ERRORS, rows)
    ends = {} if "End, m" in errors else {"North, m": "north_m", "East, m": "east_m"}
    cells = []
    for row, track in zip(rows, tracks, strict=True):
        shown = [*(row[key] for key in errors.values()), *(track[key] for key in ends.values())]
        shown.append((track["sd_position_north_m"] ** 2 + track["sd_position_east_m"] ** 2) ** 0.5)
        shown += [row["nis_mean_over_fixes"], row["nis_degrees_mean_over_fixes"]]
        fixes = "–" if row["fixes"] is None else str(row["fixes"])
        rejected = number(100.0 * row["rejected_fraction"], 2) if row["fixes"] else "–"
        cells.append([f"`{row['method']}`", row["pass"], *map(number, shown), fixes, rejected])
    columns = ["Method", "Pass", *errors, *ends, "σ, m", "NIS", "of", "Fixes", "Rejected, %"]
    return Table(columns, cells, _RESULTS_WORDS, left=2)


def _detail_of(rows: Sequence[Mapping[str, Any]], tracks: Iterable[Mapping[str, Any]]) -> Table:
    """A row per method and pass: error over claim, where the track ends, its way and speed."""
    ratios = _known(_RATIOS, rows)
    cells = []
    for row, track in zip(rows, tracks, strict=True):
        against = [number(row[key]) for key in ratios.values()]
        ends = [number(track[key]) for key in ("north_m", "east_m")]
        sd = f"{number(track['sd_position_north_m'])}, {number(track['sd_position_east_m'])}"
        way = [number(track[key]) for key in ("way_m", "speed_mps")]
        cells.append([f"`{row['method']}`", row["pass"], *against, *ends, sd, *way])
    columns = ["Method", "Pass", *ratios, "North, m", "East, m", "σ north, east, m", "Way, m", "Speed, m/s"]
    return Table(columns, cells, _DETAIL_WORDS, left=2)


def _known(columns: Mapping[str, str], rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The columns that any row has."""
    return {head: key for head, key in columns.items() if any(row[key] is not None for row in rows)}


_SENSOR_COLUMNS = [
    "Sensor", "What-if", "Method", "Readings", "Left out", "Rejected, %", "Inflated", "NIS", "of", "Slow error, σ"
]  # fmt: skip


def _sensors(manifest: Mapping[str, Any]) -> Part:
    """What the filters made of each sensor's readings: the method to take, or that stands for all, and the others."""
    rows = [
        [
            row["sensor"].replace("_", " "), title_of(name), f"`{row['method']}`", str(row["measured"]),
            str(row["left_out"]), number(100.0 * row["rejected"] / row["measured"], 2), str(row["inflated"]),
            number(row["nis"]), number(row["degrees"]), number(row["slow_error"]) if row["slow_error"] else "–",
        ]
        for name, _ in manifest["what_if"]
        for row in manifest["sensors"][name]
    ]  # fmt: skip
    rows.sort(key=lambda row: row[0])
    methods = dict.fromkeys(row[2] for row in rows)
    first = next(
        (one for one in (f"`{manifest['answer']['method']}`", "`tc`", *methods) if one in methods), ""
    )
    tables = [
        Table(_SENSOR_COLUMNS, [row for row in rows if (row[2] == first) is own], _SENSOR_WORDS, left=3)
        for own in (True, False)
    ]
    blocks: list[Block] = (
        [Terms([("Beams in cells", manifest["water_cells"])])] if "water_cells" in manifest else []
    )
    folded = (
        [Detail(f"The same of the other {len(methods) - 1} methods", [tables[1]])] if len(methods) > 1 else []
    )
    return Part("sensors", "Sensors", [*blocks, tables[0], *folded])


def _calibration(table: pl.DataFrame) -> Part:
    cells = [
        [
            row["what_if"], f"`{row['method']}`", row["parameter"].replace("_", " "), row["unit"],
            *(number(row[key]) for key in ("value", "sd", "prior_sd")),
        ]
        for row in table.filter(pl.col("prior_sd") > 0.0).iter_rows(named=True)
    ]  # fmt: skip
    columns = ["What-if", "Method", "Parameter", "Unit", "Value", "σ", "σ before"]
    caption = "Parameters of the DVL as each method estimates them."
    return Part(
        "calibration", "Calibration of the DVL", [_CALIBRATION_WORDS, Table(columns, cells, caption, left=4)]
    )


_START = ("start", "level", "heading", "position", "velocity")


def _clocks(manifest: Mapping[str, Any]) -> Part:
    """Every stream's clock and rows, and what was done to them."""
    cells = []
    for name, clock in manifest["clocks"].items():
        gaps = (
            clock["gaps"]
            if clock["gaps"] == "none"
            else f"{clock['gaps']} (longer than {clock['gap_s']:.3g} s)"
        )
        faults = [str(clock[key]) for key in ("jumps", "repeats", "backward", "empty")]
        cells.append(
            [name, gaps, *faults, str(clock["rows"]), str(clock["kept"]), number(clock["median_step_s"])]
        )
    columns = ["Stream", "Gaps", "Jumps", "Repeats", "Backward", "Empty", "Rows", "Used", "Step, s"]
    notes = listed([*manifest["notes"], *manifest.get("imu_faults", [])])
    return Part(
        "clocks",
        "Clocks and rows",
        [Table(columns, cells, _CLOCK_WORDS, left=6), *([notes] if notes else [])],
    )
