"""Builds the C library and installs it under a prefix: headers, libraries, CMake package and pkg-config file.

    python tools/install_c.py --prefix /usr/local

Cargo builds it without the simulation, and Python's standard library does the rest. An install can be moved: its
files name one another relatively. Linux only.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CRATE = ROOT / "crates" / "bottomlock-c"
HEADERS = ("bottomlock.h", "bottomlock.hpp")


def version() -> str:
    """The version of the workspace."""
    with (ROOT / "Cargo.toml").open("rb") as file:
        found: str = tomllib.load(file)["workspace"]["package"]["version"]
    return found


def soname(of: str) -> str:
    """The name that programs are linked to: before 1.0 a minor version may change the interface.

    >>> soname("0.1.7"), soname("2.3.4")
    ('libbottomlock.so.0.1', 'libbottomlock.so.2')
    """
    major, minor, _ = of.split(".")
    return f"libbottomlock.so.{major}" + (f".{minor}" if major == "0" else "")


def build(features: Sequence[str] = ()) -> tuple[Path, list[str]]:
    """Compiles the libraries: their folder, and what a program is linked to beside the static one.

    Args:
        features: of the crate.

    Raises:
        SystemExit: where cargo fails.
    """
    command = ["cargo", "rustc", "--release", "--locked", "--package", "bottomlock-c"]
    command += [*(f"--features={name}" for name in features), "--"]
    command += ["-C", "strip=symbols", "-C", f"link-arg=-Wl,-soname,{soname(version())}"]
    command += ["--print", "native-static-libs"]
    done = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, check=False)  # noqa: S603 - our own arguments
    if done.returncode:
        sys.stderr.write(done.stderr)
        raise SystemExit(done.returncode)
    found = re.search(r"native-static-libs: (.*)", done.stderr)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return ROOT / target / "release", found.group(1).split() if found else []


def filled(template: Path, words: dict[str, str]) -> str:
    """A template with its @WORDS@ replaced."""
    return re.sub(r"@([A-Z_]+)@", lambda match: words[match.group(1)], template.read_text(encoding="utf-8"))


def install(prefix: Path, features: Sequence[str] = ()) -> list[Path]:
    """Builds and installs; the files that were written.

    Args:
        prefix: the folder of `include` and `lib`.
        features: of the crate.

    Raises:
        SystemExit: where cargo fails.
    """
    built, system = build(features)
    number, name = version(), soname(version())
    major, minor, _ = number.split(".")
    shared = f"libbottomlock.so.{number}"
    include, lib = prefix / "include", prefix / "lib"
    cmake, pkgconfig = lib / "cmake" / "bottomlock", lib / "pkgconfig"
    for folder in (include, cmake, pkgconfig):
        folder.mkdir(parents=True, exist_ok=True)
    written = [Path(shutil.copyfile(CRATE / "include" / header, include / header)) for header in HEADERS]
    # Over a library that is in use a new file is put: a running program keeps the old one.
    for source, copy in (("libbottomlock_c.so", shared), ("libbottomlock_c.a", "libbottomlock.a")):
        whole = lib / f".{copy}.new"
        shutil.copyfile(built / source, whole)
        written.append(whole.replace(lib / copy))
    (lib / shared).chmod(0o755)
    for link, of in ((name, shared), ("libbottomlock.so", name)):
        (lib / link).unlink(missing_ok=True)
        (lib / link).symlink_to(of)
        written.append(lib / link)
    words = {"VERSION": number, "MAJOR": major, "MINOR": minor, "SHARED": shared, "SONAME": name}
    words["STATIC_FLAGS"] = " ".join(system)
    words["STATIC_LIBS"] = ";".join(flag.removeprefix("-l") for flag in system)
    texts = {cmake / template.name: template for template in sorted((CRATE / "cmake").glob("*.cmake"))}
    for path, template in (texts | {pkgconfig / "bottomlock.pc": CRATE / "bottomlock.pc.in"}).items():
        path.write_text(filled(template, words), encoding="utf-8")
        written.append(path)
    return written


def main() -> int:
    """The command line; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--prefix", type=Path, required=True, help="folder of include/ and lib/")
    chosen = parser.parse_args()
    if not sys.platform.startswith("linux"):
        message = "install_c.py: Linux only; elsewhere `cargo build --release -p bottomlock-c` and copy"
        print(message, file=sys.stderr)
        return 2
    for path in install(chosen.prefix.resolve()):
        print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
