"""`bottomlock tune`: a case with wrong noise becomes one with the noise of its recording, key by key."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.calls import command, refused, succeeded
from tests.statistical.tune_logs import ACCEL_KEY, BEAM_KEY, GYRO_KEY, Dive, case_values, dive, write_case

WRONG = {ACCEL_KEY: 10.0, GYRO_KEY: 0.1, BEAM_KEY: 3.0}


@pytest.fixture(scope="module")
def known() -> Dive:
    """A dive with known noise, of which the first 420 s are tuned on."""
    return dive(5, seconds=840.0)


@pytest.fixture(scope="module")
def folder(known: Dive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case with wrong noise, of an editor on Windows, tuned by the command."""
    folder = tmp_path_factory.mktemp("tune")
    write_case(folder, known, WRONG)
    path = folder / "case.toml"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    succeeded("tune", folder / "case.toml")
    return folder


def value(content: dict[str, Any], key: str) -> float:
    """A number of a TOML file by its key with dots."""
    for name in key.split("."):
        content = content[name]
    return float(content)  # type: ignore[arg-type]


def test_the_noise_is_that_of_the_recording(folder: Path, known: Dive) -> None:
    """Ten times too much, ten times too little and three times too much are mended to within three claimed sigma."""
    tuned = tomllib.loads((folder / "case_tuned.toml").read_text(encoding="utf-8"))
    record = json.loads((folder / "case_tuned.json").read_text(encoding="utf-8"))
    found = {one["key"]: one for one in record["parameters"]}
    assert record["is_better"]
    assert record["gain"] > 3.0 * record["gain_sd"] > 0.0
    for key, true in case_values(known.noise).items():
        sd = found[key]["sd"] / found[key]["value"]
        assert abs(np.log(value(tuned, key) / true)) < 3.0 * sd < 1.5, key
        assert abs(np.log(WRONG[key])) > 3.0 * sd


def test_the_case_is_edited_key_by_key(folder: Path) -> None:
    """Other lines, their ends and comments stay; each new value has its sigma, old value and gain beside it."""
    tuned = (folder / "case_tuned.toml").read_bytes()
    assert tuned.count(b"\r\n") == tuned.count(b"\n") > 10
    assert b"\r\r" not in tuned
    old = (folder / "case.toml").read_text(encoding="utf-8").splitlines()
    new = (folder / "case_tuned.toml").read_text(encoding="utf-8").splitlines()
    noise = [line for line in new if line.startswith("accel_noise_mps_per_rt_h")]
    assert len(noise) == 1
    assert "# tuned: ± " in noise[0]
    assert ", was 1.2, log-likelihood gain " in noise[0]
    assert noise[0].endswith(" | guessed")
    assert [line for line in old if line not in new] == [
        line for line in old if line.partition(" =")[0] in {key.rpartition(".")[2] for key in WRONG}
    ]
    # A walk that the recording does not determine is not written, and the reference's scatter is not tuned at all.
    record = json.loads((folder / "case_tuned.json").read_text(encoding="utf-8"))
    for one in record["parameters"]:
        if not one["is_determined"]:
            assert one["value"] == one["old"]
            assert not any(
                line.startswith(one["key"].rpartition(".")[2] + " =") for line in new if line not in old
            )
    assert not any(one["key"].startswith("attitude.") for one in record["parameters"])


def test_predictions_come_true_on_the_rest(folder: Path) -> None:
    """Beams over outages and one step ahead: error/σ about 1."""
    record = json.loads((folder / "case_tuned.json").read_text(encoding="utf-8"))
    terms = [term for term in record["terms"] if term["values"] == "new"]
    for term in terms:
        assert 0.7 < term["error_over_sd"] < 1.4, term
    assert {(term["sensor"], term["horizon_s"]) for term in terms} == {
        ("attitude", 0.0), ("beams", 0.0), ("beams", 10.0), ("beams", 30.0),
    }  # fmt: skip


def test_nothing_is_overwritten(folder: Path) -> None:
    """The case itself never, a tuned one with --force alone; another folder would lose the case's files."""
    for out, words in (
        ("case_tuned.toml", "is there already"),
        ("case.toml", "is read by this command"),
        ("tuned.txt", "expected a name that ends in .toml"),
    ):
        done = command("tune", folder / "case.toml", "--out", folder / out)
        assert done.returncode == 2
        assert words in done.stderr
    said = refused("tune", folder / "case.toml", "--out", folder.parent / "tuned.toml")
    assert "same folder" in said


def test_what_cannot_be_tuned_says_so(folder: Path) -> None:
    """A recording that is too short, and a fraction that leaves nothing to judge on."""
    text = (folder / "case.toml").read_text(encoding="utf-8")
    (folder / "short.toml").write_text(text + "duration_s = 100.0\n", encoding="utf-8")
    said = refused("tune", folder / "short.toml")
    assert "last 49 s, expected 80 s or more" in said
    done = command("tune", folder / "case.toml", "--fraction", "1.0", "--out", folder / "other.toml")
    assert done.returncode == 2
    assert "fraction is 1, expected 0.2 to 0.8" in done.stderr
