"""Bags with Dvl messages: ROS 1, ROS 2 and MCAP give one table; a damaged bag ends in one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="bags need the extra .[ros]")

from bottomlock.errors import DataError
from bottomlock.io import ros
from bottomlock.io.formats import detect, read_recording
from bottomlock.io.rows import Options
from bottomlock.live.readings import PingReader
from tests.io import bags

KINDS = ("ros1", "ros2", "mcap folder", "mcap file")


def bag(kind: str, folder: Path, steps: int = 4, **changed: Any) -> Path:  # noqa: ANN401 - fields of any message
    if kind == "ros1":
        return bags.write_ros1(folder / "dive.bag", steps, **changed)
    path = bags.write_ros2(folder / "dive", steps, mcap=kind != "ros2", **changed)
    return next(path.glob("*.mcap")) if kind == "mcap file" else path


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_bag_gives_the_same_pings(kind: str, tmp_path: Path) -> None:
    """Beams along the message's own unit vectors, stamp as time of validity, the bag's time as arrival."""
    path = bag(kind, tmp_path)
    assert detect(path) == "ros"
    recording = read_recording(path)
    table = recording.table
    np.testing.assert_array_equal(table.time_ns, 1_700_000_000_000_000_000 + 200_000_000 * np.arange(4))
    assert table.arrival_ns is not None
    np.testing.assert_array_equal(table.arrival_ns - table.time_ns, 50_000_000)
    np.testing.assert_array_equal(table.valid[:, 1], [True, True, False, True])
    np.testing.assert_allclose(table.velocity_mps[0], bags.UNIT @ bags.VELOCITY, atol=1e-7)
    assert np.isnan(table.velocity_mps[2, 1])
    np.testing.assert_allclose(table.sd_mps, 0.01, rtol=1e-6)
    np.testing.assert_array_equal(table.instrument_mps[0], bags.VELOCITY)
    np.testing.assert_array_equal(table.instrument_valid, 1)
    np.testing.assert_allclose(table.extra["instrument_sd_mps"], 2e-3)
    np.testing.assert_allclose(recording.facts["beam_unit_vec"], bags.UNIT, atol=1e-9)
    assert recording.account.to_json()["skipped"] == {}


def test_what_a_message_says_of_itself(tmp_path: Path) -> None:
    """Water track is not ground; a variance of -1 among others is a lost beam; unfilled beams are none."""
    water = bags.write_ros1(tmp_path / "w.bag", 2, velocity_mode=2)
    with pytest.raises(
        DataError, match=r"no marine_acoustic_msgs/msg/Dvl could be read; there are 2 velocity through"
    ):
        read_recording(water)
    spread = np.array([1e-4, -1.0, 1e-4, 1e-4], dtype=np.float32)
    recording = read_recording(bags.write_ros1(tmp_path / "v.bag", 2, beam_velocity_covar=spread))
    np.testing.assert_array_equal(recording.table.valid, [[True, False, True, True]] * 2)
    assert recording.account.flagged["num_good_beams disagrees with the beams"].count == 2
    unknown = np.full(4, -1.0, dtype=np.float32)
    recording = read_recording(bags.write_ros1(tmp_path / "u.bag", 2, beam_velocity_covar=unknown))
    assert recording.table.valid.all()
    assert np.isnan(recording.table.sd_mps).all()
    backwards = (-(bags.UNIT @ bags.VELOCITY)).astype(np.float32)
    recording = read_recording(bags.write_ros1(tmp_path / "b.bag", 2, beam_velocity=backwards))
    assert any("--negate-beams" in note for note in recording.notes)
    turned = read_recording(tmp_path / "b.bag", options=Options(negate_beams=True))
    np.testing.assert_allclose(turned.table.velocity_mps[0], bags.UNIT @ bags.VELOCITY, atol=1e-7)


@pytest.mark.parametrize(
    ("lost", "ranges", "count", "valid"),
    [
        ([1], [2.7, -1.0, 2.9, 3.0], 3, [True, False, True, True]),
        ([1], [2.7, 0.0, 2.9, 3.0], 4, [True, False, True, True]),
        ([0, 3], [2.7, 2.8, 2.9, 3.0], 2, [False, True, True, False]),
        ([], [2.7, 2.8, -1.0, 3.0], 3, [True, True, False, True]),
        ([1], [2.7, 2.8, 2.9, 3.0], 4, [True, True, True, True]),
        ([], [2.7, 2.8, 2.9, 3.0], 3, None),
        ([0, 3], [2.7, 2.8, 2.9, 3.0], 3, None),
        ([], [0.0, 0.0, 0.0, 0.0], 3, None),
    ],
)
def test_a_lost_beam_of_the_makers_driver_is_no_velocity_of_zero(
    lost: list[int], ranges: list[float], count: int, valid: list[bool] | None, tmp_path: Path
) -> None:
    """By velocity 0 and range, or by the number of good beams; where that does not say which, none of the ping is used.

    In a bag and in a live message alike, and what is left out is counted in both.
    """
    beams = np.array(bags.UNIT @ bags.VELOCITY, dtype=np.float32)
    beams[lost] = 0.0
    changed: dict[str, Any] = {
        "beam_velocity": beams, "range": np.array(ranges), "num_good_beams": count,
        "beam_velocity_covar": np.zeros(4, dtype=np.float32),
    }  # fmt: skip
    path = bags.write_ros1(tmp_path / "driver.bag", 1, **changed)
    store, reader = ros.typestore(), PingReader("ros-dvl", 4)
    pings = reader.feed(bytes(store.serialize_cdr(bags.message(store, 0, **changed), ros.TYPES[0])))
    if valid is None:
        reason = "fewer good beams than velocities, and no mark of the lost ones"
        with pytest.raises(DataError, match=f"1 {reason}"):
            read_recording(path)
        assert pings == []
        assert reader.skipped == {reason: 1}
        return
    np.testing.assert_array_equal(read_recording(path).table.valid, [valid])
    np.testing.assert_array_equal([ping.valid for ping in pings], [valid])


def test_stale_repeats_and_the_wrong_directions_of_the_makers_driver(tmp_path: Path) -> None:
    """A repeated report holds no measurement; unit vectors at 67.5 degrees are not those of the A50."""
    store, reader = ros.typestore(), PingReader("ros-dvl", 4)
    changed: dict[str, Any] = {"range": np.full(4, 2.5)}
    sent = [bytes(store.serialize_cdr(bags.message(store, k, **changed), ros.TYPES[0])) for k in (0, 1)]
    assert [ping.valid.all() for data in sent for ping in reader.feed(data)] == [True, False]
    steep = [
        store.types["geometry_msgs/msg/Vector3"](
            a * 0.6532814824381883, b * 0.6532814824381883, 0.38268343236508984
        )
        for a, b in ((-1, 1), (-1, -1), (1, -1), (1, 1))
    ]
    recording = read_recording(bags.write_ros2(tmp_path / "bag", 3, beam_unit_vec=steep, **changed))
    np.testing.assert_array_equal(
        recording.table.valid.any(axis=1), [True, False, True]
    )  # the third has another beam 2
    np.testing.assert_array_equal(recording.table.stale, [False, True, False])
    assert recording.account.flagged["stale repeat"].count == 1
    assert (recording.geometry, recording.facts) == ("waterlinked_a50", {})


def fault_of(path: Path) -> str | None:
    """What is said against a bag, or None where it gives pings."""
    try:
        assert read_recording(path).table.rows > 0
    except DataError as error:
        return str(error)
    return None


def test_topics(tmp_path: Path) -> None:
    """Two topics need a choice; a wrong choice is told what there is."""
    path = bags.write_ros1(tmp_path / "two.bag", 2, topics=("/dvl", "/dvl/again"))
    with pytest.raises(DataError, match="choose one with --topic"):
        read_recording(path)
    assert read_recording(path, options=Options(topic="/dvl/again")).table.rows == 2
    with pytest.raises(DataError, match=r"no topic '/none' with .*topics: /dvl \(marine"):
        read_recording(path, options=Options(topic="/none"))


@pytest.mark.parametrize("kind", ["ros1", "ros2", "mcap file"])
def test_a_damaged_bag_ends_in_one_line(kind: str, tmp_path: Path) -> None:
    """Cut off or overwritten anywhere: pings that could be read with the break counted, or a DataError."""
    path = bag(kind, tmp_path, steps=6)
    file = path if path.is_file() else next(path.glob("*.db3"))
    whole = file.read_bytes()
    rng = np.random.default_rng(5)
    for _ in range(25):
        data = bytearray(whole)
        if rng.random() < 0.5:
            del data[rng.integers(20, len(data)) :]
        for at in rng.integers(16, len(data), size=4):
            data[at] = rng.integers(256)
        file.write_bytes(data)
        fault = fault_of(path)
        assert fault is None or ("\n" not in fault and path.name in fault)
