"""Can I trust this: agreement with dead reckoning at a stated false alarm, NIS under weights, sway, answers."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.stats import norm

from bottomlock.files.replay_tables import ReplayTables
from bottomlock.kernel.models import Robust
from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.case import load_case
from bottomlock.replay.findings.innovations import Innovations, least_ratio, no_fix, weight
from bottomlock.replay.findings.limits import FALSE_ALARM, LIMIT, TIMES
from bottomlock.replay.findings.sensors import SensorRow
from bottomlock.replay.findings.sway import Sway, _own
from bottomlock.replay.findings.tracks import Agreement, Reference, against_reference, agreements
from bottomlock.replay.findings.trust import Evidence
from bottomlock.replay.findings.verdict import answer_of
from bottomlock.replay.run import replay_case
from tests.dive import drawn_dive
from tests.dive_logs import write_case

SEEN = Innovations("tc", 500, 0.0, 3.0, 3.5, 2.0, 4.0)
NEAR = Agreement("tc", 0.5, 0.4, 0.6, 1.0, 1.0, nan, nan)
AGREES, DISAGREES = Reference("tc", 2.0, 1.0, 0.9), Reference("tc", 9.0, 2.6, 1.5)
FAR = Agreement("tc", 912.0, 38.0, 90.0, 20.0, 5.0, nan, nan)


UNKNOWN = {f"err_position_{axis}_m": pl.Float64() for axis in ("north", "east")}


def tracks(seed: int, off: float, sd: float = 2.0) -> pl.DataFrame:
    """Two tracks whose errors are first-order walks of the claimed σ, and `off` σ of both apart at the end."""
    rng, rows = np.random.default_rng(seed), 300
    parts = []
    for number, method in enumerate(("tc", METHOD)):
        error = sd * rng.normal(size=2) * np.ones((rows, 2))
        shift = number * off * np.sqrt(2.0) * sd * np.linspace(0.0, 1.0, rows)[:, None]
        place = error + shift
        columns: dict[str, object] = {"pass": ["forward"] * rows, "method": [method] * rows}
        for k, axis in enumerate(("north", "east")):
            columns[f"{axis}_m"] = place[:, k]
            columns[f"sd_position_{axis}_m"] = np.full(rows, sd)
            columns[f"err_position_{axis}_m"] = [None] * rows
        parts.append(pl.DataFrame(columns, schema_overrides=UNKNOWN))
    return pl.concat(parts)


def test_right_claims_are_no_departure() -> None:
    """500 pairs of tracks with errors of the claimed size: at a false alarm of 1e-4 each, one in 20 repeats has any."""
    assert not any(agreements(tracks(seed, 0.0), ["tc"])[0].leaves for seed in range(500))
    assert 2.0 * norm.sf(LIMIT) * TIMES * 2 == pytest.approx(FALSE_ALARM)


def test_a_departure_beyond_both_claims_is_one() -> None:
    assert all(agreements(tracks(seed, 12.0), ["tc"])[0].leaves for seed in range(20))


def test_a_method_that_claims_nothing_is_lost() -> None:
    one = Agreement("tc", 700.0, 1.1, 100.0, 1e6, 7.0, nan, nan)
    assert one.lost
    assert not one.leaves
    assert not Agreement("tc", 3.0, 1.1, 2.0, 1e6, 7.0, nan, nan).lost


@pytest.mark.parametrize(
    ("sd_m", "reckoned_sd_m", "rms_m", "reference_sd_m", "worse"),
    [
        (1.0, 1.0, 9.0, 0.0, True),
        (9.0, 1.0, 9.0, 0.0, False),
        (1.0, 9.0, 9.0, 0.0, False),
        (1.0, 1.0, 9.0, 9.0, False),
        (1.0, 1.0, 3.6, 0.0, False),
    ],
)
def test_the_reference_judges_both(
    sd_m: float, reckoned_sd_m: float, rms_m: float, reference_sd_m: float, worse: bool
) -> None:
    """Worse by a quarter is worse only where neither claim nor the reference's noise explains the difference."""
    assert Agreement("tc", 9.0, 1.0, 1.0, sd_m, reckoned_sd_m, rms_m, 3.0, reference_sd_m).worse is worse


@pytest.mark.parametrize("robust", [Robust(), Robust(student_t_degrees=2.0)])
def test_nis_of_noise_as_claimed_under_weights(robust: Robust) -> None:
    """The integral against draws; and Gaussian updates have one."""
    z = np.random.default_rng(1).normal(size=200_000)
    drawn = float(np.mean([zz * zz * weight(robust, zz) for zz in z[:50_000]]))
    assert least_ratio(robust) == pytest.approx(drawn, rel=0.02)
    assert least_ratio(Robust(tail="gaussian")) == least_ratio(None) == 1.0


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> ReplayTables:
    return replay_case(load_case(write_case(drawn_dive(21), tmp_path_factory.mktemp("dive"))))


def test_a_right_dive_with_student_t_is_in_the_band(replayed: ReplayTables) -> None:
    """Its NIS is below the band of Gaussian noise, and not low."""
    rows = replayed.innovations.filter((pl.col("method") == "tc") & pl.col("nis").is_not_null())
    ratio = rows["nis"].to_numpy().mean() / rows["degrees"].to_numpy().mean()
    assert least_ratio(Robust()) * 0.9 < ratio < 0.9
    assert replayed.manifest["answer"]["verdict"] == "yes"


def evidence(**changes: object) -> Evidence:
    whole: dict[str, object] = {
        "causes": (), "further": (), "seen": SEEN, "closure": "",
        "agreements": (NEAR,), "reckoned": True, "aided": False, "reference": None, "sway": None,
        "partial": 0.0, "methods": ("tc", "sway_current"), "sensors": (),
        "sd_m": {"tc": 1.0, "sway_current": 1.0, METHOD: 1.0}, "way_m": 500.0, "reach_m": 100.0, "projected": False,
    }  # fmt: skip
    return Evidence(**(whole | changes))  # type: ignore[arg-type]


UNIT = Finding("gyro_unit", "fault", 1.0, "The unit is wrong.", "", "Set it.", "imu.omega_unit")
TILT = Finding("beam_order", "fault", 1.0, "The order is wrong.", "", "Change it.", "dvl.geometry")
NOISY = Finding("beam_noise", "warning", 1.0, "The beams are noisy.", "", "Claim more.", "dvl.beam_noise_mps")


SIGN = Finding("gyro_sign", "fault", 1.0, "The sign is wrong.", "", "Change it.", "imu.axes")


BOTH_OFF = Agreement("tc", 912.0, 38.0, 90.0, 20.0, 5.0, 300.0, 290.0)
"""The reference contradicts dead reckoning, too."""


@pytest.mark.parametrize(
    ("cause", "agreement", "method"),
    [(UNIT, FAR, METHOD), (TILT, FAR, ""), (SIGN, FAR, ""), (UNIT, BOTH_OFF, "")],
)
def test_no_begins_with_the_cause(cause: Finding, agreement: Agreement, method: str) -> None:
    """Dead reckoning is the answer where the cause is not one of its own, and no reference contradicts it."""
    answer = answer_of(evidence(causes=(cause,), agreements=(agreement,)))
    assert (answer.verdict, answer.sentence, answer.change, answer.method) == (
        "no", cause.text, cause.hint, method
    )  # fmt: skip
    assert "38.0 times what both claim" in answer.numbers[1]


def test_partly_for_a_doubt_and_where_nothing_confirms() -> None:
    assert answer_of(evidence(causes=(NOISY,))).verdict == "partly"
    alone = answer_of(evidence(agreements=(), reckoned=False))
    assert (alone.verdict, "nothing else confirms" in alone.sentence) == ("partly", True)
    near = replace(AGREES, rms_m=2.6, sd_m=0.8)
    assert answer_of(evidence(agreements=(), reckoned=False, reference=near)).verdict == "yes"
    assert "80 % of the pings" in answer_of(evidence(agreements=(), reckoned=False, partial=0.8)).sentence


@pytest.mark.parametrize(
    ("rms_mps", "partial", "method"),
    [(0.01, 0.5, "sway_current"), (0.3, 0.5, "tc"), (0.01, 0.0, "tc")],
)
def test_the_method_fits_vehicle_and_beams(rms_mps: float, partial: float, method: str) -> None:
    """An assumption on the sway is taken where pings lack beams and complete ones do not contradict it."""
    sway = Sway(rms_mps, 20.0, 0.05, 1.0, 0.02, 5.0)
    answer = answer_of(evidence(sway=sway, partial=partial))
    assert (answer.method, sway.fits) == (method, rms_mps < 0.04)
    assert ("does not fit" in answer.vehicle) is not sway.fits


def test_a_method_that_the_reference_beats_is_not_recommended() -> None:
    """RMS of tc 9 m, of dead reckoning 3 m, within what tc claims: another filter, or the attitude that is unused."""
    beaten = Agreement("tc", 9.0, 1.0, 1.0, 9.0, 4.0, 9.0, 3.0)
    good = Agreement("info", 1.0, 1.0, 1.0, 9.0, 4.0, 3.1, 3.0)
    assert answer_of(evidence(agreements=(beaten, good), methods=("tc", "info"))).method == "info"
    alone = answer_of(evidence(agreements=(beaten,), methods=("tc",)))
    assert (alone.verdict, alone.method, "attitude.aids" in alone.change) == ("yes", METHOD, True)
    for still in (
        replace(beaten, rms_m=12.0, reckoned_rms_m=8.0, reckoned_sd_m=3.1),
        replace(beaten, rms_m=3.1),
    ):
        assert answer_of(evidence(agreements=(still,), methods=("tc",))).method == "tc"
    assert answer_of(evidence(agreements=(beaten,), methods=("tc",), way_m=2000.0)).method == "tc"
    assert answer_of(evidence(agreements=(beaten,), methods=("tc",), aided=True)).change == "Nothing."


OPEN_KEYS = ("dvl.geometry", "dvl.mounting_pitch_deg", "attitude.yaw_offset_deg", "dvl.velocity_unit")
WORSE = Agreement("tc", 9.0, 1.0, 1.0, 1.0, 1.0, 9.0, 3.0)
VAGUE = Agreement("tc", 0.5, 0.1, 0.6, 3.1, 1.0, nan, nan)


@pytest.mark.parametrize(
    ("changes", "method"),
    [
        ({"agreements": (WORSE,), "methods": ("tc",), "reference": AGREES}, METHOD),
        ({"agreements": (VAGUE,), "methods": ("tc",), "sd_m": {"tc": 3.1}}, METHOD),
        ({"way_m": 0.9}, "tc"),
        ({"agreements": (), "reckoned": False, "reference": AGREES, "way_m": 0.9}, "tc"),
        *(({"assumed": (one,)}, "tc") for one in OPEN_KEYS),
        ({"agreements": (), "reckoned": False, "reference": replace(AGREES, rms_m=2.6)}, "tc"),
        ({"reference": DISAGREES}, "tc"),
        ({"reference": Reference("tc", 2.0, 1.0, 2.1)}, "tc"),
    ],
)
def test_each_rule_keeps_an_answer_from_yes(changes: dict[str, object], method: str) -> None:
    """Worse than dead reckoning, 1 sigma of no use by it or by the distance, beams that nothing confirms."""
    answer = answer_of(evidence(**changes))
    assert (answer.verdict, answer.method) == ("partly", method)
    assert answer.change not in {"", "Nothing."}


@pytest.mark.parametrize(
    ("rms_m", "reckoned_rms_m", "verdict", "method"),
    [
        (3.9, 16.1, "partly", "tc"),
        (nan, nan, "no", METHOD),
        (16.1, 3.0, "no", METHOD),
        (16.1, 16.1, "no", ""),
        (14.0, 20.0, "no", ""),
    ],
)
def test_a_reference_that_confirms_the_method_alone_clears_it(
    rms_m: float, reckoned_rms_m: float, verdict: str, method: str
) -> None:
    """A compass that stood still: dead reckoning is 29 m away, and wrong. It is never taken where it is."""
    apart = Agreement("tc", 29.0, 6.9, 20.0, 4.0, 1.0, rms_m, reckoned_rms_m, 1.4)
    answer = answer_of(evidence(agreements=(apart,), methods=("tc",), reference=AGREES))
    assert (answer.verdict, answer.method) == (verdict, method)
    assert (METHOD in answer.change) == (method == METHOD)


UNEXPLAINED = Finding("unexplained", "fault", 1.0, "Nothing explains it.", "", "Check.", "")
APART = Agreement("tc", 2.0, 1.6, 2.0, 1.0, 1.0, nan, nan)


@pytest.mark.parametrize(
    ("cause", "agreement", "reference", "verdict"),
    [
        (UNIT, NEAR, None, "partly"),
        (UNIT, APART, None, "no"),
        (UNIT, NEAR, AGREES, "partly"),
        (UNIT, NEAR, DISAGREES, "no"),
        (replace(TILT, kind="scale", size=0.024), NEAR, None, "partly"),
        (replace(TILT, kind="scale", size=0.026), NEAR, None, "no"),
        (replace(TILT, kind="scale", size=0.026), NEAR, AGREES, "partly"),
        (replace(TILT, kind="depth_scale"), NEAR, AGREES, "no"),
        (UNEXPLAINED, NEAR, AGREES, "yes"),
        (UNEXPLAINED, NEAR, None, "partly"),
    ],
)
def test_a_mistake_that_has_not_moved_the_track_is_a_doubt(
    cause: Finding, agreement: Agreement, reference: Reference | None, verdict: str
) -> None:
    """A "no" needs a track that is off: from dead reckoning, or from the reference."""
    found = answer_of(evidence(causes=(cause,), agreements=(agreement,), reference=reference))
    assert found.verdict == verdict


def test_a_mistake_is_held_against_the_claim_of_the_track_to_take() -> None:
    """A filter that claims next to nothing excuses no scale of dead reckoning, which is taken in its place."""
    cause, vague = replace(TILT, kind="scale", size=0.1), replace(NEAR, sd_m=30.0)
    claims = {"tc": 30.0, METHOD: 1.0}
    found = answer_of(evidence(causes=(cause,), agreements=(vague,), methods=("tc",), sd_m=claims))
    assert (found.verdict, found.method) == ("no", "")


def test_claims_that_the_reference_refutes_are_a_no() -> None:
    """Where dead reckoning is nearer to it; else a doubt."""
    claims = Finding("claims", "warning", 1.0, "The error is 5 times the claimed 1 sigma.", "", "Check.", "")
    for agreement, verdict in ((WORSE, "no"), (NEAR, "partly")):
        found = answer_of(evidence(agreements=(agreement,), further=(claims,), reference=DISAGREES))
        assert found.verdict == verdict


def test_two_claims_add_as_squares() -> None:
    """By hand: 10 m apart in the north, 1 sigma of 3 and 4 m."""
    parts = []
    for method, sd, place in (("tc", 3.0, 10.0), (METHOD, 4.0, 0.0)):
        columns: dict[str, object] = {"pass": ["forward"] * 30, "method": [method] * 30}
        for axis, at in (("north", place), ("east", 0.0)):
            columns |= {f"{axis}_m": [at] * 30, f"sd_position_{axis}_m": [sd] * 30}
            columns[f"err_position_{axis}_m"] = [None] * 30
        parts.append(pl.DataFrame(columns, schema_overrides=UNKNOWN))
    (found,) = agreements(pl.concat(parts), ["tc"])
    assert found.sigmas == pytest.approx(2.0)
    assert found.own_sigmas == pytest.approx(2.5)


def test_the_reference_at_the_end_and_over_time() -> None:
    """By hand: 3 m and 4 m off at the end, 1 sigma of 3 and 4 m, a reference of 5/sqrt(2) m an axis."""
    rows = 4
    off = np.array([[9.0, 9.0], [0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    columns: dict[str, object] = {"pass": ["forward"] * rows, "method": ["tc"] * rows, "time_ns": range(rows)}
    for k, axis in enumerate(("north", "east")):
        columns[f"err_position_{axis}_m"] = off[:, k]
        columns[f"sd_position_{axis}_m"] = [3.0 + k] * rows
    found = against_reference(pl.DataFrame(columns), "tc", 5.0 / np.sqrt(2.0))
    assert found is not None
    assert found.end_m == pytest.approx(5.0)
    assert found.end_sigmas == pytest.approx(5.0 / np.hypot(5.0, 5.0))
    # The first row is the start itself: 0, 3, 3 in the north and 0, 0, 4 in the east.
    squares = 18.0 / (3.0**2 + 12.5) + 16.0 / (4.0**2 + 12.5)
    assert found.rms_sigmas == pytest.approx(np.sqrt(squares / 6.0))
    assert (found.rms_m, found.sd_m) == pytest.approx((np.sqrt((9.0 + 25.0) / 3.0), 5.0))


@pytest.mark.parametrize(("last", "confirms"), [(79, False), (90, True)])
def test_positions_that_end_early_confirm_nothing(last: int, confirms: bool) -> None:
    """A receiver at the surface before the dive; up to the last sixth of it, it tells of the dive."""
    off = pl.Series(np.where(np.arange(100) <= last, 0.5, np.nan)).fill_nan(None)
    columns: dict[str, object] = {"pass": ["forward"] * 100, "method": ["tc"] * 100, "time_ns": range(100)}
    for axis in ("north", "east"):
        columns |= {f"err_position_{axis}_m": off, f"sd_position_{axis}_m": [1.0] * 100}
    found = against_reference(pl.DataFrame(columns), "tc", 1.0)
    assert found is not None
    assert found.agrees
    assert found.confirms == confirms


def test_a_reference_confirms_what_is_open() -> None:
    """And no geometry moves the velocity that beams are projected from."""
    assert answer_of(evidence(assumed=OPEN_KEYS, reference=AGREES)).verdict == "yes"
    assert answer_of(evidence(assumed=OPEN_KEYS[:1], projected=True)).verdict == "yes"


def test_beams_of_a_guessed_geometry_without_positions_are_in_doubt(tmp_path: Path) -> None:
    path = write_case(drawn_dive(21, seconds=120.0), tmp_path)
    before, rest = path.read_text(encoding="utf-8").split("[reference]")
    text = before + rest[rest.index("[start]") :].replace('position = "reference"', 'position = "given"')
    text = text.replace("position_sd_m = [0.1, 0.1, 0.1]", "position_sd_m = [0.1, 0.1, 5.0]")
    path.write_text(text.replace("[origin]", 'assumed = ["dvl.geometry"]\n[origin]', 1), encoding="utf-8")
    answer = replay_case(load_case(path)).manifest["answer"]
    assert (answer["verdict"], answer["method"]) == ("partly", "tc")
    assert (answer["assumed"], "assumed" in answer["change"]) == (["dvl.geometry"], True)


@pytest.mark.parametrize("beaten", [NEAR, WORSE, VAGUE, FAR])
def test_free_inertial_navigation_is_never_recommended(beaten: Agreement) -> None:
    methods = ("ins", "tc")
    assert answer_of(evidence(agreements=(beaten,), methods=methods)).method in {"tc", METHOD}
    assert answer_of(evidence(agreements=(), reckoned=False, methods=("ins",))).method == ""


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({"nis": 1.0}, "yes"),
        ({"nis": 5.1, "degrees": 3.5}, "yes"),
        ({"nis": 5.3, "degrees": 3.5}, "partly"),
        ({"nis": 8.8, "degrees": 3.5}, "no"),
        ({"rejected": 0.04}, "yes"),
        ({"rejected": 0.05}, "partly"),
        ({"rejected": 0.16}, "no"),
    ],
)
def test_what_the_innovations_say(changes: dict[str, Any], verdict: str) -> None:
    """A low NIS is no doubt; from 1.5 times its degrees or 4 % rejected it is one, from 2.5 and 15 % a "no"."""
    answer = answer_of(evidence(seen=replace(SEEN, **changes)))
    assert (answer.verdict, answer.method) == (verdict, METHOD if verdict == "no" else "tc")


def test_without_a_fix_nothing_is_tested() -> None:
    """Not even where dead reckoning, which the methods are then, is near."""
    answer = answer_of(evidence(seen=None, causes=(no_fix(),)))
    assert (answer.verdict, answer.sentence, answer.method) == ("no", no_fix().text, METHOD)


@pytest.mark.parametrize(("sd", "time_s"), [(0.2, 20.0), (0.05, 5.0)])
def test_the_sway_is_measured_through_the_noise(sd: float, time_s: float) -> None:
    rng, step = np.random.default_rng(8), 0.5
    fade = np.exp(-step / time_s)
    slip = np.zeros(20_000)
    for k in range(1, len(slip)):
        slip[k] = fade * slip[k - 1] + sd * np.sqrt(1.0 - fade**2) * rng.normal()
    var, found_s = _own(slip + 0.1 * rng.normal(size=len(slip)), step)
    assert np.sqrt(var) == pytest.approx(sd, rel=0.2)
    assert found_s == pytest.approx(time_s, rel=0.4)
    assert _own(0.1 * rng.normal(size=5000), step) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("row", "answer"),
    [
        (SensorRow("tc", "depth", 0, 100, 10, 0, 1.0, 1.0, 4.0), "yes"),
        (SensorRow("tc", "depth", 0, 100, 11, 0, 1.0, 1.0, 0.0), "partly"),
        (SensorRow("tc", "depth", 0, 100, 0, 0, 1.0, 1.0, 4.1), "partly"),
        (SensorRow("tc", "depth", 0, 19, 19, 0, 1.0, 1.0, 9.0), "yes"),
        (SensorRow("tc", "motion", 0, 100, 99, 0, 9.0, 1.0, 0.0), "yes"),
        (SensorRow("ins", "depth", 0, 100, 99, 0, 9.0, 1.0, 9.0), "yes"),
    ],
)
def test_a_sensor_that_contradicts_the_method_is_a_doubt(row: SensorRow, answer: str) -> None:
    """One that was measured, of the method to take; the doubt is named."""
    found = answer_of(evidence(sensors=(row,)))
    assert found.verdict == answer
    assert ("readings of depth" in found.sentence) is (answer == "partly")


@pytest.mark.parametrize(
    ("name", "verdict", "word"),
    [
        ("imu", "partly", "a part of the dive"),
        ("reference", "yes", "and dead reckoning agrees."),
        ("ahrs", "yes", "dead reckoning and the reference agree."),
    ],
)
def test_a_file_that_ends_early(tmp_path: Path, name: str, verdict: str, word: str) -> None:
    """Half of the IMU leaves half of the dive without a track; half of the reference confirms nothing of the other."""
    path = write_case(drawn_dive(21, seconds=120.0), tmp_path)
    table = pl.read_parquet(tmp_path / f"{name}.parquet")
    table.filter(pl.col("time_s") < 60.0).write_parquet(tmp_path / f"{name}.parquet")
    replayed = replay_case(load_case(path))
    answer, seconds = replayed.manifest["answer"], replayed.samples["time_ns"] * 1e-9
    assert (answer["verdict"], word in answer["sentence"]) == (verdict, True)
    assert seconds.to_numpy().max() == pytest.approx(60.0 if name == "imu" else 120.0, abs=1.5)
