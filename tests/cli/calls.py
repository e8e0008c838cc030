"""The command `bottomlock`: called in this process, or as a process of its own where the process is what is tested."""

import os
import re
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib import resources
from io import StringIO
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from bottomlock.cli.app import main


def command(*arguments: str | Path, cwd: Path | None = None) -> CompletedProcess[str]:
    """Calls the entry point in this process: exit code and what it printed; an unforeseen exception passes through."""
    words = ["bottomlock", *(str(one) for one in arguments)]
    stdout, stderr, code = StringIO(), StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(stdout), redirect_stderr(stderr):
        patch.setattr(sys, "argv", words)
        # Otherwise Cyclopts warns that a test has given it no words; it is to take them from the command line.
        patch.delenv("PYTEST_VERSION", raising=False)
        if cwd is not None:
            patch.chdir(cwd)
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
    return CompletedProcess(words, code, stdout.getvalue(), stderr.getvalue())


def succeeded(*arguments: str | Path, cwd: Path | None = None) -> str:
    """What a command printed that ended with exit code 0."""
    done = command(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


def refused(*arguments: str | Path, cwd: Path | None = None) -> str:
    """What a command said on the standard error that ended with exit code 2: wrong usage or data."""
    done = command(*arguments, cwd=cwd)
    assert done.returncode == 2, done.stdout
    return done.stderr


def process(*arguments: str | Path, cwd: Path | None = None) -> CompletedProcess[str]:
    """Runs `python -m bottomlock` as a user does: a fresh interpreter, its exit code and its streams."""
    words = [sys.executable, "-m", "bottomlock", *(str(one) for one in arguments)]
    # Not what the process itself would hand on: the readline of pytest's debugger has put COLUMNS there.
    env = dict(os.environ)
    return subprocess.run(words, capture_output=True, text=True, check=False, cwd=cwd, env=env, timeout=300)


def shortened(name: str, path: Path, seconds: float = 20.0) -> Path:
    """A packaged scenario of so many seconds, as a file."""
    text = (resources.files("bottomlock.config") / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")
    text, count = re.subn(r"(?m)^duration_s = \S+", f"duration_s = {seconds}", text)
    assert count == 1
    path.write_text(text, encoding="utf-8")
    return path
