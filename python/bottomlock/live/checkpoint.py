"""The navigator saved while it runs, so that a restart within seconds goes on instead of aligning anew.

The file is a line of JSON (when, reset counter, digest of the settings and the geometry) and the bytes of
`Navigator.save`, which carry their own digest. A start continues with the next reset counter; the time since the last
reading is a gap like any other, bridged with its uncertainty, and nothing is sent before a ping has been used.
"""

import json
from pathlib import Path
from typing import Any

from bottomlock.errors import BottomlockError, DataError
from bottomlock.kernel import Navigator
from bottomlock.live.config import LiveConfig
from bottomlock.live.engine import Engine
from bottomlock.live.navigation import NavigationEstimator
from bottomlock.ports.estimate import SILENT

_BOUND = 2**63
"""Of the numbers of the line of JSON."""


def pack(engine: Engine, now_ns: int) -> bytes | None:
    """A checkpoint; None while there is nothing that is worth going on with."""
    estimator = engine.estimator
    if (
        not isinstance(estimator, NavigationEstimator)
        or estimator.navigator is None
        or engine.state in SILENT
    ):
        return None
    head = {"saved_ns": now_ns, "reset_counter": engine.reset_counter, "settings": engine.content_hash}
    return json.dumps(head).encode() + b"\n" + estimator.navigator.save()


def resume(config: LiveConfig, content: bytes) -> Engine:
    """An engine that goes on from a checkpoint, with the next reset counter.

    Raises:
        DataError: for bytes that are no checkpoint of these settings.
    """
    head, navigator = _unpack(config, content)
    engine = Engine(config, reset_counter=int(head["reset_counter"]))
    assert isinstance(engine.estimator, NavigationEstimator)
    engine.estimator.continue_from(navigator)
    return engine


def begin(config: LiveConfig, now_ns: int) -> tuple[Engine, bytes | None, str]:
    """The engine at a start: from the checkpoint if there is one that is young enough.

    Returns:
        The engine, the checkpoint that it goes on from (None for a fresh alignment), and what was decided, in words.
    """
    section = config.checkpoint
    if section is None or not Path(section.file).is_file():
        return Engine(config), None, "" if section is None else "no checkpoint yet: a fresh alignment"
    try:
        content = Path(section.file).read_bytes()
        age_s = (now_ns - int(_unpack(config, content)[0]["saved_ns"])) * 1e-9
        if not 0.0 <= age_s <= section.max_age_s:
            words = f"the checkpoint is {age_s:.1f} s old, limit {section.max_age_s:g} s: a fresh alignment"
            return Engine(config), None, words
        return resume(config, content), content, f"goes on from the checkpoint of {age_s:.1f} s ago"
    except (BottomlockError, OSError) as error:
        return Engine(config), None, f"the checkpoint cannot be used ({error}): a fresh alignment"


def _unpack(config: LiveConfig, content: bytes) -> tuple[dict[str, Any], Navigator]:
    line, _, saved = content.partition(b"\n")
    try:
        head = json.loads(line)
        fits = head["settings"] == config.content_hash()
        numbers = [head["saved_ns"], head["reset_counter"]]
    except (ValueError, KeyError, TypeError) as error:
        raise DataError("it is no checkpoint of `bottomlock live`") from error
    if not all(type(value) is int and 0 <= value < _BOUND for value in numbers):
        raise DataError("it is no checkpoint of `bottomlock live`")
    if not fits:
        raise DataError("it was made with other settings or another geometry of the DVL")
    return head, Navigator.load(saved)
