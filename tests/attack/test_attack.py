"""Every argument of every function of the kernel spoilt: an error of one line, or a sound result."""

import functools
import random
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from bottomlock import kernel
from bottomlock.errors import BottomlockError
from tests.attack.calls import Call, batches, geometries, navigators
from tests.attack.spoilt import Path, Spoilt, places, replaced, spoilt, value_at
from tests.kernel.report_bits import FIELDS

ALLOWED = (BottomlockError, TypeError, OverflowError, MemoryError)
"""Errors of the kernel, of the parsing of arguments, and numpy's for an array that does not fit into memory."""


@functools.cache
def calls() -> list[Call]:
    return [*geometries(), *batches(), *navigators()]


def unsound(result: Any, may_lack: tuple[str, ...] = ()) -> str:  # noqa: ANN401 - of any function
    """What is wrong with a result, "" for nothing."""
    if isinstance(result, kernel.VelocityFixes):
        solved = result.component == kernel.COMPONENT_STATUS.index("solved")
        variance = np.diagonal(result.cov_m2ps2, axis1=1, axis2=2)[solved]
        if not (np.isfinite(result.velocity_p_mps[solved]).all() and (variance > 0.0).all()):
            return "solved without a velocity and a positive variance"
        result = vars(result)
    if isinstance(result, kernel.BeamGeometry):
        if not (np.abs(np.linalg.norm(result.directions_p, axis=1) - 1.0) < 1e-6).all():
            return "directions that are not unit vectors"
        result = {"lever_arms": result.lever_arms_p_m, "scale": result.sound_speed_scale}
    if isinstance(result, kernel.Navigator):
        state, cov = result.state(), result.covariance()
        if abs(float(np.linalg.norm(state["attitude_t_p"])) - 1.0) > 1e-9:
            return "a quaternion that is not of norm 1"
        if np.abs(cov - cov.T).max() > 1e-9 * np.abs(cov).max() or (np.diagonal(cov) < 0.0).any():
            return "a covariance that is none"
        # A layer that was never measured is infinitely old.
        held = {"state": state, "cov": cov, "water": result.water() or {}, "thrust": result.thrust() or {}}
        return unsound(held, ("age_s",))
    if isinstance(result, list):
        return next(filter(None, (unsound(one) for one in result)), "")
    if isinstance(result, kernel.Report):
        # A beam that did not return has no weight.
        return unsound({name: getattr(result, name) for name in FIELDS}, ("threshold", "beam_weight"))
    if isinstance(result, Mapping):
        kept = {key: one for key, one in result.items() if key not in may_lack}
        return next(
            (f"{key} is {wrong}" for key, one in kept.items() if (wrong := unsound(one, may_lack))), ""
        )
    if isinstance(result, np.ndarray | float):
        array = np.asarray(result)
        return "" if array.dtype.kind != "f" or np.isfinite(array).all() else "not finite"
    return ""


def bits(navigator: kernel.Navigator | None) -> bytes:
    """State and covariance."""
    held = [] if navigator is None else [*navigator.state().values(), navigator.covariance()]
    return b"".join(np.asarray(one).tobytes() for one in held)


def fault_of(call: Call, arguments: dict[str, Any], wrong: str | None) -> str:
    """What is wrong with the outcome of a call, "" for nothing."""
    function = call.make()
    subject = getattr(function, "__self__", None)
    navigator = subject if isinstance(subject, kernel.Navigator) else None
    before = bits(navigator)
    try:
        result = function(**arguments)
    except ALLOWED as error:
        if isinstance(error, BottomlockError) and (not str(error).strip() or "\n" in str(error)):
            return f"an error not of one line: {str(error)!r}"
        if call.name != "push_imu_block" and bits(navigator) != before:
            return "a refused push left a trace"
        return ""
    except ValueError as error:
        # What float() says of a text in an array.
        return "" if str(error).startswith("could not convert string to float") else f"ValueError: {error}"
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # noqa: BLE001 - a panic is no Exception
        return f"{type(error).__name__}: {error}"
    return f"accepted {wrong}" if wrong else unsound(result, call.may_lack) or unsound(navigator)


def test_valid_calls_are_accepted() -> None:
    names = {call.name for call in calls()}
    assert len(names) > 20
    for call in calls():
        assert unsound(call.make()(**call.arguments), call.may_lack) == "", call.name


Attack = tuple[Call, Path, Spoilt]


def every() -> Iterator[Attack]:
    """Each value at each place of each call: a hundred thousand."""
    for call in calls():
        for at in places(call.arguments):
            yield from ((call, at, one) for one in spoilt(value_at(call.arguments, at)))


def drawn(count: int) -> Iterator[Attack]:
    """Some of them, every call as often as another."""
    rng = random.Random(16)
    for _ in range(count):
        call = rng.choice(calls())
        at = rng.choice(list(places(call.arguments)))
        yield call, at, rng.choice(list(spoilt(value_at(call.arguments, at))))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [1500, pytest.param(None, marks=[pytest.mark.deep, pytest.mark.slow])])
def test_spoilt_calls_are_answered_or_refused_in_one_line(count: int | None) -> None:
    """No panic, nothing that is not finite, no refused push that leaves a trace; in `make test-deep` all."""
    faults = []
    for call, at, one in every() if count is None else drawn(count):
        name = ".".join(map(str, at))
        wrong = None if name.startswith(call.ignored) and one.wrong != "an unknown key" else one.wrong
        if fault := fault_of(call, replaced(call.arguments, at, one.value), wrong):
            faults.append(f"{call.name}({name}={one.value!r:.200}): {fault:.400}")
    assert faults == []
