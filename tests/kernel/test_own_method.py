"""Methods of one's own: copies of built-in ones are these, in campaigns and replays, and what is no method is named."""

import re
import runpy
import sys
import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import bottomlock
from bottomlock import kernel, own_method
from bottomlock.campaign.run import run_campaign
from bottomlock.config.scenario import Scenario, load_scenario, parse_scenario
from bottomlock.config.validation import checked
from bottomlock.errors import KernelError, OutputError, ScenarioError
from bottomlock.kernel.models import Calibration
from bottomlock.own_method import Beams, Fix, Prior, Rows
from bottomlock.replay.case import Settings
from bottomlock.simulation.build import build_simulation
from tests.analytic import batch_along
from tests.kernel.test_late_data import under_way
from tests.kernel.test_replay_log import replayed


class TightCopy:
    """The rows of tc."""

    name = "tight_copy"

    def ping(self, beams: Beams, prior: Prior) -> Rows:  # noqa: ARG002
        """As they come."""
        return beams.rows


class Returns:
    """Returns what it was made with."""

    def __init__(self, name: str, outcome: object) -> None:
        self.name = name
        self.outcome = outcome

    def ping(self, beams: Beams, prior: Prior) -> Any:  # noqa: ANN401, ARG002
        """Whatever it is."""
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


EXAMPLE = "examples/own_method/partial_loose.py"


def short(duration_s: float, **change: Any) -> Scenario:  # noqa: ANN401 - whatever `with_overrides` takes
    """The straight scenario, for a while."""
    return load_scenario("straight").with_trajectory(duration_s=duration_s).with_overrides(**change)


def test_copies_are_what_they_copy(root: Path) -> None:
    """PLCF in Python to 1e-9, TC bit for bit, for every mask of two and more beams."""
    names = [own_method.load(f"{root / EXAMPLE}:PartialLoose"), own_method.register(TightCopy), "plcf", "tc"]
    batch = batch_along(30.0)
    for lost in ((), (0,), (2, 3), (0, 2), (0, 3), (1, 2, 3), (0, 1, 2, 3)):
        valid = np.ones_like(batch["schedule"]["beam_valid"])
        valid[..., list(lost)] = False
        schedule = batch["schedule"] | {"beam_valid": valid}
        found = kernel.run_batch(**(batch | {"schedule": schedule}), methods=names, runs=3, threads=2)
        for key in ("error", "sd", "nees", "nis_mean"):
            one, other = found[key][:, 0], found[key][:, 2]
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
            assert np.array_equal(found[key][:, 1], found[key][:, 3], equal_nan=True)
        assert np.array_equal(found["fixes_accepted"][:, 0], found["fixes_accepted"][:, 2])


def test_a_campaign_takes_it_under_its_name(root: Path, tmp_path: Path) -> None:
    """Paired with the rest; the configuration that is written down can be read again."""
    scenario = short(5.0, runs=2, methods=["tc", f"{root / EXAMPLE}:PartialLoose"])
    assert scenario.campaign.methods == ("tc", "my_partial_loose")
    assert Scenario.model_validate(scenario.model_dump()) == scenario
    results = run_campaign([scenario], tmp_path / "out", threads=1)
    assert results.runs["method"].unique().sort().to_list() == ["my_partial_loose", "tc"]
    alone = run_campaign([short(5.0, runs=2, methods=["tc"])], tmp_path / "alone", threads=1)
    paired = results.runs.filter(pl.col("method") == "tc")
    assert paired.equals(alone.runs)
    assert own_method.costs()["my_partial_loose"].pings >= 8


def test_the_fingerprint_follows_the_text(tmp_path: Path) -> None:
    """A changed class is another campaign."""
    file = tmp_path / "mine.py"
    prints = []
    for word in ("one", "two"):
        file.write_text(f"{CLASSES['good']}  # {word}\n")
        prints.append(build_simulation(short(5.0, methods=[f"{file}:Mine"])).fingerprint())
    assert prints[0] != prints[1]
    assert build_simulation(short(5.0)).fingerprint() not in prints


def test_it_navigates_live_and_in_a_log() -> None:
    """`Navigator` and `replay_log` end in the bits of tc."""
    name: Any = own_method.register(TightCopy)
    out = replayed(methods=("tc", name), smooth=True, threads=2)
    assert np.array_equal(out["velocity_p_mps"][0], out["velocity_p_mps"][1])
    assert np.array_equal(out["smoothed_sd"][0], out["smoothed_sd"][1])
    saved = []
    for method in ("tc", name):
        navigator = under_way(method=method)
        navigator.push_beams(
            2_000_000_000, np.full(4, 0.01), [True, True, False, False], sd_mps=np.full(4, 0.042)
        )
        saved.append(bottomlock.Navigator.load(navigator.save()).state()["velocity_p_mps"])
    assert np.array_equal(saved[0], saved[1])


def test_a_calibration_beside_it_is_refused() -> None:
    """The method sees the beams as stated: an estimated mounting would be left out without a word."""
    name = own_method.register(TightCopy)
    model = load_scenario("straight").kernel_model(9.8)
    options = bottomlock.Options(calibration=Calibration(clock_sd_s=0.1))
    start = bottomlock.InitialState(
        time_ns=0, position_t_m=[0, 0, 0], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[0, 0, 0]
    )
    with pytest.raises(
        KernelError, match=r"calibration is 0\.1, expected 0 \(none\) with a method of one's own"
    ):
        bottomlock.Navigator(bottomlock.BeamGeometry.janus(0.35), model, options, start, method=name)
    bottomlock.Navigator(bottomlock.BeamGeometry.janus(0.35), model, options, start, method="tc")


def made_here(gain: float) -> type[own_method.OwnMethod]:
    """A class that no other process can import."""

    class Local:
        name = "made_here"

        def ping(self, beams: Beams, prior: Prior) -> Rows:  # noqa: ARG002
            """Rows of `gain` times the residual."""
            return Rows(gain * np.asarray(beams.rows.residual), beams.rows.jacobian, beams.rows.noise)

    return Local


def test_a_class_is_taken_as_it_is(root: Path, tmp_path: Path) -> None:
    """By campaigns with the place of its file, and by the functions of arrays; a loaded one keeps its place."""
    scenario = short(5.0, runs=2, methods=["tc", TightCopy])
    assert scenario.campaign.methods == ("tc", "tight_copy")
    assert scenario.campaign.own_methods == (f"{TightCopy.__module__}:TightCopy",)
    assert short(5.0, runs=2, methods=["tc", "tight_copy"]) == scenario, "registered before by its class"
    assert load_scenario("straight").replace({"campaign.methods": [TightCopy]}).campaign.own_methods
    assert Scenario.model_validate(scenario.model_dump()) == scenario == scenario.with_overrides(runs=2)
    runs = run_campaign(scenario, tmp_path / "out", threads=1).runs.drop("method").partition_by("run")
    assert all(one[0].equals(one[1]) for one in runs)
    found = bottomlock.run_batch(**batch_along(3.0), methods=["tc", TightCopy], runs=1, threads=1)
    assert np.array_equal(found["error"][:, 0], found["error"][:, 1])
    place = f"{root / EXAMPLE}:PartialLoose"
    assert short(5.0, methods=[own_method.load(place)]).campaign.own_methods == (place,)
    assert Settings.model_validate({"methods": ["tc", TightCopy]}).methods == ("tc", "tight_copy")


def test_a_place_takes_its_name_back(tmp_path: Path) -> None:
    """A scenario that names the place runs its class, whatever was registered by that name in between."""
    (tmp_path / "mine.py").write_text(CLASSES["good"].replace("mine_too", "made_here"))
    place = f"{tmp_path / 'mine.py'}:Mine"
    nothing, rows = own_method.load(place), made_here(1.0)
    errors = [
        bottomlock.run_batch(**batch_along(3.0), methods=["ins", "tc", one], runs=1, threads=1)["error"]
        for one in (nothing, rows, place)
    ]
    for found, same in zip(errors, (0, 1, 0), strict=True):
        assert np.array_equal(found[:, 2], found[:, same])


def test_two_classes_of_one_name_in_a_campaign_are_refused(tmp_path: Path) -> None:
    """Chunks of both run side by side, and the kernel has one class of a name."""
    scenarios = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(CLASSES["good"])
        place = f"{tmp_path / folder / 'mine.py'}:Mine"
        scenarios.append(short(5.0, methods=["tc", place]).replace({"name": folder}))
    with pytest.raises(
        ScenarioError, match=r"scenario two: method 'mine_too' is .*two/mine\.py:Mine, and .*one/mine"
    ):
        run_campaign(scenarios, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_in_this_process_alone_runs_here_alone(tmp_path: Path) -> None:
    """Its runs are resumed with the very class; Dask refuses it before anything is written."""
    one, other = made_here(1.0), made_here(1.0)
    scenario = short(5.0, runs=1, methods=["tc", one])
    assert scenario.campaign.own_methods == ()
    first = run_campaign(scenario, tmp_path / "out", threads=1)
    again = run_campaign(short(5.0, runs=1, methods=["tc", one]), tmp_path / "out", threads=1)
    assert again.runs.equals(first.runs)
    with pytest.raises(OutputError, match="another configuration"):
        run_campaign(short(5.0, runs=1, methods=["tc", other]), tmp_path / "out", threads=1)
    for refused in (other, Returns("made_as_object", None)):
        alone = short(5.0, runs=1, methods=["tc", refused])
        with pytest.raises(
            ScenarioError,
            match=r"straight: method 'made_.*' is in this process alone, where Dask's workers do",
        ):
            run_campaign(alone, tmp_path / "dask", engine="dask", threads=1)
    assert not (tmp_path / "dask").exists()


SCRIPT = """
import sys
import bottomlock
print("started")
class Mine:
    name = "of_a_script"
    def ping(self, beams, prior):
        return beams.rows
scenario = bottomlock.load_scenario("straight").with_trajectory(duration_s=5.0)
scenario = scenario.with_overrides(runs=1, methods=["tc", Mine])
results = bottomlock.run_campaign(scenario, sys.argv[1], threads=1)
print(scenario.campaign.own_methods, results.manifest["configuration_hash"])
"""


def test_a_class_of_a_script_is_found_in_the_script(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The script is not run twice, and resumes its runs; what is not in a file's text is of that process alone."""
    (tmp_path / "mine.py").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)

    def run(start: Callable[..., object], name: str, *arguments: str) -> list[str]:
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        start(name, run_name="__main__")
        return capsys.readouterr().out.splitlines()

    first = run(runpy.run_path, "mine.py", "out")
    assert first[0] == "started"
    assert first[1].startswith(f"('{tmp_path.resolve() / 'mine.py'}:Mine',) ")
    assert run(partial(runpy.run_module, alter_sys=True), "mine", "out") == first
    (tmp_path / "first.py").write_text("import sys\nexec(sys.argv.pop(1))\n")
    fourth = run(runpy.run_path, "first.py", SCRIPT, "fourth")
    assert fourth[1].startswith("() "), "not in the text of first.py"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (int, "int has no name, expected a class attribute"),
        ([3], "3"),
        ("tc", r"methods is 'tc', expected a list of methods"),
        (TightCopy, r"methods is <class .*TightCopy'>, expected a list of methods"),
        ({"tc"}, r"methods is \{'tc'\}, expected a list of methods"),
    ],
)
def test_what_is_no_list_of_methods(wrong: Any, message: str) -> None:  # noqa: ANN401 - a wrong one
    """In a scenario, and where the kernel's functions take methods."""
    methods: Any = [wrong] if wrong is int else wrong
    with pytest.raises(ScenarioError, match=message):
        short(5.0, methods=methods)
    if wrong != [3]:
        with pytest.raises(KernelError, match=message):
            bottomlock.run_batch(**batch_along(3.0), methods=methods, runs=1, threads=1)


SKEWED = np.array([[1.0, 0.5], [0.0, 1.0]])
FAULTS: list[tuple[str, Any, str]] = [
    ("nan", Fix([np.nan, 0.0, 0.0], np.eye(3)), "velocity_p_mps at .* is not finite"),
    ("shape", Fix([0.0, 0.0], np.eye(3)), r"velocity_p_mps has shape \(2,\), expected \(3,\)"),
    ("negative", Fix([0.0, 0.0, 0.0], -np.eye(3)), "cov_m2ps2 at .* is not positive definite"),
    ("wide", Rows([0.0], np.zeros((1, 19)), [[1.0]]), r"jacobian has shape \(1, 19\), expected \(1, 20\)"),
    ("lopsided", Rows([0.0, 0.0], np.zeros((2, 20)), SKEWED), "noise at .* is not positive definite"),
    ("many", Rows(np.zeros(9), np.zeros((9, 20)), np.eye(9)), "rows: got 9, expected at most 8"),
    ("words", Fix(["a", "b", "c"], np.eye(3)), "velocity_p_mps has dtype"),
    ("array", np.zeros(3), "ping returned ndarray, expected Fix, Rows or None"),
    ("raises", ValueError("no fix\ntoday"), r"ValueError: no fix today \(test_own_method.py, line \d+\)"),
]


@pytest.mark.parametrize(("name", "outcome", "message"), FAULTS, ids=[one[0] for one in FAULTS])
def test_a_faulty_ping_is_named(name: str, outcome: object, message: str) -> None:
    """One line with run, method, time and class."""
    own_method.register(Returns(f"faulty_{name}", outcome))
    with pytest.raises(KernelError, match=message) as caught:
        kernel.run_batch(**batch_along(3.0), methods=[f"faulty_{name}"], runs=1, threads=1)
    text = str(caught.value)
    assert text.startswith(f"run 0, method faulty_{name}: faulty_{name} at 1000000000 ns: Returns: ")
    assert "\n" not in text


CLASSES = {
    "good": "class Mine:\n    name = 'mine_too'\n    def ping(self, beams, prior): return None",
    "unnamed": "class Mine:\n    def ping(self, beams, prior): return None",
    "taken": "class Mine:\n    name = 'tc'\n    def ping(self, beams, prior): return None",
    "odd": "class Mine:\n    name = 'My method'\n    def ping(self, beams, prior): return None",
    "mute": "class Mine:\n    name = 'mute'",
    "narrow": "class Mine:\n    name = 'narrow'\n    def ping(self, beams): return None",
    "needy": "class Mine:\n    name = 'needy'\n    def __init__(self, gain): pass\n    def ping(self, b, p): pass",
    "function": "def Mine(): pass",
    "broken": "import no_such_module_at_all",
    "syntax": "class Mine(:",
}
REFUSED = {
    "unnamed": "Mine has no name",
    "taken": "'tc', expected .* no built-in method",
    "odd": "'My method', expected",
    "mute": "Mine has no method ping",
    "narrow": r"Mine has no method ping\(self, beams, prior\)",
    "needy": "cannot be made without arguments",
    "function": "has no class Mine",
    "broken": "cannot be imported .ModuleNotFoundError",
    "syntax": "cannot be imported .SyntaxError",
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_method_is_refused_before_anything_runs(tmp_path: Path, kind: str) -> None:
    """In one line of the scenario, as any other wrong value."""
    (tmp_path / "mine.py").write_text(CLASSES[kind])
    with pytest.raises(ScenarioError, match=REFUSED[kind]) as caught:
        short(5.0, methods=[f"{tmp_path / 'mine.py'}:Mine"])
    assert "\n" not in str(caught.value)


def test_files_are_meant_from_the_scenario_and_from_the_case(root: Path, tmp_path: Path) -> None:
    """A scenario and a case name a class in a file beside them."""
    (tmp_path / "mine.py").write_text(CLASSES["good"])
    text = (root / "examples" / "own_method" / "scenario.toml").read_text(encoding="utf-8")
    text = text.replace("partial_loose.py:PartialLoose", "mine.py:Mine")
    scenario = parse_scenario(text, place="s.toml", folder=tmp_path)
    assert scenario.campaign.methods == ("tc", "plcf", "mine_too")
    section = {"methods": ["mine.py:Mine", "tc"]}
    assert checked(Settings, section, "case.toml: replay", tmp_path).methods == ("mine_too", "tc")


def test_the_page_shows_the_example(root: Path) -> None:
    """The class of the page is that of the file, less its docstrings."""
    page = (root / "docs" / "own_method.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    file = (root / EXAMPLE).read_text(encoding="utf-8")
    code = re.sub(r'^ *""".*?"""\n\n?', "", file, flags=re.DOTALL | re.MULTILINE)
    assert textwrap.dedent(shown).split() == code.split()
