"""A share of the cases of `tests.attack.live_sockets`; `python -m tests.attack.live_sockets` runs a thousand."""

from __future__ import annotations

import asyncio
import socket
import time

import pytest

from tests.attack.live_sockets import Loop, run_together


def test_a_share_of_the_cases() -> None:
    """Nothing wrong in any, nothing left behind, and together they see every state."""
    outcomes = run_together(list(range(8)))
    assert [outcome.wrong for outcome in outcomes if outcome.wrong] == []
    assert frozenset().union(*(outcome.states for outcome in outcomes)) == {
        "INITIALISING", "OK", "PARTIAL", "COASTING", "UNSAFE",
    }  # fmt: skip
    assert all(outcome.messages > 50 for outcome in outcomes)


@pytest.mark.parametrize(
    "last", [pytest.param(68, marks=pytest.mark.long), pytest.param(208, marks=pytest.mark.deep)]
)
def test_more_of_the_cases(last: int) -> None:
    """Sixty or two hundred, twenty at a time."""
    for first in range(8, last, 20):
        outcomes = run_together(list(range(first, first + 20)))
        assert [outcome.wrong for outcome in outcomes if outcome.wrong] == []


def test_a_message_that_must_not_be_sent_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the check of engine and port messages of INITIALISING and UNSAFE are found."""
    monkeypatch.setattr("bottomlock.live.engine.SILENT", ())
    monkeypatch.setattr("bottomlock.ports.base.SILENT", ())
    assert "sent in state" in run_together([6])[0].wrong


def test_the_loop_goes_on_to_its_timers_and_waits_for_sockets() -> None:
    """An hour passes at once; bytes that are there are read before any time passes."""

    async def hour() -> tuple[float, bytes]:
        loop = asyncio.get_running_loop()
        one, other = socket.socketpair()
        one.setblocking(False)
        with one, other:
            other.send(b"x")
            got = await asyncio.wait_for(loop.sock_recv(one, 1), 0.001)
        await asyncio.sleep(3600.0)
        return loop.time(), got

    began = time.monotonic()
    with asyncio.Runner(loop_factory=Loop) as runner:
        now_s, got = runner.run(hour())
    assert got == b"x"
    assert 3600.0 <= now_s < 3600.1
    assert time.monotonic() - began < 60.0
