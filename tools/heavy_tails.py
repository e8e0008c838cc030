"""The table of docs/robust.md on heavy-tailed updates: `python -m tools.heavy_tails [--write docs/robust.md]`.

TC in a figure of eight, 60 runs, beams with Student's t noise of three degrees at Table 2's scale, or Gaussian; four
beams and two (tests/statistical/heavy.py, of which tests/statistical/test_robust.py keeps the differences).
"""

import argparse
from pathlib import Path

import numpy as np

from tests.statistical.heavy import run_tc
from tools.recorded_tables import number, table
from tools.score_recorded import print_or_write

WAYS = {
    "gaussian": "Gaussian, no gate",
    "matched": "Gaussian with the true variance",
    "gated": "Gaussian, joint gate",
    "beam_gates": "closure and beam gates, joint gate",
    "student": "Student's t, ν = 3",
    "huber": "Huber, k = 1.5",
}
LOST_MPS = 1.0
"""RMS of a run that its filter has lost; of the others none has half of it."""


def rms_mmps(square: np.ndarray) -> str:
    """RMS of the ensemble; with a lost run the median of the runs, and that run's."""
    runs = np.sqrt(square.mean(axis=1))
    if runs.max() < LOST_MPS:
        return number(1e3 * float(np.sqrt(square.mean())))
    lost = int((runs >= LOST_MPS).sum())
    return f"{number(1e3 * float(np.median(runs)))} (median; {lost} of {len(runs)} lost, up to {runs.max():.0f} m/s)"


def row(way: str, words: str) -> list[str]:
    """Of the table: velocity RMS in mm/s, and NEES of attitude and velocity under heavy tails."""
    cells = [words]
    for heavy in (True, False):
        for lost in ((), (3, 4)):
            square, nees = run_tc("figure_eight", way, heavy=heavy, lost=lost)
            cells.append(rms_mmps(square))
            if heavy:
                cells.append(f"{nees.mean():.1f}")
    return cells


def heavy_table() -> str:
    """A row for each update."""
    head = [
        "Update",
        "four beams, heavy",
        "NEES",
        "two beams, heavy",
        "NEES",
        "four, Gaussian",
        "two, Gaussian",
    ]
    return table(head, [row(way, words) for way, words in WAYS.items()])


def main() -> None:
    """Prints or writes the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", type=Path, help="page to write the table into")
    arguments = parser.parse_args()
    print_or_write(arguments.write, {"updates": heavy_table()})


if __name__ == "__main__":
    main()
