"""A file that the memory cannot hold ends with one line before it is read: no traceback, no abort."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

SHIPPED = Path(__file__).resolve().parents[2] / "data" / "logs" / "survey_dive"
LIMIT_BYTES, SIZE_BYTES = 3_000_000_000, 4_000_000_000
HEAD = "time_ns,beam1_mps,beam2_mps,beam3_mps,beam1_valid,beam2_valid,beam3_valid\n"


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """A log and two tables of 4 GB each, which take no room on the disk: zeros after a beginning."""
    (tmp_path / "log.pd0").write_bytes((SHIPPED / "dvl.pd0").read_bytes())
    (tmp_path / "beams.csv").write_text(HEAD + "".join(f"{k}00000000,1,1,1,1,1,1\n" for k in range(9)))
    (tmp_path / "imu.csv").write_text("time_s,ax,ay,az,wx,wy,wz\n0,0,0,-9.8,0,0,0\n")
    for path in tmp_path.iterdir():
        os.truncate(path, SIZE_BYTES)
    return tmp_path


@pytest.mark.first_cases(1)
@pytest.mark.skipif(sys.platform != "linux", reason="limits and sparse files of Linux")
@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("convert log.pd0 --out out.parquet", "log.pd0"),
        ("convert beams.csv --out out.parquet", "beams.csv"),
        ("fix beams.csv --method lc --geometry waterlinked_a50 --out out.parquet", "beams.csv"),
        ("audit beams.csv --out out", "beams.csv"),
        ("replay --init imu.csv --out case.toml", "imu.csv"),
    ],
)
def test_one_line_says_so(large: Path, command: str, file: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "bottomlock", *command.split()], cwd=large, capture_output=True, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES)), check=False,
    )  # fmt: skip
    assert ended.returncode == 2, ended.stderr
    (line,) = [line for line in ended.stderr.splitlines() if line.startswith("bottomlock:")]
    assert f"{file}: reading it takes about" in line
    assert "GB are available; cut it into parts" in line
    assert "Traceback" not in ended.stderr
