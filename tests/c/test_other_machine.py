"""The library cross-compiled for ARM and run in an emulator: the shipped dive ends in the bits of this machine.

It needs a compiler for aarch64 (Debian: gcc-aarch64-linux-gnu and libc6-dev-arm64-cross), Rust's standard library for
it (`rustup target add aarch64-unknown-linux-gnu`, or Debian: libstd-rust-dev:arm64) and qemu-user, and is skipped
without.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bottomlock.kernel import Navigator
from tests.c.dive_files import EVENT, KINDS, write_dive
from tests.c.test_installed import WARNINGS, needed, run

TARGET, COMPILER = "aarch64-unknown-linux-gnu", "aarch64-linux-gnu-gcc"
METHODS = ("tc", "sway_current", "weak_sway", "elc")


@pytest.fixture(scope="module")
def here(prefix: Path, root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program for this machine."""
    needed("cc")
    folder = tmp_path_factory.mktemp("dive")
    source = root / "crates" / "bottomlock-c" / "tests" / "dive.c"
    run(
        "cc", "-std=c99", *WARNINGS, source, f"-I{prefix / 'include'}", prefix / "lib" / "libbottomlock.a",
        "-lm", "-lpthread", "-ldl", "-o", "dive", cwd=folder,
    )  # fmt: skip
    return folder / "dive"


@pytest.fixture(scope="module")
def arm(root: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str | Path]:
    """The command for the program for ARM."""
    needed("qemu-aarch64", COMPILER, "rustc")
    library = subprocess.run(
        ["rustc", "--print", "target-libdir", "--target", TARGET], capture_output=True, text=True, check=False
    )
    if library.returncode or not Path(library.stdout.strip()).is_dir():
        pytest.skip(f"Rust's standard library for {TARGET} is not here")
    folder = tmp_path_factory.mktemp("arm")
    run(
        "cargo", "build", "--release", "--locked", "-p", "bottomlock-c", "--target", TARGET, cwd=root,
        CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=COMPILER,
    )  # fmt: skip
    built = Path(os.environ.get("CARGO_TARGET_DIR", root / "target")) / TARGET / "release"
    crate = root / "crates" / "bottomlock-c"
    run(
        COMPILER, "-std=c99", *WARNINGS, crate / "tests" / "dive.c", f"-I{crate / 'include'}",
        built / "libbottomlock_c.a", "-lm", "-lpthread", "-ldl", "-static", "-o", "dive", cwd=folder,
    )  # fmt: skip
    return ["qemu-aarch64", folder / "dive"]


def in_python(saved: Path, events: Path) -> Navigator:
    """The saved navigator after the events."""
    navigator = Navigator.load(saved.read_bytes())
    for kind, time_ns, v in np.frombuffer(events.read_bytes(), EVENT).tolist():
        if kind == KINDS["imu"]:
            navigator.push_imu(time_ns, omega_p_radps=v[:3], force_p_mps2=v[3:6])
        elif kind == KINDS["dvl"]:
            navigator.push_beams(time_ns, np.array(v[:4]), np.array(v[4:8]) != 0.0, sd_mps=np.array(v[8:12]))
        elif kind == KINDS["depth"]:
            navigator.push_depth(time_ns, v[0], sd_m=v[1])
        else:
            navigator.push_attitude(time_ns, v[:4], roll_pitch_sd_rad=v[4], yaw_sd_rad=v[5])
    return navigator


def fnv_1a(content: bytes) -> str:
    """The sum that the program prints."""
    found = 14695981039346656037
    for byte in content:
        found = (found ^ byte) * 1099511628211 % 2**64
    return f"{found:016x}"


@pytest.mark.parametrize("method", METHODS)
def test_a_saved_navigator_goes_on_in_c(here: Path, root: Path, tmp_path: Path, method: str) -> None:
    """From Python's saved bytes to the bits of Python's navigator: all that is saved."""
    saved, events = write_dive(root, tmp_path, method)
    navigator = in_python(saved, events)
    printed = run(here, saved, events, cwd=tmp_path).split()
    position = [float.fromhex(word) for word in printed[1:4]]
    assert position == list(navigator.state()["position_t_m"])
    assert printed[8:] == ["saved", str(len(navigator.save())), fnv_1a(navigator.save())]


def test_times_are_printed(here: Path, root: Path, tmp_path: Path) -> None:
    words = run(here, *write_dive(root, tmp_path, "tc"), "time", cwd=tmp_path).split()
    assert words[::2] == ["pushes", "median_us", "p99_us", "greatest_us", "core_percent"]
    assert int(words[1]) > 3000


@pytest.mark.parametrize("method", METHODS)
def test_arm_has_the_same_bits(
    here: Path, arm: list[str | Path], root: Path, tmp_path: Path, method: str
) -> None:
    saved, events = write_dive(root, tmp_path, method)
    assert run(*arm, saved, events, cwd=tmp_path) == run(here, saved, events, cwd=tmp_path)
