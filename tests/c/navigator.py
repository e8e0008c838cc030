"""A navigator of the C library with the calls of the package's, for tests that compare both."""

from __future__ import annotations

import ctypes
import inspect
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.kernel import Navigator
from bottomlock.kernel.models import InitialState, Model, Options
from tests.c.header import Header


class CError(Exception):
    """A call that failed, with its status."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


class CLibrary:
    """The library and its header, with failures raised as CError."""

    def __init__(self, prefix: Path) -> None:
        self.header = Header(prefix / "include" / "bottomlock.h")
        self.raw = self.header.load(prefix / "lib" / "libbottomlock.so")

    def __call__(self, name: str, *arguments: Any) -> Any:  # noqa: ANN401 - what the call returns
        """A call; texts, arrays and None are passed as C takes them."""
        result = getattr(self.raw, f"bl_{name}")(*[_passed(one) for one in arguments])
        kind, _ = self.header.functions[f"bl_{name}"]
        if kind is ctypes.c_int and name != "last_status" and result:
            raise CError(result, self.raw.bl_last_error().decode())
        if kind is ctypes.c_void_p and result is None:
            raise CError(self.raw.bl_last_status(), self.raw.bl_last_error().decode())
        return result

    def names(self, function: str) -> list[str]:
        """Every name of a list."""
        found: list[str] = []
        while (name := self(function, len(found))) is not None:
            found.append(name.decode())
        return found

    def structure(self, name: str) -> ctypes.Structure:
        """An empty structure."""
        return self.header.structures[f"bl_{name}"]()

    def geometry(self, directions: NDArray[np.float64]) -> int:
        """A geometry of beams along (beams, 3) directions."""
        made: int = self("geometry_from_json", json.dumps({"directions_d": directions.tolist()}))
        return made

    def json(self, kind: str, object_: int) -> Any:  # noqa: ANN401 - what JSON holds
        """The content of a "model" or "options"."""
        size, text = ctypes.c_size_t(), ctypes.create_string_buffer(20_000)
        self(f"{kind}_to_json", object_, text, len(text), ctypes.addressof(size))
        assert len(text.value) + 1 == size.value
        return json.loads(text.value)


def _passed(value: Any) -> Any:  # noqa: ANN401 - what ctypes takes
    if isinstance(value, str):
        return value.encode()
    if isinstance(value, ctypes.Structure):
        return ctypes.addressof(value)
    if isinstance(value, tuple | list):
        value = np.array(value, dtype=np.float64)
    if isinstance(value, np.ndarray):
        assert value.flags.c_contiguous
        return _Kept(value)
    return value


class _Kept:
    """An array that lives as long as the call that is passed its address."""

    def __init__(self, values: NDArray[Any]) -> None:
        self._values = values
        self._as_parameter_ = values.ctypes.data


ORDER = {
    "imu": ("omega_p_radps", "force_p_mps2"),
    "beams": ("velocity_mps", "valid", "sd_mps"),
    "water_track": ("velocity_mps", "valid", "sd_mps", "range_m"),
    "velocity": ("velocity_p_mps", "cov_m2ps2"),
    "depth": ("depth_m", "sd_m"),
    "thrust": ("speed_p_mps", "sd_mps"),
    "attitude": ("attitude_t_p", "roll_pitch_sd_rad", "yaw_sd_rad"),
    "heading": ("yaw_rad", "sd_rad"),
    "gps": ("position_t_m", "position_sd_m", "velocity_t_mps", "velocity_sd_mps"),
    "position": ("position_t_m", "position_sd_m", "velocity_t_mps", "velocity_sd_mps"),
    "acoustic_position": ("position_t_m", "sd_m"),
}
"""Arguments of each push after the time."""


class CNavigator:
    """A navigator of the C library."""

    def __init__(
        self,
        c: CLibrary,
        directions: NDArray[np.float64],
        model: Model,
        options: Options,
        start: InitialState,
        method: str,
    ) -> None:
        self.c = c
        geometry = c.geometry(directions)
        of_model = c("model_from_json", json.dumps(model.as_dict()))
        of_options = c("options_from_json", json.dumps(options.as_dict()))
        state = c.structure("state")
        for name, value in start.as_dict().items():
            if isinstance(value, tuple):
                getattr(state, name)[:] = value
            else:
                setattr(state, name, value)
        self.pointer = c("navigator_new", geometry, of_model, of_options, method, state, -1)
        c("geometry_free", geometry)
        c("model_free", of_model)
        c("options_free", of_options)

    @classmethod
    def of(cls, c: CLibrary, pointer: int) -> CNavigator:
        """A navigator that another call has made."""
        made = cls.__new__(cls)
        made.c, made.pointer = c, pointer
        return made

    def push(self, name: str, *arguments: Any) -> list[Any]:  # noqa: ANN401 - as the call takes them
        """Pushes; the reports."""
        self.c(f"push_{name}", self.pointer, *arguments)
        return self.reports()

    def __getattr__(self, name: str) -> Callable[..., list[Any]]:
        """The pushes of the package's, with their arguments in the order of the header."""
        sensor = name.removeprefix("push_")
        if sensor not in ORDER:
            raise AttributeError(name)

        def pushed(*arguments: Any, **keywords: Any) -> list[Any]:  # noqa: ANN401 - as the package takes them
            names = inspect.signature(getattr(Navigator, name)).parameters
            given = dict(zip([one for one in names if one != "self"], arguments, strict=False)) | keywords
            passed: list[Any] = []
            for one in ORDER[sensor]:
                value: Any = given.get(one)
                if one == "velocity_mps":
                    passed.append(len(value))
                if one == "valid":
                    passed.append(np.ascontiguousarray(value, dtype=np.uint8))
                else:
                    passed.append(floats(value) if np.ndim(value) else value)
            return self.push("gps" if sensor == "position" else sensor, given["time_ns"], *passed)

        return pushed

    def reports(self) -> list[Any]:
        """Reports of the last push."""
        found = []
        for number in range(self.c("report_count", self.pointer)):
            report = self.c.structure("report")
            self.c("report_get", self.pointer, number, report)
            found.append(report)
        return found

    def save(self) -> bytes:
        """The whole navigator."""
        size = ctypes.c_size_t()
        status = self.c.raw.bl_navigator_save(self.pointer, None, 0, ctypes.addressof(size))
        assert status == self.c.header.constants["BL_STATUS_BUFFER_TOO_SMALL"]
        saved = np.zeros(size.value, dtype=np.uint8)
        self.c("navigator_save", self.pointer, saved, len(saved), ctypes.addressof(size))
        return saved.tobytes()

    def state(self) -> dict[str, Any]:
        """The estimate."""
        state = self.c.structure("state")
        self.c("navigator_state", self.pointer, state)
        return {name: getattr(state, name) for name, *_ in state._fields_}

    def covariance(self) -> NDArray[np.float64]:
        """(20, 20)."""
        covariance = np.zeros((20, 20))
        self.c("navigator_covariance", self.pointer, covariance)
        return covariance

    def free(self) -> None:
        """Once."""
        self.c("navigator_free", self.pointer)


def floats(values: ArrayLike) -> NDArray[np.float64]:
    """Numbers as C takes them."""
    return np.ascontiguousarray(values, dtype=np.float64)
