"""The public tables of docs/bench.md: from the committed scores, which a mission that is flown again has."""

from pathlib import Path

import polars as pl
import pytest

from bottomlock.kernel import METHODS
from bottomlock.own_method import DEAD_RECKONING
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_missions
from partialdvl_bench.methods import estimator
from partialdvl_bench.mission_list import mission_list, missions_of
from partialdvl_bench.seeds import PUBLIC_SEED
from partialdvl_bench.tasks import scores_of
from tools import bench_public, publish_bench

SLIPS = "remus100-tactical-slip_20cm_60s-drop_off-sheared-janus20-fish-recorded-lawn-250s"
FLOWN = (
    "tc",
    "sway_current",
    "consistent",
    DEAD_RECKONING,
    *(r for r in bench_public.RIVALS if r != "factor_graph"),
)


@pytest.mark.long
def test_the_tables_are_those_of_the_scores() -> None:
    page = publish_bench.PAGE.read_text(encoding="utf-8")
    for name, text in publish_bench.tables().items():
        assert publish_bench.mark(name) + text + publish_bench.LAST in page, name


def test_every_method_and_rival_has_every_public_mission() -> None:
    table = pl.read_csv(publish_bench.PUBLIC_SCORES, schema_overrides={"version": pl.String})
    specs = [
        spec for spec in mission_list() if spec.split != "test" and spec.version in bench_public.VERSIONS
    ]
    wanted = {
        (spec.version, spec.name, method)
        for spec in specs
        for method in (*METHODS, DEAD_RECKONING, *bench_public.RIVALS)
    }
    assert table.height == len(wanted)
    assert set(table.select("version", "mission", "method").rows()) == wanted
    kinds = [[kind for kind, holds in publish_bench.KINDS.items() if holds(spec)] for spec in specs]
    assert all(len(of_mission) == 1 for of_mission in kinds)


@pytest.mark.long
def test_a_mission_that_is_flown_again_has_the_scores_of_the_table(tmp_path: Path) -> None:
    """One with slip and fish, by ours and by the rivals of numpy alone; the last digits are the machine's."""
    (spec,) = missions_of(names=(SLIPS,))
    make_missions([spec], lambda _: PUBLIC_SEED, tmp_path)
    mission = load_mission(tmp_path / spec.split / spec.name)
    published = publish_bench.public_scores().filter(pl.col("mission") == spec.name)
    for method in FLOWN:
        rival = f"{method}=benches.rivals.{method}:estimate"
        _, call = estimator(rival if method in bench_public.RIVALS else method)
        found = scores_of(mission, call(mission), method)
        both = published.join(found, on=["method", "mission", "task", "score"], suffix="_again")
        assert both.height == published.filter(pl.col("method") == method).height > 8
        for row in both.iter_rows(named=True):
            assert row["value_again"] == pytest.approx(row["value"], rel=1e-4, abs=1e-5), row
