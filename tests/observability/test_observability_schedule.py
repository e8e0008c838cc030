"""Schedules of measurements: by hand, a scenario's own, and what they do to ranks and deviations."""

import tomllib
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import load_scenario, parse_scenario
from bottomlock.errors import DataError, ScenarioError
from bottomlock.kernel import SENSORS, BeamGeometry, KernelError
from bottomlock.observability.analysis import Aiding, Schedule, deviations, observe
from bottomlock.observability.report import observe_scenario, scenario_schedule
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.manoeuvres import MANOEUVRES, manoeuvre_truth
from bottomlock.truth import Truth
from tests.toml_text import toml

JANUS = BeamGeometry.janus(np.deg2rad(20.0))
SECOND = 10**9
STRAIGHT = (resources.files("bottomlock.config") / "scenarios" / "straight.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def eight() -> Truth:
    return manoeuvre_truth(MANOEUVRES["figure_eight"], rate_hz=50.0)


def short(duration_s: float = 40.0, /, **sections: dict[str, Any]) -> str:
    """The packaged straight course, analytic and short, all beams back, with other keys in some sections, as TOML."""
    content = tomllib.loads(STRAIGHT)
    content["trajectory"] = {"kind": "straight", "source": "analytic", "duration_s": duration_s}
    del content["mission"]
    del content["dvl"]["beams_lost"]
    for name, change in sections.items():
        content[name] = content.get(name, {}) | change
    top = {key: value for key, value in content.items() if not isinstance(value, dict)}
    return toml({"": top} | {key: value for key, value in content.items() if isinstance(value, dict)})


def scheduled(**sections: dict[str, Any]) -> tuple[Schedule, Schedule]:
    simulation = build_simulation(parse_scenario(short(**sections), place="test"))
    return scenario_schedule(simulation, simulation.truth())


def test_a_schedule_of_everything_is_the_period(eight: Truth) -> None:
    """All beams at every second from the start: the very numbers of a period of a second."""
    times = np.arange(65) * SECOND
    everything = Schedule.of(eight.time_ns, dvl_time_ns=times, beam_valid=np.ones((65, 4), dtype=np.bool_))
    aiding = Aiding(beams=(1, 2))
    (by_period,) = observe(eight, JANUS, [aiding], earth_rate_radps=0.0)
    (by_schedule,) = observe(eight, JANUS, [aiding], earth_rate_radps=0.0, schedule=everything)
    np.testing.assert_array_equal(by_period.rows, by_schedule.rows)
    assert by_period.rank == by_schedule.rank


def test_a_sensor_counts_where_it_is_in_the_set_and_scheduled(eight: Truth) -> None:
    """Four beams for half a minute, then two, and depth every four seconds: as many rows as that."""
    times = np.arange(1, 65) * SECOND
    valid = np.ones((64, 4), dtype=np.bool_)
    valid[30:, 2:] = False
    schedule = Schedule.of(
        eight.time_ns, dvl_time_ns=times, beam_valid=valid, others={"depth": times[3::4], "attitude": times}
    )
    (found,) = observe(
        eight, JANUS, [Aiding(beams=(1, 2, 3, 4), depth=True)], earth_rate_radps=0.0, schedule=schedule
    )
    assert len(found.rows) == 30 * 4 + 34 * 2 + 16


def test_a_sensor_of_an_interval_adds_information_then(eight: Truth) -> None:
    """Beams 3 and 4 for ten seconds: until then the deviations of four beams, then greater; the rank keeps them."""
    times = np.arange(1, 65) * SECOND
    valid = np.ones((64, 4), dtype=np.bool_)
    valid[10:, 2:] = False
    schedule = Schedule.of(eight.time_ns, dvl_time_ns=times, beam_valid=valid)
    model = load_scenario("straight").kernel_model(eight.gravity_mps2)
    model = model.replace(
        environment=model.environment.replace(latitude_rad=eight.latitude_rad, earth_rate_radps=0.0)
    )
    four_throughout = Schedule.of(eight.time_ns, dvl_time_ns=times, beam_valid=np.ones_like(valid))
    gone, stayed = (
        deviations(eight, JANUS, Aiding(beams=(1, 2, 3, 4)), model, schedule=which).sd
        for which in (schedule, four_throughout)
    )
    np.testing.assert_array_equal(gone[:10], stayed[:10])
    assert (gone[11:] > stayed[11:]).all(axis=0).sum() >= 12
    assert gone[-1, 17] > stayed[-1, 17], "bias of beam 3"
    sets = [Aiding(beams=(1, 2)), Aiding(beams=(1, 2, 3, 4))]
    two, four = observe(eight, JANUS, sets, earth_rate_radps=0.0, schedule=schedule)
    assert two.rank < four.rank
    assert "beam bias 4" in two.unobservable


def test_lever_arms_of_depth_and_gps(eight: Truth) -> None:
    """Far from the centre a depth sensor reads tilt and an antenna yaw: by hand at the start, heading north."""
    antenna = Aiding(gps_position=True, gps_lever_p_m=(2.0, 0.0, -0.5))
    sensor = Aiding(depth=True, depth_lever_p_m=(3.0, 1.0, 0.0))
    far, deep = observe(eight, JANUS, [antenna, sensor], earth_rate_radps=0.0)
    # −[l×] with l = (2, 0, −1/2), and the third row of −[(R l)×].
    np.testing.assert_allclose(
        far.rows[:3, 3:6], np.array([[0.0, -0.5, 0.0], [0.5, 0.0, 2.0], [0.0, -2.0, 0.0]]), atol=1e-12
    )
    np.testing.assert_allclose(deep.rows[0, 3:6], [1.0, -3.0, 0.0], atol=1e-12)
    with pytest.raises(KernelError, match=r"aiding.levers.gps_p_m is NaN"):
        observe(eight, JANUS, [Aiding(gps_position=True, gps_lever_p_m=(np.nan, 0.0, 0.0))])


def test_an_outage_and_dropouts_reach_the_schedule() -> None:
    """Beams 3 and 4 out from 10 s to 20 s; beam 1 by chance: the same chances as run 0 of a campaign."""
    planned, every = scheduled(dvl={"outages": [{"beams": [3, 4], "from_s": 10.0, "to_s": 20.0}]})
    seconds = planned.time_ns / SECOND
    out = (seconds >= 10.0) & (seconds < 20.0)
    np.testing.assert_array_equal(planned.beams[:, 2], ~out)
    assert planned.beams[:, 0].all()
    assert every.beams.all()
    dropouts = {"dropouts": [{"beams": [1], "mean_up_s": 5.0, "mean_down_s": 5.0}]}
    (chance, _), (again, _) = scheduled(dvl=dropouts), scheduled(dvl=dropouts)
    assert 0 < chance.beams[:, 0].sum() < len(chance.time_ns)
    np.testing.assert_array_equal(chance.beams, again.beams)


def test_rates_and_silence_reach_the_schedule() -> None:
    """Depth every four seconds; GPS under water never."""
    planned, _ = scheduled(
        dvl={"beams_lost": [3, 4]},
        depth={"enabled": True},
        magnetometer={"enabled": True},
        gps={"rate_hz": 1.0},
        environment={"depth_m": 20.0},
    )
    assert int(planned.others["depth"].sum()) == 10
    assert int(planned.others["attitude"].sum()) == 20
    own = Aiding.scheduled(planned)
    assert own == Aiding(beams=(1, 2), depth=True, attitude=True)


def test_too_many_epochs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "fast.toml"
    path.write_text(short(60.0, dvl={"rate_hz": 100.0}), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"measure at 6000 times, expected at most 5000"):
        observe_scenario(path, tmp_path / "o")


def _fifth(truth: Truth) -> Schedule:
    return Schedule.of(
        truth.time_ns, dvl_time_ns=np.array([-1, 5]), beam_valid=np.ones((2, 4), dtype=np.bool_)
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (_fifth, "dvl at -1 ns is outside the truth"),
        (lambda truth: Schedule.regular(truth.time_ns, 4, {"sonar": 1.0}), "there is no sensor 'sonar'"),
        (
            lambda truth: Schedule.of(
                truth.time_ns, dvl_time_ns=np.array([SECOND]), beam_valid=np.ones((2, 4), dtype=np.bool_)
            ),
            r"beam_valid has shape \(2, 4\), expected \(1, beams\)",
        ),
    ],
)
def test_schedules_that_make_no_sense(eight: Truth, make: Callable[[Truth], Schedule], words: str) -> None:
    with pytest.raises(DataError, match=words):
        make(eight)


def test_schedules_that_the_kernel_refuses(eight: Truth) -> None:
    silent = Schedule(
        time_ns=np.arange(3) * SECOND,
        beams=np.zeros((3, 4), dtype=np.bool_),
        others={name: np.zeros(3, dtype=np.bool_) for name in SENSORS},
    )
    with pytest.raises(KernelError, match="the aiding set reads no state of the model"):
        observe(eight, JANUS, [Aiding(beams=(1,))], schedule=silent)
    falling = Schedule(silent.time_ns[::-1].copy(), silent.beams, silent.others)
    with pytest.raises(KernelError, match="schedule"):
        observe(eight, JANUS, [Aiding(beams=(1,))], schedule=falling)
    with pytest.raises(KernelError, match="the 2015 model has periodic epochs only"):
        observe(eight, JANUS, [Aiding(velocity=True)], kind="paper", schedule=silent)
