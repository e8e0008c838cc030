"""`bottomlock bench run` on a cluster: the estimates of this process, resumed, and what is refused."""

from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from bottomlock.errors import EngineError
from partialdvl_bench.methods import estimator
from partialdvl_bench.mission import Estimates, Mission
from partialdvl_bench.run import part_path, run_missions
from tests.bench.missions import made, short_specs
from tests.campaign.clusters import two_processes

needs_dask = pytest.mark.skipif(
    find_spec("distributed") is None,
    reason="the package distributed is not installed: pip install '.[dask]'",
)
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

SPECS = short_specs(2)[:3]
METHODS = ("tc", "consistent")


def no_estimate(mission: Mission) -> Estimates:
    """A rival that fails."""
    raise ZeroDivisionError(f"nothing of {mission.name}")


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a scheduler with two worker processes."""
    with two_processes() as both:
        yield both.scheduler_address


def run(out: Path, *names: str, **settings: Any) -> int:  # noqa: ANN401
    """The short missions with these methods."""
    return run_missions(SPECS, made(), dict(map(estimator, names or METHODS)), out, **settings)


def estimates(out: Path) -> pl.DataFrame:
    """All that was written, but for the times."""
    paths = [part_path(out, method, spec) for method in METHODS for spec in SPECS]
    return pl.concat([pl.read_parquet(path) for path in paths]).drop("wall_s")


@pytest.mark.long
@needs_dask
@pytest.mark.slow
def test_a_cluster_gives_the_estimates_of_this_process(tmp_path: Path, cluster: str) -> None:
    """Every bit; what one has finished the other keeps, and the bar ends at the whole."""
    assert run(tmp_path / "here") == len(SPECS) * len(METHODS)
    heard: list[tuple[str, float]] = []

    def stop(name: str, fraction: float) -> None:
        heard.append((name, fraction))
        if len(heard) == 2:
            raise KeyboardInterrupt

    there = {"engine": "dask", "scheduler": cluster}
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "there", **there, progress=stop)
    assert len(list((tmp_path / "there").rglob("*.parquet"))) == 2
    assert run(tmp_path / "there", **there, progress=lambda *one: heard.append(one)) == 4
    assert {name for name, _ in heard[:-1]} <= {spec.name for spec in SPECS}
    assert [fraction for _, fraction in heard[2:]] == [0.25, 0.5, 0.75, 1.0, 1.0]
    assert estimates(tmp_path / "there").equals(estimates(tmp_path / "here"))
    assert run(tmp_path / "there") == 0


@pytest.mark.long
@needs_dask
@pytest.mark.slow
def test_a_fault_of_a_rival_names_it_and_its_mission(tmp_path: Path, cluster: str) -> None:
    words = r"broken on (\S+): scheduler .* failed \(ZeroDivisionError: nothing of \1\)"
    with pytest.raises(EngineError, match=words):
        run(tmp_path, "broken=tests.bench.test_engines:no_estimate", engine="dask", scheduler=cluster)


@pytest.mark.long
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"engine": "spark"}, r"engine 'spark' is not known \(known: local, dask\)"),
        ({"scheduler": "tcp://a:1"}, "given with engine 'local': only dask"),
        ({"threads": 2}, "threads are given with engine 'local', which runs one mission at a time"),
        ({"engine": "dask", "scheduler": "tcp://a:1", "threads": 2}, "whose workers bring their own"),
    ],
)
def test_settings_that_have_no_effect_are_refused(
    tmp_path: Path, settings: dict[str, Any], words: str
) -> None:
    with pytest.raises(EngineError, match=words):
        run(tmp_path / "o", **settings)
    assert not (tmp_path / "o").exists()


def test_our_methods_can_travel() -> None:
    """By name, not as a function that a worker cannot find."""
    assert isinstance(estimator("tc")[1], partial)
