"""The missions of the benchmark with water track: task T6, of ours with and without the water, and of rivals.

    bottomlock bench make --version 1.2 --out missions
    python -m benches.rivals.water_missions missions    # water_missions.csv, and the table of docs/bench.md

What the water is worth is the difference between a method and the same one without it.
"""

import argparse
import csv
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from benches.rivals import error_state, held_velocity, model_aided, pose_ukf, robust, water_reckoning
from bottomlock.files.atomic_write import write_text
from partialdvl_bench import dead_reckoning, methods
from partialdvl_bench.load import load_mission
from partialdvl_bench.methods import Estimator
from partialdvl_bench.mission import Mission
from partialdvl_bench.mission_list import missions_of
from partialdvl_bench.run import folder_of
from partialdvl_bench.tasks import BLACKOUT, RANKED, scores_of, without_bottom

ROWS = Path(__file__).parent / "water_missions.csv"
PAGE = Path(__file__).parents[2] / "docs" / "bench.md"
FIRST_MARK, LAST_MARK = "<!-- T6: python -m benches.rivals.water_missions -->\n", "<!-- end -->"

ANSWERS: Mapping[str, Estimator] = {
    "sway_current": partial(methods.estimate, method="sway_current"),
    "consistent": partial(methods.estimate, method="consistent"),
    "tc": partial(methods.estimate, method="tc"),
    "sway_current, no water": methods.sway_current_without_water,
    "tc, no water": methods.tc_without_water,
    "dead_reckoning": dead_reckoning.estimate,
    "pose_ukf": pose_ukf.estimate,
    "model_aided": model_aided.estimate,
    "water, recent current": water_reckoning.estimate_recent,
    "water alone": water_reckoning.estimate_alone,
    "last velocity": water_reckoning.estimate_held,
    "held_velocity": held_velocity.estimate,
    "error_state": error_state.estimate,
    "robust": robust.estimate,
}


class Row(NamedTuple):
    """T6 of a method on a mission; NaN for what is not claimed."""

    mission: str
    method: str
    nats: float
    error_m: float
    error_over_sd: float
    nees: float


def row_of(mission: Mission, name: str) -> Row:
    """A method on a mission. Where no covariance of the position is claimed the error is that of the answer alone."""
    answer = ANSWERS[name](mission)
    if answer.position_cov is None:
        assert mission.truth is not None
        assert answer.position_t_m is not None
        last = np.flatnonzero(without_bottom(mission))[-1]
        off = (mission.truth.position_t_m - answer.position_t_m)[last, :2]
        return Row(mission.name, name, *(float("nan"), float(np.hypot(*off)), float("nan"), float("nan")))
    scores = scores_of(mission, answer, name).filter(pl.col("task") == BLACKOUT)
    found = dict(scores.select("score", "value").iter_rows())
    wanted = (
        RANKED, "horizontal error at the end, m", "error at the end over σ", "position NEES a component"
    )  # fmt: skip
    return Row(mission.name, name, *(found[score] for score in wanted))


def rows_of(data: Path) -> Iterator[Row]:
    """Every method on every mission."""
    for spec in missions_of(version="1.2"):
        mission = load_mission(folder_of(spec, data))
        for name in ANSWERS:
            yield row_of(mission, name)


def read_rows() -> list[Row]:
    """The committed rows."""
    with ROWS.open(newline="", encoding="utf-8") as file:
        return [
            Row(one["mission"], one["method"], *(float(one[name]) for name in Row._fields[2:]))
            for one in csv.DictReader(file)
        ]


def table(rows: list[Row]) -> str:
    """Markdown: a line a method, means over the missions of nats and NEES, median and greatest error, RMS over σ."""
    lines = [
        "| | nats a component | error at its end, median (greatest), m | over σ, RMS | position NEES a component |",
        "|---|---|---|---|---|",
    ]
    parts = {name: [row for row in rows if row.method == name] for name in ANSWERS}

    def place(name: str) -> tuple[bool, float]:
        nats = float(np.mean([row.nats for row in parts[name]]))
        claimed = bool(np.isfinite(nats))
        return not claimed, nats if claimed else float(np.median([row.error_m for row in parts[name]]))

    for name in sorted(parts, key=place):
        errors, over, nats, nees = (
            np.array([getattr(row, field) for row in parts[name]])
            for field in ("error_m", "error_over_sd", "nats", "nees")
        )
        claimed = bool(np.isfinite(nats).all())
        cells = [f"{nats.mean():.2f}", f"{np.sqrt(np.mean(over**2)):.2f}", f"{nees.mean():.2f}"]
        first, second, third = (cell.replace("-", "−") if claimed else "–" for cell in cells)
        middle, most = float(np.median(errors)), float(errors.max())
        lines.append(f"| `{name}` | {first} | {middle:.3g} ({most:.3g}) | {second} | {third} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Flies all, writes rows and table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path)
    rows = list(rows_of(parser.parse_args().data))
    with ROWS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Row._fields)
        for row in rows:
            writer.writerow([*row[:2], *(f"{value:.5g}" for value in row[2:])])
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split(FIRST_MARK, 1)
    write_text(PAGE, head + FIRST_MARK + table(read_rows()) + LAST_MARK + rest.split(LAST_MARK, 1)[1])


if __name__ == "__main__":
    main()
