"""What every test shares: hypothesis profiles, one thread per test process, the place of the recordings."""

import gc
import os
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import settings

# Test processes already use every core; set before numpy, polars and the kernel start their pools.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ["RAYON_NUM_THREADS"] = "1"
    os.environ["POLARS_MAX_THREADS"] = "1"
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ.setdefault("MPLBACKEND", "Agg")

# Continuous integration repeats the same cases, so that a red commit is the commit's fault.
REPEATED: dict[str, Any] = {"derandomize": True, "print_blob": True} if "CI" in os.environ else {}
# Examples of a law: `make test`, `make test-long`, and by hand. Deadlines would measure the machine, not the code.
for name, examples in {"dev": 50, "long": 200, "deep": 20_000}.items():
    settings.register_profile(name, max_examples=examples, deadline=None, **REPEATED)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "dev"))

ROOT = Path(__file__).resolve().parent.parent


class WrittenDoctests:
    """Modules without an example are not searched for one: most of the package, and every test."""

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(
        self, file_path: Path
    ) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
        """The collectors of a file."""
        collectors = yield
        return [
            collector
            for collector in collectors
            if not isinstance(collector, DoctestModule) or b">>>" in file_path.read_bytes()
        ]


def pytest_configure(config: pytest.Config) -> None:
    """Of the package too, which lies outside this folder."""
    config.pluginmanager.register(WrittenDoctests())


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected stays to the end: the garbage collector neither runs meanwhile nor looks at it afterwards.

    It took a quarter of the time of collecting, and each full collection of a test went through all of it again. Full
    ones, which what libraries hold makes slow, are rare.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(700, 10, 100)
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of tests with `first_cases` the later cases are long, or deep; files with slow tests first.

    So no process ends with a slow file while the others wait. Those of the C library come last, since they wait for
    what cargo compiles beside the tests.
    """
    seen: Counter[str] = Counter()
    for item in items:
        first = item.get_closest_marker("first_cases")
        if first is None:
            continue
        (count,), later = first.args, first.kwargs.get("later", "long")
        if item.get_closest_marker(later) is None:
            test = item.nodeid.split("[", 1)[0]
            seen[test] += 1
            if seen[test] > count:
                item.add_marker(getattr(pytest.mark, later))
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (item.path.parent.name == "c", item.path not in slow))


@pytest.fixture(scope="session")
def root() -> Path:
    """Top folder of the checkout."""
    return ROOT


@pytest.fixture
def undrawn() -> Iterator[None]:
    """As `tests.undrawn.figures_undrawn`, for one test."""
    from tests.undrawn import figures_undrawn

    with figures_undrawn():
        yield


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of the recordings that may not be republished; skips the test where they are absent.

    The variable BOTTOMLOCK_RECORDINGS names it; without it, `shared/data` beside the checkout.
    """
    folder = Path(os.environ.get("BOTTOMLOCK_RECORDINGS", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings in {folder}; set BOTTOMLOCK_RECORDINGS")
    return folder
