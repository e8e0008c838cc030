"""What is known of a mission without its sensors: mean and covariance over the train split, for unanswered rows.

    python tools/bench_climatology.py DIR

reads the train missions that `bottomlock bench make --out DIR` has written, and writes
`python/partialdvl_bench/climatology.toml` anew.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.files.atomic_write import write_text
from bottomlock.files.table_file import read_parquet
from partialdvl_bench.load import truth_of
from partialdvl_bench.mission_list import missions_of

OUT = Path(__file__).resolve().parent.parent / "python" / "partialdvl_bench" / "climatology.toml"


def main() -> None:
    """Writes the file."""
    folder = Path(sys.argv[1])
    truths = [
        truth_of(read_parquet(folder / s.split / s.name / "truth.parquet")) for s in missions_of(("train",))
    ]
    lines = [
        "# Written by tools/bench_climatology.py: mean and covariance over the train split, each mission alike."
    ]
    for block, values in (
        ("velocity", [truth.velocity_p_mps for truth in truths]),
        ("position", [truth.position_t_m for truth in truths]),
        ("current", [truth.current_t_mps for truth in truths]),
    ):
        mean = np.mean([part.mean(axis=0) for part in values], axis=0)
        cov = np.mean(
            [np.einsum("ni,nj->ij", part - mean, part - mean) / len(part) for part in values], axis=0
        )
        lines += ["", f"[{block}]", f"mean = {mean.round(4).tolist()}", f"cov = {cov.round(6).tolist()}"]
    write_text(OUT, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
