"""The examples run as they are shown, draw what their pages show, and the numbers bear out what their text says."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
# Seconds of a core each; a page that fails at all fails the build of the site, too.
LONG = {"my_a50_log", "audit_mis_mounted", "cluster", "why_vb_is_overconfident"}


def final(table: pl.DataFrame, method: str, column: str = "velocity_mps") -> float:
    return float(table.filter(pl.col("method") == method)[column][-1])


def paper(names: dict[str, Any]) -> None:
    """The virtual beam is no better than tc and claims far too much; nsv and sway_current come near lc."""
    table = names["table"]
    assert final(table, "vb") > final(table, "tc")
    assert final(table, "vb", "nees_of_6") > 1000 * final(table, "tc", "nees_of_6")
    for method in ("nsv", "sway_current"):
        assert final(table, method) < 2.0 * final(table, "lc") < 0.1 * final(table, "tc")


def one_beam(names: dict[str, Any]) -> None:
    """With one beam tc is lost and sway_current is not."""
    table = names["table"].sort("beams")
    assert table["tc"][0] > 20.0 * table["sway_current"][0]
    assert table["sway_current"][0] < 0.3


def current(names: dict[str, Any]) -> None:
    """A sway of zero is best in still water and worst across; tc and sway_current do not care."""
    rows = {(water, method): (error, nees) for water, method, error, nees in names["rows"]}
    still, across = "still water", "0.3 m/s across"
    assert min(names["METHODS"], key=lambda method: rows[still, method][0]) == "nsv"
    assert max(names["METHODS"], key=lambda method: rows[across, method][0]) == "nsv"
    assert rows[across, "nsv"][1] > 200.0
    for method in ("tc", "sway_current"):
        assert rows[across, method][0] == pytest.approx(rows[still, method][0], rel=0.3)


def lost_bottom(names: dict[str, Any]) -> None:
    """The water bounds the error of both methods; without it tc is lost, and sway_current several times as far off."""
    error = {(returns, method): value for returns, method, value, _ in names["rows"]}
    wet, dry = "bottom and water", "bottom alone"
    assert max(error[wet, method] for method in names["METHODS"]) < 16.0
    assert error[dry, "tc"] > 50.0 * error[wet, "tc"]
    assert error[dry, "sway_current"] > 2.0 * error[wet, "sway_current"]
    assert error[dry, "sway_current"] < 0.1 * error[dry, "tc"]


def slope(names: dict[str, Any]) -> None:
    """The rules of the scenario lose beams, and each part of the text has its number."""
    lost = names["valid"].sum(axis=1)
    assert (lost < 4).mean() > 0.5
    table = names["table"]
    assert final(table, "nsv", "velocity_rms_mps") > 1.5 * final(table, "tc", "velocity_rms_mps")
    assert final(table, "sway_current", "velocity_rms_mps") < final(table, "tc", "velocity_rms_mps")


def planner(names: dict[str, Any]) -> None:
    """A turn makes the sway better known than the straight course; nothing shows the yaw."""
    table = names["table"]
    assert names["best"]["manoeuvre"] != "straight"
    assert table.filter(pl.col("state") == "yaw")["fraction_left"].min() > 0.95
    straight = table.filter((pl.col("state") == "velocity y") & (pl.col("manoeuvre") == "straight"))
    assert straight["sd_after"].item() > 3.0 * names["best"]["sd_after"]


def own_method(names: dict[str, Any]) -> None:
    """What is known of the heave solves for the sway."""
    last = names["results"].ensemble.filter(pl.col("time_s") == pl.col("time_s").max())
    column = "velocity_rms_over_runs_mps"
    assert final(last, "level_flight", column) < 0.3 * final(last, "tc", column)


def own_sensor(names: dict[str, Any]) -> None:
    """The wheel fixes the surge alone; the five beams state what two of them leave open."""
    alone, helped = (np.sqrt((names[key] ** 2).mean(axis=0)) for key in ("alone", "helped"))
    assert helped[0] < 0.1 * alone[0]
    assert helped[1] > 0.2
    assert np.isnan(np.asarray(names["fixes"].velocity_p_mps)[0]).tolist() == [True, True, False]


def late(names: dict[str, Any]) -> None:
    """The same bits whatever the order; a wrong stamp costs metres."""
    assert names["same"]
    rms = {
        key: np.sqrt((names[f"errors_{key}"] ** 2).sum(axis=1).mean())
        for key in ("in_order", "late", "naive")
    }
    assert rms["in_order"] < rms["late"] < 0.5 * rms["naive"]


def audit(names: dict[str, Any]) -> None:
    """The beams alone show nothing, the reference the planted angle; its scatter is larger than the claim."""
    assert names["alone"].findings == []
    assert abs(names["yaw_deg"] - names["PLANTED_DEG"]).max() < 1.0
    assert names["yaw_deg"].std(ddof=1) > 3.0 * names["sd_deg"].mean()


def cluster(names: dict[str, Any]) -> None:
    """Each shard has a chunk, and the whole has the same bits."""
    assert all(len(list(part.rglob("samples*.parquet"))) == 1 for part in names["parts"])
    for table in ("runs", "ensemble", "consistency"):
        assert getattr(names["whole"], table).equals(getattr(names["merged"], table))


def a50(names: dict[str, Any]) -> None:
    """With beams 1 and 2 of an A50 the sway is solved and the rest is left out; noise is measured."""
    two = names["fixes"].filter(names["away"])
    assert two["sway_mps"].is_not_null().all()
    assert two["surge_mps"].is_null().all()
    assert names["fixes"]["beam_sd_factor"][0] > 3.0


def notebook(names: dict[str, Any]) -> None:
    """A table for the eyes, and the runs with two and with three beams are pairs."""
    assert "<table" in names["found"]["two beams"]._repr_html_()
    differences = names["compared"].filter(pl.col("campaign") == "three beams")
    assert differences["paired"].all()
    nsv = differences.filter((pl.col("method") == "nsv") & (pl.col("quantity") == "velocity at the end"))
    assert nsv.height == 1


def replayed(names: dict[str, Any]) -> None:
    """The same log: only the compass differs, and a claim without it is larger."""
    compared = names["compared"].filter(pl.col("quantity") == "σ at the end, north")
    assert set(compared["what_if"]) == set(names["replay"].what_ifs)
    of_tc = compared.filter((pl.col("method") == "tc") & (pl.col("pass") == "forward"))
    assert (of_tc["difference"] > 0.0).all()


def partial(names: dict[str, Any]) -> None:
    """Beams 1 and 2 show the surge, beams 1 and 4 the sway."""
    (surge, sway, _), (other_surge, other_sway, _) = (
        np.sqrt(np.diag(names["after"](beams))) for beams in ([0, 1], [0, 3])
    )
    assert surge < 0.3 * sway
    assert other_sway == pytest.approx(surge)
    assert other_surge == pytest.approx(sway)


def virtual(names: dict[str, Any]) -> None:
    """The claim of vb is a small part of its error at n_f = 1, and with 100 it is tc."""
    vb = names["vb"]
    assert vb["claimed_mps"][0] < 0.05 * vb["error_mps"][0]
    assert vb["error_mps"][-1] == pytest.approx(names["tc"]["error_mps"].item(), rel=0.05)
    assert vb["claimed_mps"][-1] == pytest.approx(names["tc"]["claimed_mps"].item(), rel=0.05)


def observability(names: dict[str, Any]) -> None:
    """A manoeuvre adds more states than three beams do, and four beams leave the heading open."""
    ranks, straight, turning = names["ranks"], names["straight"], names["turning"]
    assert ranks[turning, 0] - ranks[straight, 0] > ranks[straight, 3] - ranks[straight, 0]
    one = names["one"]
    assert one.unobservable_fraction[one.states.index("yaw")] > 0.9


def nees(names: dict[str, Any]) -> None:
    """Virtual heave is overconfident on this trajectory, tc is not."""
    mean = names["last"].group_by("method").agg(pl.col("nees_velocity_attitude").mean())
    value = dict(mean.iter_rows())
    assert value["vhv"] > 10.0
    assert 5.16 < value["tc"] < 6.91


CLAIMS = {
    "paper_in_five_minutes": paper,
    "one_beam_only": one_beam,
    "cross_current": current,
    "lost_bottom": lost_bottom,
    "slope": slope,
    "planner": planner,
    "method_of_my_own": own_method,
    "sensor_of_my_own": own_sensor,
    "live_late_data": late,
    "audit_mis_mounted": audit,
    "cluster": cluster,
    "my_a50_log": a50,
    "notebook_use": notebook,
    "replay_in_a_notebook": replayed,
    "why_partial_beams": partial,
    "why_vb_is_overconfident": virtual,
    "observability_in_pictures": observability,
    "what_nees_is": nees,
}


def test_every_example_has_its_claims() -> None:
    assert {script.stem for script in SCRIPTS} == set(CLAIMS)


@pytest.mark.parametrize(
    "script",
    [pytest.param(one, marks=pytest.mark.long if one.stem in LONG else (), id=one.stem) for one in SCRIPTS],
)
def test_an_example_runs_draws_and_keeps_its_word(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []

    def show() -> None:
        drawn.extend(plt.get_fignums())
        plt.close("all")

    monkeypatch.setattr(plt, "show", show)
    names = runpy.run_path(str(script))
    assert drawn
    CLAIMS[script.stem](names)
