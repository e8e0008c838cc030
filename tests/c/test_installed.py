"""An installed prefix as its users find it, from an empty folder: pkg-config, CMake, C, C++, ctypes; sanitizers."""

import ctypes
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.c.navigator import CError, CLibrary
from tools.install_c import CRATE, install, version

VELOCITY = "velocity 2.001 -0.003 -0.000 m/s"
WARNINGS = ("-Wall", "-Wextra", "-pedantic", "-Werror")
MODEL = '{"preset": "tactical", "latitude_rad": 0.5}'
CALLS = 30_000
"""Random calls of a seed."""


def needed(*names: str) -> None:
    """Skips the test where a program is missing."""
    for name in names:
        if shutil.which(name) is None:
            pytest.skip(f"{name} is not here")


def run(*words: str | Path, cwd: Path, **variables: str) -> str:
    """What a command prints; an error shows all of it."""
    environment = {key: value for key, value in os.environ.items() if key != "LD_LIBRARY_PATH"} | variables
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture
def folder(tmp_path: Path, root: Path) -> Path:
    """An empty folder with the examples alone."""
    for example in (root / "crates" / "bottomlock-c" / "examples").iterdir():
        shutil.copy(example, tmp_path)
    return tmp_path


def flags(prefix: Path, folder: Path, *which: str) -> list[str]:
    """What pkg-config says."""
    path = str(prefix / "lib" / "pkgconfig")
    return run("pkg-config", *which, "bottomlock", cwd=folder, PKG_CONFIG_PATH=path).split()


@pytest.mark.parametrize("standard", ["c99", "c11"])
def test_c_by_pkg_config(prefix: Path, folder: Path, standard: str) -> None:
    """The example is thirty lines at most, and is compiled without a warning."""
    needed("cc", "pkg-config")
    example = (folder / "first_fix.c").read_text(encoding="utf-8")
    assert len(example.splitlines()) <= 30
    how = flags(prefix, folder, "--cflags", "--libs")
    run("cc", f"-std={standard}", *WARNINGS, "first_fix.c", *how, "-o", "first_fix", cwd=folder)
    assert run("./first_fix", cwd=folder, LD_LIBRARY_PATH=str(prefix / "lib")).strip() == VELOCITY


def test_the_wrapper(prefix: Path, folder: Path, root: Path) -> None:
    """Every call of bottomlock.hpp: copies, moves, views, exceptions, saved bytes."""
    needed("c++", "pkg-config")
    source = root / "crates" / "bottomlock-c" / "tests" / "wrapper.cpp"
    how = flags(prefix, folder, "--cflags", "--libs")
    for standard in ("c++17", "c++20"):
        run("c++", f"-std={standard}", *WARNINGS, source, *how, "-o", "wrapper", cwd=folder)
        assert run("./wrapper", cwd=folder, LD_LIBRARY_PATH=str(prefix / "lib")).strip() == "as expected"


def test_by_cmake(prefix: Path, folder: Path) -> None:
    """The shared and the static library, after the prefix has moved; another minor version is not taken."""
    needed("cc", "c++", "cmake")
    moved = folder / "moved"
    shutil.copytree(prefix, moved, symlinks=True)
    major, minor, _ = version().split(".")
    text = f"""cmake_minimum_required(VERSION 3.16)
project(first_fix LANGUAGES C CXX)
find_package(bottomlock {major}.{minor} REQUIRED)
add_executable(shared first_fix.c)
target_link_libraries(shared PRIVATE bottomlock::bottomlock)
add_executable(static first_fix.cpp)
target_compile_features(static PRIVATE cxx_std_17)
target_link_libraries(static PRIVATE bottomlock::static)
find_package(bottomlock {major}.{int(minor) + 1} QUIET)
if(bottomlock_FOUND)
    message(FATAL_ERROR "a later version was found")
endif()
"""
    (folder / "CMakeLists.txt").write_text(text, encoding="utf-8")
    run("cmake", "-S", ".", "-B", "build", f"-DCMAKE_PREFIX_PATH={moved}", cwd=folder)
    run("cmake", "--build", "build", cwd=folder)
    assert run("./build/shared", cwd=folder).strip() == VELOCITY
    assert run("./build/static", cwd=folder).startswith(VELOCITY)


def test_by_ctypes(prefix: Path, folder: Path) -> None:
    library = prefix / "lib" / "libbottomlock.so"
    assert run(sys.executable, "-S", "first_fix.py", library, cwd=folder).strip() == VELOCITY


@pytest.mark.deep
@pytest.mark.usefixtures("prefix")
def test_without_the_simulation(folder: Path) -> None:
    """As users install it, which compiles another kernel: the other tests have the wheel's, `make lint` checks both."""
    install(folder / "alone")
    library = folder / "alone" / "lib" / "libbottomlock.so"
    assert run(sys.executable, "-S", "first_fix.py", library, cwd=folder).strip() == VELOCITY


@pytest.fixture(scope="session")
def random_calls(prefix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program of random calls, built with the sanitizers."""
    needed("cc")
    built = tmp_path_factory.mktemp("attack") / "random_calls"
    command = ["cc", "-g", "-O1", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]
    command += [
        "-fno-sanitize-recover=all",
        f"-I{prefix / 'include'}",
        str(CRATE / "tests" / "random_calls.c"),
    ]
    command += [str(prefix / "lib" / "libbottomlock.a"), "-lpthread", "-lm", "-ldl", "-o", str(built)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode and re.search(r"cannot find .*(asan|ubsan)|unrecognized|unsupported", done.stderr):
        pytest.skip("the compiler has no sanitizers here")
    assert done.returncode == 0, done.stderr
    return built


@pytest.mark.long
@pytest.mark.slow
def test_random_calls(random_calls: Path, tmp_path: Path) -> None:
    """No crash, no finding of the sanitizers, no leak; a refused call changes nothing."""
    printed = run(random_calls, "11", str(CALLS), cwd=tmp_path)
    calls, refused = map(int, re.findall(r"\d+", printed))
    assert calls >= CALLS
    assert 0.1 * calls < refused < 0.6 * calls


def test_the_header_is_that_of_the_sources(root: Path, c: CLibrary) -> None:
    """Every exported call is declared and every declared one exported; `make header` compares the text itself."""
    crate = root / "crates" / "bottomlock-c"
    written = "".join(path.read_text(encoding="utf-8") for path in sorted((crate / "src").glob("*.rs")))
    exported = set(re.findall(r'extern "C" fn (bl_\w+)', written))
    assert exported == set(c.header.functions)
    assert len(exported) > 50
    wrapper = (crate / "include" / "bottomlock.hpp").read_text(encoding="utf-8")
    # What has no object is called as it is.
    plain = "attitude_from_euler euler_from_attitude state_at_rest version"
    lists = "geometry_preset_name model_preset_name method_name"
    slow = "navigator_attitude_error navigator_heading_error"
    assert exported - set(re.findall(r"bl_\w+", wrapper)) == {
        f"bl_{name}" for name in f"{plain} {lists} {slow}".split()
    }


def test_nothing_of_the_simulation_is_linked(root: Path) -> None:
    """A vehicle's build draws no random numbers and starts no threads."""
    tree = run(
        "cargo",
        "tree",
        "--locked",
        "--offline",
        "-p",
        "bottomlock-c",
        "-e",
        "normal",
        "--prefix",
        "none",
        cwd=root,
    )
    crates = {line.split()[0] for line in tree.splitlines() if line}
    assert not crates & {"rand", "rand_distr", "chacha20", "rayon", "rayon-core"}


def test_a_failure_has_its_code(c: CLibrary) -> None:
    """The likely mistakes; that the words are Python's is a matter of `test_same_bits.py`."""
    status = c.header.constants
    model, options = c("model_from_json", MODEL), c("options_from_json", "{}")
    state = c("state_at_rest", 0)
    geometry = c("geometry_from_json", '{"preset": "x_janus_20"}')
    faults: list[tuple[str, tuple[Any, ...]]] = [
        ("INVALID_VALUE", ("model_set", model, '{"dvl": {"beam_noise_sd": 0.1}}')),
        ("INVALID_VALUE", ("model_set", model, '{"depth": {"sd_m": -1.0}}')),
        ("NULL_POINTER", ("model_set", None, '{"depth": {"sd_m": 1.0}}')),
        ("INVALID_VALUE", ("model_set", model, '{"gps": {"position_sd_m": 1.0}}')),
        ("INVALID_VALUE", ("model_set", model, '{"environment": {"earth": "flat"}}')),
        ("INVALID_VALUE", ("options_set", options, '{"imu_limits": {"stuck_after": 1.5}}')),
        ("INVALID_VALUE", ("options_set", options, '{"gate": "off"')),
        ("INVALID_VALUE", ("options_from_json", "[]")),
        ("INVALID_VALUE", ("options_set", options, '{"water": [0.1, 600.0]}')),
        ("INVALID_VALUE", ("geometry_from_json", '{"configuration": "x", "tilt_rad": 20.0}')),
        ("UNKNOWN_NAME", ("geometry_from_json", '{"preset": "a50"}')),
        ("UNKNOWN_NAME", ("navigator_new", geometry, model, None, "tight", state, -1)),
        ("NULL_POINTER", ("navigator_new", geometry, model, None, None, None, -1)),
        ("INVALID_VALUE", ("navigator_new", geometry, model, None, None, state, 10**11)),
    ]
    for code, call in faults:
        with pytest.raises(CError) as caught:
            c(*call)
        assert caught.value.status == status[f"BL_STATUS_{code}"], call
    with pytest.raises(CError):
        c("options_set", options, '{"water": {"slip_tme_s": 5.0}}')
    assert c("last_error_key") == b"options.water.slip_tme_s"
    c("options_set", options, '{"robust": {"closure_gate": null}}')
    assert c.json("options", options)["robust"]["closure_gate"] is None
    navigator = c("navigator_new", geometry, model, options, "tc", state, -1)
    for name in ("navigator_water", "navigator_calibration"):
        with pytest.raises(CError) as caught:
            c(name, navigator, c.structure(name.removeprefix("navigator_")))
        assert caught.value.status == status["BL_STATUS_NOT_AVAILABLE"]
    three = (ctypes.c_double * 3)(0.0, 0.0, -9.8)
    assert c.raw.bl_push_imu(navigator, 10**7, three, three) == 0
    assert c.raw.bl_push_imu(navigator, 10**7, three, three) == status["BL_STATUS_TIME_NOT_INCREASING"]
    assert c.raw.bl_push_imu(navigator, 10**10, three, three) == status["BL_STATUS_IMU_GAP"]
    for step in range(2, 400):
        assert c.raw.bl_push_imu(navigator, step * 10**7, three, three) == 0
    assert c.raw.bl_push_depth(navigator, 10**7, 0.0, 1.0) == status["BL_STATUS_TOO_LATE"]
    assert c.raw.bl_push_depth(navigator, 10**16, 0.0, 1.0) == status["BL_STATUS_TOO_FAR_AHEAD"]
    for kind, one in (
        ("navigator", navigator),
        ("geometry", geometry),
        ("model", model),
        ("options", options),
    ):
        c(f"{kind}_free", one)
