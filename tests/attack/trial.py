"""One case of random calls: what was called, what it gave, and what may not be."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bottomlock.errors import BottomlockError
from tests.attack.values import Arguments

ALLOWED = (BottomlockError, TypeError, OverflowError, MemoryError)
"""Errors of the kernel, of the parsing of arguments, and numpy's for an array that does not fit into memory."""


class Trial:
    """Makes calls, counts them and keeps every fault.

    Attributes:
        calls: number of calls by function.
        accepted: number of those that returned.
        faults: one line each, with what was spoilt; the first words, up to the bar, are the kind.
    """

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()
        self.accepted: Counter[str] = Counter()
        self.faults: list[str] = []
        self._changed: tuple[tuple[str, Any], ...] = ()

    def call(
        self, name: str, function: Callable[..., Any], arguments: Arguments, *, valid: bool = False
    ) -> Any:  # noqa: ANN401 - what the function returns
        """The result of a call; None where it is refused.

        A `valid` call may not be refused.
        """
        self.calls[name] += 1
        self._changed = arguments.changed
        try:
            result = function(**arguments.values)
        except ALLOWED as error:
            if isinstance(error, BottomlockError):
                self._judge_words(name, str(error))
            if valid:
                self.fault(name, f"refused valid arguments: {error}")
            return None
        except ValueError as error:
            # What float() says of a text in an array.
            if not str(error).startswith("could not convert string to float"):
                self.fault(name, f"ValueError: {error}")
            return None
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # noqa: BLE001 - a panic is no Exception
            self.fault(name, f"{type(error).__name__}: {error}")
            return None
        self.accepted[name] += 1
        for word in arguments.wrong:
            self.fault(name, f"accepted {word}")
        return result

    def _judge_words(self, name: str, words: str) -> None:
        if not words.strip() or "\n" in words:
            self.fault(name, f"an error not of one line: {words!r}")

    def fault(self, name: str, words: str) -> None:
        """Keeps a fault, in one line."""
        with np.printoptions(threshold=40):
            spoilt = [f"{place}={value!r}" for place, value in self._changed]
        self.faults.append(f"{name} | {' '.join(words.split())[:400]} | {spoilt}")

    def finite(self, name: str, values: Mapping[str, Any], *, may_lack: tuple[str, ...] = ()) -> None:
        """Every number of a result is finite but those of the keys in `may_lack`."""
        for key, value in values.items():
            if isinstance(value, Mapping):
                self.finite(name, value, may_lack=may_lack)
            elif key not in may_lack and isinstance(value, np.ndarray | float):
                array = np.asarray(value)
                if array.dtype.kind == "f" and not np.isfinite(array).all():
                    self.fault(name, f"returned {key} that is not finite")

    def covariance(self, name: str, cov: np.ndarray[Any, Any]) -> None:
        """A covariance (..., n, n) is finite, symmetric, of variances that are not negative."""
        if not np.isfinite(cov).all():
            self.fault(name, "returned a covariance that is not finite")
            return
        if not np.array_equal(cov, np.swapaxes(cov, -1, -2)):
            scale = np.abs(cov).max()
            if np.abs(cov - np.swapaxes(cov, -1, -2)).max() > 1e-9 * scale:
                self.fault(name, "returned a covariance that is not symmetric")
        if (np.diagonal(cov, axis1=-2, axis2=-1) < 0).any():
            self.fault(name, "returned a negative variance")


def same(first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    """Two dicts of numbers agree bit for bit."""
    return all(np.array_equal(first[key], second[key], equal_nan=True) for key in first)
