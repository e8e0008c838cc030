"""Our messages as Cyclone DDS's own Python library serialises them: the same bytes, in both directions.

The library is given the types by rosbags' definitions; how they are serialised is its own.
"""

from __future__ import annotations

import dataclasses
import types
from functools import cache
from typing import Any

import numpy as np
import pytest

from bottomlock.io.ros_messages import decode
from bottomlock.live.config import parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.ros_diagnostics import ROS_TYPE, diagnostics
from bottomlock.live.runner import Live
from bottomlock.ports.registry import PORTS, port
from tests.io.test_ros_messages import READ, drawn, equal, full_name, store_of
from tests.ports.cases import JANUS, MASKS, from_beams, navigated
from tests.ros import dive

idl = pytest.importorskip("cyclonedds.idl", reason="needs cyclonedds (group others)")
pytest.importorskip("rosbags", reason="needs rosbags (extra ros)")
from cyclonedds.idl import types as idl_types  # noqa: E402 - behind its guard

STORE = store_of()
SENT = [name for name in PORTS if name.startswith("ros_")]


@cache
def struct(name: str) -> Any:  # noqa: ANN401 - a class of the library
    """A type of ROS 2 as the library's own class."""
    package, kind, last = name.split("/")
    annotations = {field: field_type(of) for field, of in STORE.fielddefs[name][1]}
    made = types.new_class(
        last,
        (idl.IdlStruct,),
        {"typename": f"{package}.{kind}.dds_.{last}_"},
        lambda body: body.update(__annotations__=annotations, __module__=__name__),
    )
    return dataclasses.dataclass(made)


def field_type(of: Any) -> Any:  # noqa: ANN401
    node, inner = int(of[0]), of[1]
    if node == 1:
        plain = {"string": str, "bool": bool, "byte": idl_types.byte}
        return plain.get(inner[0]) or getattr(idl_types, inner[0])
    if node == 2:
        return struct(inner)
    element, count = inner
    return (
        idl_types.array[field_type(element), count] if node == 3 else idl_types.sequence[field_type(element)]
    )


def converted(message: Any) -> Any:  # noqa: ANN401
    """A message of rosbags as one of the library."""
    if hasattr(message, "__msgtype__"):
        made = struct(message.__msgtype__)
        return made(*(converted(getattr(message, field.name)) for field in dataclasses.fields(made)))
    if isinstance(message, np.ndarray):
        return message.tolist()
    return [converted(one) for one in message] if isinstance(message, list) else message


def same(again: bytes, data: bytes) -> bool:
    """Whether bytes are equal behind the header, but for what the library fills up at the end."""
    end = again[len(data) :]
    return again[4 : len(data)] == data[4:] and len(end) <= 3 and not any(end)


@pytest.mark.parametrize("name", SENT)
@pytest.mark.parametrize("frame_id", ["a", "ab", "abc", "abcd"])
def test_what_is_sent(name: str, frame_id: str) -> None:
    """Read by the library, and written again."""
    settings: dict[str, Any] = {"geometry": JANUS} if name == "ros_dvl" else {}
    estimate = from_beams(MASKS["4 beams"]) if name == "ros_dvl" else navigated()
    one = port(name, frame_id=frame_id, **settings)
    data = one.encode(estimate)
    assert data is not None
    message = struct(one.ros_type).deserialize(data)
    assert same(message.serialize(), data)
    header = message.transforms[0].header if name == "ros_tf" else message.header
    assert header.frame_id == frame_id


def test_diagnostics() -> None:
    config = parse_config(dive.CONFIG, place="test")
    live = Live(config, Engine(config), say=lambda _: None, sinks=[], clock=lambda: 5_000_000_007)
    data = diagnostics(live)
    message = struct(ROS_TYPE).deserialize(data)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 7)
    assert [one.level for one in message.status] == [1, 3, 3, 3, 3, 1, 1]
    assert same(message.serialize(), data)


@pytest.mark.parametrize("name", READ)
def test_what_is_received(name: str) -> None:
    """Written by the library with random content, read by us."""
    random = np.random.default_rng(11)
    for _ in range(20):
        message = drawn(STORE, full_name(name), random)
        assert equal(decode(converted(message).serialize(), name), message)
