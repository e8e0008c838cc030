"""The batch scripts of examples/slurm, run in a shell as Slurm runs them: the bits of one machine."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "examples" / "slurm"
COMMAND = Path(sys.executable).parent / "bottomlock"
SETTINGS = ["--runs", "120", "--methods", "ins,tc"]


def batch(script: str, *words: str, task: int | None = None, tasks: int = 3) -> None:
    """Runs a script in bash with what Slurm sets."""
    slurm = {"SLURM_CPUS_PER_TASK": "1", "PATH": f"{COMMAND.parent}{os.pathsep}{os.environ['PATH']}"}
    if task is not None:
        slurm |= {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_MAX": str(tasks)}
    command = ["bash", str(RECIPE / script), *words]
    subprocess.run(command, env=os.environ | slurm, check=True, capture_output=True, timeout=120)


@pytest.mark.long
@pytest.mark.skipif(not COMMAND.exists(), reason="the command is not installed beside this Python")
def test_shards_of_an_array_join_to_the_bits_of_one_machine(tmp_path: Path) -> None:
    for task in (1, 2, 3):
        batch("campaign.sbatch", "straight", str(tmp_path / "parts"), *SETTINGS, task=task)
    batch("merge.sbatch", str(tmp_path / "parts"))
    whole = tmp_path / "whole"
    subprocess.run(
        [COMMAND, "run", "straight", "--out", str(whole), *SETTINGS],
        check=True,
        capture_output=True,
        timeout=120,
    )
    tables = sorted(path.name for path in whole.glob("*.parquet"))
    assert "runs.parquet" in tables
    for name in tables:
        assert (tmp_path / "parts" / "whole" / name).read_bytes() == (whole / name).read_bytes(), name
