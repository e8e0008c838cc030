"""A small stand-in of rclpy: what the node calls, with the rules of the real one that it could break.

Rules kept, from the sources of rclpy: a lifecycle publisher sends nothing unless it is active; `publish` takes a
message or `bytes`, which go out as they are; a raw subscription is given bytes; a callback that raises ends the spin; a
transition whose callback raises is an error; times are those of the node's clock, which with `use_sim_time` stands at
zero before the first `/clock`. Messages go from publisher to subscription at once.
"""

from __future__ import annotations

import enum
import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any


class ReliabilityPolicy(enum.Enum):
    RELIABLE = 1
    BEST_EFFORT = 2


@dataclass(frozen=True)
class QoSProfile:
    depth: int
    reliability: ReliabilityPolicy


class TransitionCallbackReturn(enum.Enum):
    SUCCESS = 0
    FAILURE = 1
    ERROR = 2


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    pass


class _Type:
    """A class of messages, by its name."""

    def __init__(self, name: str) -> None:
        self.name = name


class _Publisher:
    def __init__(self, node: Node, msg_type: _Type, topic: str, qos: QoSProfile) -> None:
        self.node, self.msg_type, self.topic, self.qos = node, msg_type, topic, qos
        self.active = False

    def publish(self, msg: bytes) -> None:
        if type(msg) is not bytes:
            raise TypeError(f"Expected {self.msg_type}, got {type(msg)}")
        if self.active:
            self.node.graph.sent.append((self.topic, self.msg_type.name, msg))


@dataclass
class _Subscription:
    msg_type: _Type
    topic: str
    callback: Callable[[bytes], None]
    qos: QoSProfile


@dataclass
class _Timer:
    period_ns: int
    callback: Callable[[], None]
    next_ns: int


@dataclass
class Graph:
    """What is beyond the node: time, messages, parameters."""

    parameters: dict[str, Any] = field(default_factory=dict)
    now_ns: int = 0
    sent: list[tuple[str, str, bytes]] = field(default_factory=list)
    said: list[tuple[str, str]] = field(default_factory=list)
    nodes: list[Node] = field(default_factory=list)

    def at(self, now_ns: int) -> None:
        """The clock says another time; a timer that is due is called once, however many periods have gone."""
        back, self.now_ns = now_ns < self.now_ns, now_ns
        for node in self.nodes:
            for timer in list(node.timers):
                if back:
                    timer.next_ns = now_ns + timer.period_ns
                elif timer.next_ns <= now_ns:
                    timer.next_ns += ((now_ns - timer.next_ns) // timer.period_ns + 1) * timer.period_ns
                    timer.callback()

    def publish(self, topic: str, data: bytes) -> int:
        """A message of another node; how many subscriptions had it."""
        found = [one for node in self.nodes for one in node.subscriptions if one.topic == topic]
        for one in found:
            one.callback(data)
        return len(found)

    def words(self, level: str) -> str:
        """What the node said at a level of its logger, line by line."""
        return "\n".join(text for of, text in self.said if of == level)


_graph: list[Graph] = []


class Node:
    """`rclpy.lifecycle.LifecycleNode`."""

    def __init__(self, name: str) -> None:
        self.name, self.graph, self.state = name, _graph[-1], "unconfigured"
        self.timers: list[_Timer] = []
        self.subscriptions: list[_Subscription] = []
        self.lifecycle_publishers: list[_Publisher] = []
        self._declared: dict[str, Any] = {}
        self.graph.nodes.append(self)

    def declare_parameter(self, name: str, default: Any) -> None:  # noqa: ANN401
        self._declared[name] = self.graph.parameters.get(name, default)

    def get_parameter(self, name: str) -> Any:  # noqa: ANN401
        value = (self._declared | {"use_sim_time": True})[name]
        found = SimpleNamespace(string_value=value, bool_value=value)
        return SimpleNamespace(get_parameter_value=lambda: found)

    def get_clock(self) -> Any:  # noqa: ANN401
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self.graph.now_ns))

    def get_logger(self) -> Any:  # noqa: ANN401
        def at(level: str) -> Callable[[str], None]:
            return lambda text: self.graph.said.append((level, text))

        return SimpleNamespace(info=at("info"), warning=at("warning"), error=at("error"))

    def create_lifecycle_publisher(self, msg_type: _Type, topic: str, qos: QoSProfile) -> _Publisher:
        self.lifecycle_publishers.append(_Publisher(self, msg_type, topic, qos))
        return self.lifecycle_publishers[-1]

    def destroy_lifecycle_publisher(self, publisher: _Publisher) -> None:
        self.lifecycle_publishers.remove(publisher)

    def create_subscription(
        self, msg_type: _Type, topic: str, callback: Callable[[bytes], None], qos: QoSProfile, *, raw: bool
    ) -> _Subscription:
        assert raw
        self.subscriptions.append(_Subscription(msg_type, topic, callback, qos))
        return self.subscriptions[-1]

    def destroy_subscription(self, subscription: _Subscription) -> None:
        self.subscriptions.remove(subscription)

    def create_timer(self, period_s: float, callback: Callable[[], None]) -> _Timer:
        period_ns = round(period_s * 1e9)
        self.timers.append(_Timer(period_ns, callback, self.graph.now_ns + period_ns))
        return self.timers[-1]

    def destroy_timer(self, timer: _Timer) -> None:
        self.timers.remove(timer)

    def destroy_node(self) -> None:
        self.graph.nodes.remove(self)

    def on_configure(self, state: str) -> TransitionCallbackReturn:  # noqa: ARG002
        return TransitionCallbackReturn.SUCCESS

    on_cleanup = on_shutdown = on_error = on_configure

    def on_activate(self, state: str) -> TransitionCallbackReturn:  # noqa: ARG002
        for one in self.lifecycle_publishers:
            one.active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: str) -> TransitionCallbackReturn:  # noqa: ARG002
        for one in self.lifecycle_publishers:
            one.active = False
        return TransitionCallbackReturn.SUCCESS

    def change(self, transition: str) -> TransitionCallbackReturn:
        """A transition, as its service makes it."""
        before, after = _TRANSITIONS[transition]
        assert self.state == before
        try:
            result: TransitionCallbackReturn = getattr(self, f"on_{transition}")(before)
        except Exception:  # noqa: BLE001 - as the real one
            result = TransitionCallbackReturn.ERROR
        if result is TransitionCallbackReturn.ERROR:
            self.on_error(before)
            self.state = "unconfigured"
        if result is TransitionCallbackReturn.SUCCESS:
            self.state = after
        return result


_TRANSITIONS = {
    "configure": ("unconfigured", "inactive"),
    "activate": ("inactive", "active"),
    "deactivate": ("active", "inactive"),
    "cleanup": ("inactive", "unconfigured"),
}


def _modules() -> dict[str, ModuleType]:
    contents: dict[str, dict[str, Any]] = {
        "rclpy": {},
        "rclpy.executors": {"ExternalShutdownException": ExternalShutdownException},
        "rclpy.lifecycle": {
            "LifecycleNode": Node,
            "LifecycleState": str,
            "TransitionCallbackReturn": TransitionCallbackReturn,
        },
        "rclpy.qos": {"QoSProfile": QoSProfile, "ReliabilityPolicy": ReliabilityPolicy},
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.utilities": {"get_message": _Type},
    }
    found = {}
    for name, content in contents.items():
        found[name] = ModuleType(name)
        vars(found[name]).update(content)
    return found


@contextmanager
def node_module(graph: Graph) -> Iterator[Any]:
    """The node's module, in this graph."""
    package = str(Path(__file__).parents[2] / "ros" / "bottomlock_ros")
    modules = _modules()
    mine = ("bottomlock_ros", "bottomlock_ros.node")
    saved = {name: sys.modules.get(name) for name in (*modules, *mine)}
    sys.modules.update(modules)
    sys.path.insert(0, package)
    _graph.append(graph)
    try:
        for name in mine:
            sys.modules.pop(name, None)
        yield importlib.import_module("bottomlock_ros.node")
    finally:
        _graph.pop()
        sys.path.remove(package)
        for name, module in saved.items():
            sys.modules.pop(name, None)
            if module is not None:
                sys.modules[name] = module
