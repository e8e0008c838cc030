"""The learned rivals: inputs, training, and the committed weights on missions that training has not seen.

torch is not among the locked requirements.
"""
# ruff: noqa: ANN401 - what is imported only where it is installed has no types here

from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import load_scenario
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_missions
from partialdvl_bench.mission_list import missions_of
from partialdvl_bench.seeds import PUBLIC_SEED

torch: Any = pytest.importorskip("torch", reason="torch is installed for the rivals alone")
data: Any = import_module("benches.rivals.learned_data")
network: Any = import_module("benches.rivals.learned_network")
loose_ins: Any = import_module("benches.rivals.loose_ins")
learned_beams: Any = import_module("benches.rivals.learned_beams")
learned_velocity: Any = import_module("benches.rivals.learned_velocity")
train: Any = import_module("benches.rivals.learned_train")
missions: Any = import_module("benches.rivals.scenario_missions")

NETWORKS = ((learned_beams, "BeamNetwork"), (learned_velocity, "VelocityNetwork"))


@lru_cache(maxsize=1)
def flown() -> Any:
    return missions.scenario_mission(load_scenario("survey_table2").with_trajectory(duration_s=30.0))


@pytest.fixture(scope="module")
def validation(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """Three missions of the validation split: one of each grade of inertial sensors, outages and wrong beams."""
    names = (
        "remus100-fibre_optic-rough-tidal-janus30-geometric-student_t3-box-250s",
        "tauv-tactical-slope-none-janus30-schedule-recorded-zigzag-250s",
        "remus100-mems-flat-steady-janus20-fish-student_t3-lawn-250s",
    )
    out = tmp_path_factory.mktemp("bench")
    specs = missions_of(("validation",), names)
    make_missions(specs, lambda _: PUBLIC_SEED, out, lambda *_: None)
    return [load_mission(Path(out) / "validation" / name) for name in names]


def test_a_sample_holds_nothing_of_later() -> None:
    """Readings after a time of the grid may be anything: the samples up to it do not change."""
    mission = flown()
    later_imu, later_ping = mission.imu.time_ns > 20_000_000_000, mission.pings.time_ns > 20_000_000_000
    changed = replace(
        mission,
        imu=replace(mission.imu, force_p_mps2=np.where(later_imu[:, None], 99.0, mission.imu.force_p_mps2)),
        pings=replace(
            mission.pings, velocity_mps=np.where(later_ping[:, None], 9.0, mission.pings.velocity_mps)
        ),
    )
    before, after = data.samples_of(mission), data.samples_of(changed)
    for name in ("beams", "valid", "inertial"):
        np.testing.assert_array_equal(getattr(before, name)[:20], getattr(after, name)[:20])
        if name != "valid":
            assert not np.array_equal(getattr(before, name)[20:], getattr(after, name)[20:])


def test_the_inertial_parts_are_means() -> None:
    mission = flown()
    rows = (mission.imu.time_ns > 9_000_000_000) & (mission.imu.time_ns <= 10_000_000_000)
    expected = mission.imu.omega_p_radps[rows].mean(axis=0) / 0.1
    np.testing.assert_allclose(data.samples_of(mission).inertial[9, :3].mean(axis=1), expected, rtol=1e-6)


def test_a_mirrored_sample_is_that_of_a_mirrored_path() -> None:
    """Beams read the same; b · v and the baseline's velocity agree with the mirrored vectors."""
    samples = data.samples_of(flown())
    mirror = data.mirrored(samples, np.ones(len(samples.beams), bool))
    np.testing.assert_allclose(mirror.true_beams, samples.true_beams)
    turned = data.baseline(samples).velocity_mps * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(data.baseline(mirror).velocity_mps, turned, atol=1e-12)


def test_the_baseline_is_least_squares_and_the_moving_average() -> None:
    scenario = load_scenario("straight").with_trajectory(duration_s=30.0).replace({"dvl.beams_lost": []})
    samples = data.samples_of(missions.scenario_mission(scenario))
    whole = samples.valid[:, -1].all(axis=1)
    assert whole.sum() > 10
    found = data.baseline(samples)
    for row in np.flatnonzero(whole).tolist():
        solved = np.linalg.lstsq(samples.directions[row], samples.beams[row, -1])[0]
        np.testing.assert_allclose(found.velocity_mps[row], solved, atol=1e-3)
    valid = samples.valid.copy()
    valid[:, -1, 2] = False
    without = data.baseline(replace(samples, valid=valid))
    for row in range(10, 30):
        past = samples.beams[row, :-1, 2][samples.valid[row, :-1, 2]]
        assert without.beams[row, 2] == pytest.approx(past.mean())
        np.testing.assert_array_equal(
            without.beams[row, [0, 3]],
            np.where(valid[row, -1], samples.beams[row, -1], without.beams[row])[[0, 3]],
        )


@pytest.mark.long
@pytest.mark.parametrize(("module", "kind"), NETWORKS)
def test_training_learns_a_bias_and_its_scatter(module: Any, kind: str) -> None:
    """A sway of 0.3 m/s that the beams do not show is learned from the truth, with a variance that fits."""
    samples = data.samples_of(flown())
    valid = samples.valid.copy()
    valid[:, :, 2:] = False
    shifted = replace(
        samples,
        valid=valid,
        beams=np.where(valid, samples.beams, 0.0),
        velocity_mps=samples.velocity_mps + np.array([0.0, 0.3, 0.0]),
    )
    torch.manual_seed(1)
    made = getattr(module, kind)()
    plan = network.Schedule(epochs=40, patience=40, batch=32, rate=1e-2)
    before = float(module.loss(made.eval(), shifted).detach())
    outcome = network.train(made, module.loss, shifted, shifted, seed=1, schedule=plan)
    assert outcome.validation_loss < before - 1.0
    again = float(module.loss(made, shifted).detach())
    assert again == pytest.approx(outcome.validation_loss, rel=1e-5)


@pytest.mark.parametrize(("module", "kind"), NETWORKS)
def test_weights_come_back(module: Any, kind: str, tmp_path: Path) -> None:
    made = getattr(module, kind)().eval()
    size = network.save(made, tmp_path / "weights.npz")
    assert size < 100_000
    back = network.load(getattr(module, kind)(), tmp_path / "weights.npz")
    samples = data.samples_of(flown())
    for one, other in zip(module.velocities(made, samples), module.velocities(back, samples), strict=True):
        np.testing.assert_array_equal(one, other)
    other_kind = learned_beams.BeamNetwork if kind == "VelocityNetwork" else learned_velocity.VelocityNetwork
    with pytest.raises(Exception, match="of another network"):
        network.load(other_kind(), tmp_path / "weights.npz")
    with pytest.raises(Exception, match="learned_train"):
        network.load(other_kind(), tmp_path / "none.npz")


@pytest.mark.long
def test_the_committed_weights_beat_the_baseline(validation: list[Any]) -> None:
    """On missions that were not learned from: margins of 3 % (beams) and 10 % (velocity), and NEES between 1 and 6."""
    samples = data.joined([data.samples_of(mission) for mission in validation])
    simple = train.rms(samples.velocity_mps - data.baseline(samples).velocity_mps)
    for module, margin in ((learned_beams, 0.97), (learned_velocity, 0.90)):
        velocity, covariance = module.velocities(module._trained(), samples)
        error = samples.velocity_mps - velocity
        assert train.rms(error) < margin * simple, module.__name__
        assert 1.0 < train.nees(error, covariance) < 6.0, module.__name__


def test_the_loose_filter_adds_a_position() -> None:
    """Velocities without error aid the filter, beside depth and heading: the position follows the truth."""
    scenario = load_scenario("survey_table2").with_trajectory(duration_s=30.0)
    mission = missions.scenario_mission(scenario.replace({"heading.enabled": True}))
    truth, covariance = mission.truth, np.tile(np.eye(3) * 1e-4, (30, 1, 1))
    aided = loose_ins.loosely_coupled(mission, truth.velocity_p_mps, covariance)
    assert train.rms(truth.velocity_p_mps - aided.velocity_p_mps) < 0.02
    moved = (aided.position_t_m - mission.start.position_t_m)[:, :2]
    true = (truth.position_t_m - truth.position_t_m[0])[:, :2]
    assert np.linalg.norm(moved[-1] - true[-1]) < 4.0
    assert np.sqrt(aided.position_cov[-1, 2, 2]) < 0.5
    turned = replace(mission, heading=replace(mission.heading, value=mission.heading.value + 0.02))
    other = loose_ins.loosely_coupled(turned, truth.velocity_p_mps, covariance)
    assert np.abs(other.attitude_t_p[-1] - aided.attitude_t_p[-1]).max() > 1e-3
