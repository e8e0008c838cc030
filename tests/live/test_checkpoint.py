"""Restarts: from a young checkpoint the estimate goes on with the next reset counter; else a fresh alignment."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bottomlock.live.checkpoint import begin, pack
from bottomlock.live.config import LiveConfig
from bottomlock.live.engine import Engine
from bottomlock.ports.estimate import SILENT
from tests.live.world import START_NS, VELOCITY, Sent, World, config

S = 1_000_000_000


def until(seconds: float) -> tuple[Engine, bytes]:
    """An engine after some seconds, and its checkpoint."""
    engine = Engine(config("navigation"))
    for arrival_ns, source, data in World(seconds).arrivals(imu=True):
        engine.arrive(source, arrival_ns, data)
    content = pack(engine, engine.now_ns)
    assert content is not None
    return engine, content


def with_file(path: Path) -> LiveConfig:
    """The configuration with a checkpoint file."""
    return config("navigation", extra=f'[checkpoint]\nfile = "{path}"\n')


def test_goes_on_within_two_seconds(tmp_path: Path) -> None:
    """A kill at 4 s and a start at 5 s: estimates again within 1 s, not aligned anew, one reset more."""
    file = tmp_path / "checkpoint"
    file.write_bytes(until(4.0)[1])
    engine, used, words = begin(with_file(file), START_NS + 5 * S)
    assert used is not None
    assert words == "goes on from the checkpoint of 1.0 s ago"
    sent = []
    for arrival_ns, source, data in World(9.0).arrivals(imu=True):
        if arrival_ns < START_NS + 5 * S:
            continue
        for message in engine.arrive(source, arrival_ns, data):
            assert engine.state not in SILENT
            sent.append((arrival_ns, Sent.parse(message.data)))
    assert sent[0][0] < START_NS + 6 * S
    for _, one in sent:
        assert one.resets == 1
        assert (np.abs(one.velocity - VELOCITY) < 5.0 * one.sd).all()
    assert engine.state == "OK"


@pytest.mark.parametrize(
    ("change", "age_s", "words"),
    [
        (lambda content: content, 6.0, "6.0 s old"),
        (lambda content: content, -1.0, "-1.0 s old"),
        (lambda content: content[:-1], 1.0, "cannot be used"),
        (lambda _: b"", 1.0, "no checkpoint"),
        (lambda _: b"{}\n", 1.0, "no checkpoint"),
        (lambda content: content.replace(b'"settings": "', b'"settings": "x'), 1.0, "other settings"),
    ],
)
def test_old_or_damaged_ones_are_not_used(
    tmp_path: Path, change: Callable[[bytes], bytes], age_s: float, words: str
) -> None:
    """A fresh alignment, and the reason."""
    engine, content = until(3.0)
    file = tmp_path / "checkpoint"
    file.write_bytes(change(content))
    fresh, used, said = begin(with_file(file), engine.now_ns + round(age_s * S))
    assert used is None
    assert words in said
    assert fresh.reset_counter == 0
    assert fresh.estimator.waiting_for == "inertial readings"


def test_nothing_to_save_before_the_alignment() -> None:
    """Nor in mode velocity."""
    assert pack(Engine(config("navigation")), START_NS) is None
    assert pack(Engine(config()), START_NS) is None
