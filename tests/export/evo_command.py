"""The program evo, called as a command: its errors of a track against another."""

import json
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest


def ape(true: Path, mine: Path, work: Path, relation: str = "trans_part") -> float:
    """RMSE of `evo_ape` between two TUM files, without alignment, with all its digits.

    The test is skipped where evo is not installed.
    """
    evo = shutil.which("evo_ape")
    if evo is None:
        pytest.skip("evo is not installed: pip install evo")
    result = work / f"{mine.stem}_{relation}.zip"
    words = [evo, "tum", str(true), str(mine), "--pose_relation", relation, "--save_results", str(result)]
    done = subprocess.run([*words, "--no_warnings"], capture_output=True, text=True, check=False, cwd=work)
    assert done.returncode == 0, done.stdout + done.stderr
    with zipfile.ZipFile(result) as archive:
        return float(json.loads(archive.read("stats.json"))["rmse"])
