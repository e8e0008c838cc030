"""`bottomlock bench`: make, run with a rival, check, score and page on two missions; resumed and refused."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.files.records import read_record, write_record
from bottomlock.tables.check import check
from partialdvl_bench import mission_list as lists
from partialdvl_bench.leaderboard import read_submissions
from partialdvl_bench.methods import estimate
from partialdvl_bench.mission import Estimates, Mission
from partialdvl_bench.mission_list import missions_of
from partialdvl_bench.tables import LEADERBOARD, SUBMISSION
from tests.cli.calls import command

RIVAL = "rival=tests.cli.test_bench:rival"


def rival(mission: Mission) -> Estimates:
    """A rival that is `tc` under another name, and sees no truth."""
    assert mission.truth is None
    return estimate(mission, "tc")


@pytest.fixture(scope="module", autouse=True)
def two_missions() -> Iterator[None]:
    """The list has two missions of the validation split and one of the test split."""
    whole = lists._content()
    short = [row for row in whole["missions"] if row[-1] == 250.0]
    kept = [row for row in short if row[0] == "validation"][:2] + [row for row in short if row[0] == "test"][
        :1
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lists, "_content", lambda: whole | {"missions": kept})
        lists.mission_list.cache_clear()
        yield
    lists.mission_list.cache_clear()


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The two missions of the validation split, whose digests are the published ones."""
    out = tmp_path_factory.mktemp("data")
    done = command("bench", "make", "--out", out, "--split", "validation")
    assert done.returncode == 0, done.stderr
    assert "all digests are the published ones" in done.stdout
    return out


@pytest.fixture(scope="module")
def submissions(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Submissions of two methods of ours and a rival, in two shards."""
    out = tmp_path_factory.mktemp("run")
    for shard, ran, written in (("1/2", 3, 0), ("2/2", 3, 3)):
        done = command(
            "bench",
            "run",
            "--data",
            data,
            "--out",
            out,
            "--methods",
            "tc,ins",
            "--rival",
            RIVAL,
            "--shard",
            shard,
        )
        assert done.returncode == 0, done.stderr
        assert f"{ran} of 6 run" in done.stdout
        assert f"{written} submissions" in done.stdout
    return out


@pytest.mark.long
def test_a_second_run_keeps_what_is_there_and_a_damaged_part_is_run_again(
    data: Path, submissions: Path
) -> None:
    words = ("bench", "run", "--data", data, "--out", submissions, "--methods", "tc,ins", "--rival", RIVAL)
    assert "0 of 6 run" in command(*words).stdout
    before = (submissions / "tc.parquet").read_bytes()
    next((submissions / "missions" / "tc").glob("*.record.json")).unlink()
    assert "1 of 6 run" in command(*words).stdout
    same = [name for name in SUBMISSION if name != "wall_s"]
    again = pl.read_parquet(submissions / "tc.parquet").select(same)
    assert again.equals(pl.read_parquet(before).select(same))
    path = next((submissions / "missions" / "tc").glob("*.record.json"))
    record = read_record(path)
    assert record is not None
    write_record(path, record | {"key": "of other data"}, record["digests"])
    done = command(*words)
    assert done.returncode == 2
    assert (
        "holds estimates of other data, another version or another source; choose another directory"
        in done.stderr
    )
    assert "1 of 6 run" in command(*words, "--force").stdout
    (submissions / "tc.parquet").write_bytes(b"mine")
    assert "tc.parquet: has changed since it was written" in command(*words).stderr
    assert command(*words, "--force").returncode == 0


def test_check_score_and_page(data: Path, submissions: Path, tmp_path: Path) -> None:
    checked = command("bench", "check", submissions / "tc.parquet", "--tum", tmp_path / "tum")
    assert checked.returncode == 0, checked.stderr
    assert "500 rows of 2 missions keep the rules" in " ".join(checked.stdout.split())
    assert len(list((tmp_path / "tum").iterdir())) == 2
    assert command("bench", "beams", "--data", data, "--out", submissions).returncode == 0
    files = sorted(submissions.glob("*.parquet"))
    scored = command("bench", "score", *files, "--data", data, "--out", tmp_path / "scores.parquet")
    assert scored.returncode == 0, scored.stderr
    assert "missions of the split" not in scored.stdout
    for task in ("overall", "T1", "T2", "T3", "T4", "T5"):
        assert task in scored.stdout
    made = command("bench", "page", tmp_path / "scores.parquet", "--out", tmp_path / "page")
    assert made.returncode == 0, made.stderr
    table = check(
        pl.read_parquet(tmp_path / "page" / "leaderboard.parquet"), LEADERBOARD, place="leaderboard"
    )
    ours, theirs = (
        table.filter((pl.col("method") == name) & (pl.col("score") == "nats a component"))["value"].to_list()
        for name in ("tc", "rival")
    )
    assert ours == theirs
    page = (tmp_path / "page" / "leaderboard.html").read_text()
    assert "http" not in page.replace("http://www.w3.org", "").replace("http-equiv=", "")
    assert page.count("<figure>") == 6
    assert page.count("<svg") == page.count("</svg>")
    refused: tuple[tuple[str | Path, ...], ...] = (
        ("check", submissions / "tc.parquet", "--tum", tmp_path / "tum"),
        ("beams", "--data", data, "--out", submissions),
        ("score", *files, "--data", data, "--out", tmp_path / "scores.parquet"),
        ("score", files[0], "--data", data, "--out", files[0], "--force"),
        ("make", "--out", tmp_path / "m", "--write-digests", tmp_path / "scores.parquet"),
        ("page", tmp_path / "scores.parquet", "--out", tmp_path / "page", "--reference", "tc"),
        ("page", tmp_path / "scores.parquet", "--out", tmp_path / "tum"),
    )
    for words in refused:
        done = command("bench", *words)
        assert done.returncode == 2, words
        assert "--force" in done.stderr or "is read by this command" in done.stderr
    assert not (tmp_path / "m").exists()


def test_a_part_of_a_split_is_scored_as_such(data: Path, submissions: Path, tmp_path: Path) -> None:
    """By --missions, or where the others are not made; a submission that lacks what is there is refused."""
    first, second = sorted(path.name for path in (data / "validation").iterdir())
    few = tmp_path / "tc.parquet"
    pl.read_parquet(submissions / "tc.parquet").filter(pl.col("mission") == first).write_parquet(few)
    refused = command("bench", "score", few, "--data", data)
    assert refused.returncode == 2
    assert f"lacks 1 missions of the split validation, the first is '{second}'" in refused.stderr
    assert "--missions" in refused.stderr
    (tmp_path / "data" / "validation").mkdir(parents=True)
    (tmp_path / "data" / "validation" / first).symlink_to(data / "validation" / first)
    for words in (("--data", data, "--missions", first), ("--data", tmp_path / "data")):
        scored = command("bench", "score", few, *words)
        assert scored.returncode == 0, scored.stderr
        assert "scored 1 of 2 missions of the split validation, version 1: no result" in scored.stdout
        assert "T2" in scored.stdout
    unknown = command("bench", "score", few, "--data", tmp_path / "data", "--reference", "tcc")
    assert (unknown.returncode, unknown.stdout) == (2, "")
    assert "--reference is 'tcc', did you mean 'tc'?" in unknown.stderr
    with pytest.raises(DataError, match="answers none of the 1 missions"):
        read_submissions([str(few)], list(missions_of(("test",))))
    other = command("bench", "score", few, "--data", data, "--missions", second)
    assert other.returncode == 2
    assert "lacks 1 missions" in other.stderr


def test_a_bad_submission_is_refused_with_row_and_column(submissions: Path, tmp_path: Path) -> None:
    frame = pl.read_parquet(submissions / "tc.parquet")
    bad = tmp_path / "bad.parquet"
    frame.with_columns(cov_surge_surge_m2ps2=-pl.col("cov_surge_surge_m2ps2")).write_parquet(bad)
    done = command("bench", "check", bad)
    assert done.returncode == 2
    assert "row 1, column 'cov_surge_surge_m2ps2'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_test_split_needs_the_sealed_seed_and_its_truth_stands_apart(tmp_path: Path) -> None:
    out = tmp_path / "data"
    refused = command("bench", "make", "--out", out, "--split", "test")
    assert refused.returncode == 2
    assert "--seed-file" in refused.stderr
    seed = tmp_path / "seed.txt"
    seed.write_text("77")
    other = command("bench", "make", "--out", out, "--split", "test", "--seed-file", seed)
    assert other.returncode == 2
    assert "1 of 1 missions have other digests than those published" in other.stderr
    assert [path.name for path in (out / "test").rglob("truth*")] == []
    assert [path.name for path in (out / "sealed").rglob("*.parquet")] == ["truth.parquet"]


def test_the_seed_file_is_all_that_scoring_the_sealed_split_needs(tmp_path: Path) -> None:
    """Version 1.1: refused without it; with it made, flown, and scored where the truth is not there."""
    name = "bluerov2_heavy-tactical-flat-inshore-three_beams-markov-gaussian-box-250s"
    data, seed, out = tmp_path / "data", tmp_path / "seed.txt", tmp_path / "run"
    words = ("--version", "1.1", "--missions", name)
    refused = command("bench", "make", "--out", data, "--split", "test", *words)
    assert refused.returncode == 2
    assert (
        "the test split of version 1.1 is made from a sealed seed, which is not in the package"
        in refused.stderr
    )
    assert not data.exists()
    sealed = command("bench", "seal", "--out", seed)
    committed = sealed.stdout.split('"')[3]
    assert len(committed) == 64
    assert command("bench", "seal", "--out", seed).returncode == 2
    made = command("bench", "make", "--out", data, "--split", "test", "--seed-file", seed, *words)
    assert made.returncode == 0, made.stderr
    assert f"this seed's is {committed}" in made.stdout
    assert "1 missions have no published digests yet" in made.stdout
    assert command("bench", "run", "--data", data, "--out", out, "--methods", "tc", *words).returncode == 0
    shutil.rmtree(data / "sealed")
    score = ("bench", "score", out / "tc.parquet", "--data", data, *words)
    assert "has no truth here: it is sealed" in command(*score).stderr
    scored = command(*score, "--seed-file", seed)
    assert scored.returncode == 0, scored.stderr
    assert "T2 navigation" in scored.stdout
    other = tmp_path / "other.txt"
    other.write_text("77")
    assert "differs in: seed or version" in command(*score, "--seed-file", other).stderr


def test_list_and_absent_missions(tmp_path: Path) -> None:
    assert "validation" in command("bench", "list").stdout
    absent = command("bench", "run", "--data", tmp_path, "--out", tmp_path / "run")
    assert absent.returncode == 2
    assert "holds none of these missions of version 1;" in absent.stderr


def test_a_later_version_is_made_on_request(tmp_path: Path) -> None:
    name = "tauv-mems-magnetic-flat-steady-janus30-fish-gaussian-zigzag-250s"
    out = tmp_path / "data"
    words = ("--out", out, "--split", "validation", "--missions", name)
    done = command("bench", "make", "--version", "1.1", *words)
    assert done.returncode == 0, done.stderr
    assert "all digests are the published ones" in done.stdout
    run = ("bench", "run", "--data", out, "--out", tmp_path / "run", "--methods", "tc,dead_reckoning")
    assert "of version 1;" in command(*run).stderr
    assert "2 of 2 run" in command(*run, "--version", "1.1").stdout
    refused = command("bench", "run", "--data", out, "--out", tmp_path / "run", "--version", "3")
    assert "no version is called '3' (known: 1, 1.1, 1.2)" in refused.stderr
