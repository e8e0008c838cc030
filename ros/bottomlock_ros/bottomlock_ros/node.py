"""The node: topics into the live engine, its messages to topics; everything else is `bottomlock.live`.

Messages come in and go out as their serialised bytes. The node's clock, which `use_sim_time` sets, is the engine's only
clock, so a bag that is played gives the bits that its raw log gives again. Callbacks run one after the other, as
`rclpy.spin` runs them.
"""

import functools
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosidl_runtime_py.utilities import get_message

from bottomlock.errors import BottomlockError, OutputError, ScenarioError
from bottomlock.live.config import LiveConfig, cautions, load_config
from bottomlock.live.device import Device
from bottomlock.live.ros_diagnostics import ROS_TYPE, diagnostics
from bottomlock.live.runner import Live, begin, periodic
from bottomlock.live.sections import ROS_TYPES
from bottomlock.ports.address import Address, sink_address, source_address

INPUTS = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of sensors: takes what reliable and best-effort publishers send; a second of an IMU may wait."""
OUTPUTS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
BACK_NS = 1_000_000_000
"""A clock that falls by more was set, or its bag plays again: the estimate starts anew. By less it is held."""


class TopicSink(Device):
    """A target of messages: a publisher of the node."""

    def __init__(self, address: Address, publisher: Any) -> None:  # noqa: ANN401 - rclpy's
        super().__init__(address, lambda _: None)
        self.state, self._publisher = "publishing", publisher

    def write(self, data: bytes, port: int = 0) -> bool:
        """Publishes a serialised message."""
        self._publisher.publish(data)
        self.written[port] += 1
        return True


def _caught(callback: Callable[..., Any]) -> Callable[..., Any]:
    """Logs whatever a callback raises: rclpy drops what a transition raises, and ends where another callback does."""

    @functools.wraps(callback)
    def guarded(node: "BottomlockNode", *given: Any) -> Any:  # noqa: ANN401
        try:
            return callback(node, *given)
        except Exception as error:  # noqa: BLE001 - nothing may be lost
            known = isinstance(error, BottomlockError)
            node.get_logger().error(str(error) if known else traceback.format_exc())
            early = known and node._config is None  # noqa: SLF001 - its own: it stays unconfigured
            return TransitionCallbackReturn.FAILURE if early else TransitionCallbackReturn.ERROR

    return guarded


def _after(work: str, transition: str) -> Callable[..., TransitionCallbackReturn]:
    """A transition that does something first."""
    return _caught(
        lambda node, state: (getattr(node, work)(), getattr(LifecycleNode, transition)(node, state))[1]
    )


class BottomlockNode(LifecycleNode):
    """Live navigation as a lifecycle node; its parameter `config` is the file of `bottomlock live`."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - rclpy's
        super().__init__("bottomlock", **settings)
        self.declare_parameter("config", "")
        self._config: LiveConfig | None = None
        self._text = b""
        self._by_topic: dict[str, Any] = {}
        self._inputs: list[Any] = []
        self._periodic: list[Any] = []
        self._live: Live | None = None
        self._now_ns = 0

    @_caught
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reads the configuration and makes the publishers."""
        file: str = self.get_parameter("config").get_parameter_value().string_value
        if not file:
            raise ScenarioError("the parameter 'config' is empty, expected the file of `bottomlock live`")
        path = Path(file)
        config = load_config(path)
        outputs = {topic: _message(ros_type) for topic, ros_type in _topics(config).items()}
        for section in config.source:
            _message(ROS_TYPES[section.format])
        for caution in cautions(config):
            self.get_logger().warning(caution)
        if config.health is not None and "health" in config.model_fields_set:
            self.get_logger().warning("no health page: the node publishes [diagnostics] in its place")
        self._config, self._text = config, path.read_bytes()
        self._by_topic = {
            topic: self.create_lifecycle_publisher(message, topic, OUTPUTS)
            for topic, message in outputs.items()
        }
        return super().on_configure(state)

    @_caught
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribes, and begins with the first time that the clock gives."""
        config = self._config
        assert config is not None  # configured
        for place, section in enumerate(config.source):
            topic = source_address(section.address).path
            message = _message(ROS_TYPES[section.format])
            take = functools.partial(self._take, place)
            self._inputs.append(self.create_subscription(message, topic, take, INPUTS, raw=True))
        for period_s, work in periodic(config):
            self._every(period_s, work)
        if config.diagnostics is not None:
            publisher = self._by_topic[sink_address(config.diagnostics.to).path]
            self._every(config.diagnostics.every_s, lambda live: publisher.publish(diagnostics(live)))
        result = super().on_activate(state)
        self._running()
        return result

    on_deactivate = _after("_end", "on_deactivate")
    on_cleanup = _after("_forget", "on_cleanup")
    on_shutdown = _after("_forget", "on_shutdown")
    on_error = _after("_forget", "on_error")

    def destroy_node(self) -> None:
        """Ends everything."""
        self._forget()
        super().destroy_node()

    def _every(self, period_s: float, work: Callable[[Live], object]) -> None:
        """Does something while the estimate runs."""
        self._periodic.append(self.create_timer(period_s, functools.partial(self._do, work)))

    @_caught
    def _do(self, work: Callable[[Live], object]) -> None:
        live = self._running()
        if live is not None:
            work(live)

    @_caught
    def _take(self, place: int, data: bytes) -> None:
        """A message of a source, by its place in the configuration."""
        live = self._running()
        if live is not None:
            live.arrive(place, data)

    def _running(self) -> Live | None:
        """The estimate, at the time of the node's clock; None before that has a time."""
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            return None
        if now_ns < self._now_ns - BACK_NS:
            back_s = (self._now_ns - now_ns) * 1e-9
            self.get_logger().warning(f"the clock went back by {back_s:.3f} s: the estimate starts anew")
            self._stop()
            self._now_ns = now_ns
        self._now_ns = max(self._now_ns, now_ns)
        if self._live is None:
            self._live = self._begun()
        return self._live

    def _begun(self) -> Live:
        """An estimate that begins now."""
        config = self._config
        assert config is not None  # configured
        make = functools.partial(begin, config, self._text, say=self._say, clock=lambda: self._now_ns)
        try:
            engine, log = make(logged=True)
        except OutputError as error:
            self.get_logger().error(f"no raw log: {error}")
            engine, log = make(logged=False)
        topics = [sink_address(port.to) for port in config.port]
        sinks: list[Device] = [TopicSink(topic, self._by_topic[topic.path]) for topic in topics]
        simulated = self.get_parameter("use_sim_time").get_parameter_value().bool_value
        live = Live(
            config,
            engine,
            say=self._say,
            log=log,
            sinks=sinks,
            clock=lambda: self._now_ns,
            real_time=not simulated,
        )
        for place, source in enumerate(live.sources):
            source.state = "subscribed"
            live.connected(place)
        return live

    def _say(self, words: str) -> None:
        self.get_logger().info(words)

    def _stop(self) -> None:
        """Ends the estimate and closes its raw log."""
        if self._live is not None:
            self._live.close()
        self._live = None

    def _end(self) -> None:
        """Ends the estimate, and takes nothing any more."""
        for timer in self._periodic:
            self.destroy_timer(timer)
        for one in self._inputs:
            self.destroy_subscription(one)
        self._periodic, self._inputs = [], []
        self._stop()
        self._now_ns = 0

    def _forget(self) -> None:
        """Ends everything, and forgets the configuration."""
        self._end()
        for publisher in self._by_topic.values():
            self.destroy_lifecycle_publisher(publisher)
        self._by_topic, self._config = {}, None


def _topics(config: LiveConfig) -> dict[str, str]:
    """Type of the messages of each topic that is published.

    Raises:
        ScenarioError: for a source or target that is no topic of this node.
    """
    targets = [(f"port {one.port}", one.to) for one in config.port]
    targets += [] if config.diagnostics is None else [("[diagnostics]", config.diagnostics.to)]
    for what, address in [*((f"source '{one.name}'", one.address) for one in config.source), *targets]:
        if not address.startswith("ros:"):
            raise ScenarioError(
                f"{what} has address '{address}', expected ros:/TOPIC: the node knows topics alone, "
                "`bottomlock live` the other addresses"
            )
    types: dict[str, str] = {}
    ros_types = [one.ros_type for one in config.ports()]
    ros_types += [] if config.diagnostics is None else [ROS_TYPE]
    for (what, address), ros_type in zip(targets, ros_types, strict=True):
        topic = sink_address(address).path
        if types.setdefault(topic, ros_type) != ros_type:
            raise ScenarioError(f"{what} sends {ros_type} to {topic}, to which another sends {types[topic]}")
    return types


def _message(ros_type: str) -> Any:  # noqa: ANN401 - a class of messages
    """The class of a type.

    Raises:
        ScenarioError: where its package is not installed in this ROS.
    """
    try:
        return get_message(ros_type)
    except (ImportError, AttributeError) as error:
        package = ros_type.split("/", maxsplit=1)[0]
        raise ScenarioError(
            f"messages {ros_type} need the ROS package {package}, which is not there"
        ) from error


def main(args: list[str] | None = None) -> None:
    """Runs the node until it is stopped."""
    rclpy.init(args=args)
    node = BottomlockNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
