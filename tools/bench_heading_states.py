"""What the slow errors of a heading reference are worth as states: `tc` on the missions with a slow heading, T2.

    python tools/bench_heading_states.py DIR

runs it with the states, with the reference's white noise alone, and with white noise of the size of all its errors, on
the folder that `bottomlock bench make --version 1.1` has written; prints means over the missions and the largest NEES.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.kernel.models import HeadingModel
from partialdvl_bench.load import load_mission
from partialdvl_bench.methods import estimate
from partialdvl_bench.mission_list import missions_of
from partialdvl_bench.tasks import NAVIGATION, RANKED, scores_of

SHOWN = (RANKED, "position NEES a component", "position RMS, m")


def main() -> None:
    """Prints the table."""
    found: dict[str, list[list[float]]] = {}
    for spec in (one for one in missions_of(("train", "validation"), version="1.1") if one.heading):
        mission = load_mission(Path(sys.argv[1]) / spec.split / spec.name)
        own = mission.model.heading
        assert own is not None  # every mission has a heading sensor
        whole = float(np.linalg.norm([own.sd_rad, own.offset_sd_rad, own.walk_sd_rad]))
        models = {
            "states": own,
            "white": HeadingModel(sd_rad=own.sd_rad),
            "white of all": HeadingModel(sd_rad=whole),
        }
        for name, heading in models.items():
            flown = replace(mission, model=replace(mission.model, heading=heading))
            scores = scores_of(mission, estimate(flown, "tc"), name)
            of_task = {
                r["score"]: r["value"] for r in scores.iter_rows(named=True) if r["task"] == NAVIGATION
            }
            found.setdefault(name, []).append([of_task[score] for score in SHOWN])
    for name, rows in found.items():
        means = ", ".join(
            f"{score} {mean:.2f}" for score, mean in zip(SHOWN, np.mean(rows, axis=0), strict=True)
        )
        print(f"{name}: {means}; largest NEES {np.max(rows, axis=0)[1]:.2f}")


if __name__ == "__main__":
    main()
