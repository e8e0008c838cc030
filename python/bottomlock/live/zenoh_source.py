"""Messages from zenoh: the samples under a key, or of a topic of ROS 2 as rmw_zenoh sends them."""

import asyncio
from collections.abc import Callable
from typing import Any

from bottomlock.live import zenoh_session
from bottomlock.live.rmw_zenoh import ROUTER, Topic
from bottomlock.ports.address import Address

MOST_WAITING = 1000
"""Messages that wait for their turn; of more the newest are dropped."""


async def receive(
    address: Address,
    ros_type: str,
    *,
    on_data: Callable[[bytes], None],
    on_opened: Callable[[], None],
    on_dropped: Callable[[], None],
) -> None:
    """Hands on the payload of every sample until it is cancelled.

    Args:
        address: key or topic, and endpoint.
        ros_type: type of the messages of a topic.
        on_data: is given each payload, in the loop that runs this.
        on_opened: is called once the subscription stands.
        on_dropped: is called for each sample that is dropped because too many wait.

    Raises:
        DataError: where eclipse-zenoh is not installed.
        OSError: where no session can be opened.
    """
    loop = asyncio.get_running_loop()
    topic = Topic(address.path, ros_type) if address.kind == "ros" else None
    endpoint = address.host or ("" if topic is None else ROUTER)
    waiting = 0

    def take(payload: bytes) -> None:
        nonlocal waiting
        waiting -= 1
        on_data(payload)

    def sample_came(sample: Any) -> None:  # noqa: ANN401 - an extra; called in a thread of zenoh
        nonlocal waiting
        if loop.is_closed():
            return
        if waiting >= MOST_WAITING:
            loop.call_soon_threadsafe(on_dropped)
            return
        waiting += 1
        loop.call_soon_threadsafe(take, sample.payload.to_bytes())

    zenoh_session.library()
    session = await zenoh_session.joined(endpoint)
    token: Any = None
    subscriber: Any = None
    try:
        key = address.path if topic is None else topic.subscribed()
        subscriber = session.zenoh.declare_subscriber(key, sample_came)
        if topic is not None:
            token, _ = topic.declare(session, "MS")
        on_opened()
        await asyncio.Event().wait()
    finally:
        for one in (token, subscriber):
            if one is not None:
                one.undeclare()
        await asyncio.to_thread(zenoh_session.leave, endpoint)
