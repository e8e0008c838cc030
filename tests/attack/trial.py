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
        faults: one line each; the first words, up to the bar, are the kind.
    """

    def __init__(self, tell: Callable[[str], None] | None = None) -> None:
        self.calls: Counter[str] = Counter()
        self.accepted: Counter[str] = Counter()
        self.faults: list[str] = []
        self._tell = tell

    def call(
        self, name: str, function: Callable[..., Any], arguments: Arguments, *, valid: bool = False
    ) -> Any:  # noqa: ANN401 - what the function returns
        """The result of a call; None where it is refused.

        A `valid` call may not be refused.
        """
        self.calls[name] += 1
        if self._tell is not None:
            self._tell(told(name, arguments))
        try:
            result = function(**arguments.values)
        except ALLOWED as error:
            if isinstance(error, BottomlockError):
                self._judge_words(name, str(error))
            if self._tell is not None:
                self._tell(f"  {type(error).__name__}: {error}")
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
        line = f"{name} | {' '.join(words.split())[:400]}"
        self.faults.append(line)
        if self._tell is not None:
            self._tell(f"  FAULT {line}")

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


def told(name: str, arguments: Arguments) -> str:
    """A call in words: its arguments, or, where they are long, those that are spoilt."""
    words = ", ".join(f"{key}={shown(value)}" for key, value in arguments.values.items())
    if len(words) > 1000:
        words = "valid but for " + ", ".join(f"{place}={shown(value)}" for place, value in arguments.changed)
    return f"{name}({words})"


def shown(value: Any, longest: int = 2000) -> str:  # noqa: ANN401 - any argument
    """An argument as it is printed for reproduction."""
    try:
        with np.printoptions(threshold=40):
            words = repr(value)
    except Exception:  # noqa: BLE001 - a value of the grammar need not be printable
        words = f"<{type(value).__name__}>"
    return words if len(words) <= longest else words[:longest] + " …"
