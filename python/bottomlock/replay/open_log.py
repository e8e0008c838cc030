"""Recorded files as readings one at a time: what `Navigator.start(...).push` takes."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beams import Instrument
from bottomlock.recordings.readings import ImuReading, Ping, Reading
from bottomlock.recordings.sensors import GPS, SENSORS
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.recordings.streams import Beams, Times
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.init.make import make_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.streams import Streams

CASE = ".toml"


@dataclass(frozen=True, eq=False)
class Log:
    """A recorded log; iterating yields its readings in the order of their times, in SI and the platform's axes.

    Of equal times the order is inertial, ping, then that of `recordings.sensors.SENSORS`. A reference is none.

    Attributes:
        case: how its files are read; `case.imu.sampling` and the like.
        guesses: what was guessed of the files ("guessed:") and what they leave open ("assumed:"), each with its key
            and value; then the questions ("?"). Empty for a case that is given.
        streams: the same readings as arrays.
        files: those that were opened, or those of the case.
    """

    case: Case
    guesses: tuple[str, ...]
    streams: Streams
    files: tuple[Path, ...]

    @property
    def instrument(self) -> Instrument:
        """Geometry of the DVL, and noise of its beams, as `Navigator.start(dvl=…)` takes it."""
        return self.streams.instrument

    @property
    def latitude_deg(self) -> float:
        """Of the place, deg."""
        return float(np.rad2deg(self.streams.latitude_rad))

    @property
    def left_out(self) -> tuple[str, ...]:
        """Streams that are no readings."""
        named = {
            "reference": self.streams.reference,
            "gps without a place on the Earth": None if self.streams.origin else self.streams.gps,
        }
        return tuple(name for name, stream in named.items() if stream is not None)

    def __iter__(self) -> Iterator[Reading | Ping]:
        """The readings in the order of their times."""
        columns = list(_columns(self.streams, has_imu=not isinstance(self.case.imu, ImuFromAttitude)))
        times = np.concatenate([time_ns for time_ns, _ in columns])
        column = np.repeat(np.arange(len(columns)), [len(time_ns) for time_ns, _ in columns])
        row = np.concatenate([np.arange(len(time_ns)) for time_ns, _ in columns])
        for k in np.lexsort((column, times)).tolist():
            yield columns[column[k]][1](int(times[k]), int(row[k]))

    def __repr__(self) -> str:
        return f"<Log of {', '.join(dict.fromkeys(path.name for path in self.files))}>"


Column = tuple[Times, Callable[[int, int], Reading | Ping]]
"""Times, and the reading of a time and its row."""


def _columns(streams: Streams, *, has_imu: bool) -> Iterator[Column]:
    """The streams that are readings; of equal times the first comes first."""
    if has_imu:
        inertial = streams.inertial
        omega, force = inertial.omega_p_radps.tolist(), inertial.force_p_mps2.tolist()
        yield inertial.time_ns, lambda t, k: ImuReading(t, tuple(omega[k]), tuple(force[k]))
    yield streams.beams.time_ns, partial(_ping, streams.beams)
    for sensor in SENSORS:
        stream = streams.aiding.get(sensor.name)
        if stream is not None and (sensor is not GPS or streams.origin is not None):
            yield stream.time_ns, sensor.readings(stream, streams.origin)


def _ping(beams: Beams, time_ns: int, row: int) -> Ping:
    velocity_d = beams.velocity_d_mps
    none = np.full(beams.velocity_mps.shape[1], np.nan)
    return Ping(
        time_ns=time_ns,
        transmission_ns=time_ns,
        velocity_mps=beams.velocity_mps[row],
        valid=beams.valid[row],
        sd_mps=beams.sd_mps[row],
        range_m=none if beams.range_m is None else beams.range_m[row],
        instrument_mps=np.full(3, np.nan) if velocity_d is None else velocity_d[row],
        instrument_valid=None,
    )


def open_log(*files: str | Path, without: Sequence[str] = ()) -> Log:
    """Opens recorded files as `bottomlock replay --init` does, or a case, as readings for `Navigator.start`.

    Args:
        files: logs of a DVL, tables, bags and logs of autopilots, whose streams, units, axes and clocks are guessed; or
            one case, a TOML file.
        without: topics and messages of logs that are left out.

    Raises:
        DataError: without files, for files without a DVL or an IMU or attitude, and for one that cannot be read.
        ScenarioError: for a case with a fault.

    Examples:
        >>> log = open_log("data/logs/survey_dive/case.toml")  # doctest: +SKIP
        >>> type(next(iter(log))).__name__  # doctest: +SKIP
        'ImuReading'
    """
    paths = [_path(file) for file in files]
    if isinstance(without, str):
        raise DataError(f"without is '{without}'", expected=f"a list of topics and messages: [{without!r}]")
    if not paths:
        expected = "the log of a DVL and those of other sensors, or a case"
        raise DataError("is given no file", key="open_log", expected=expected)
    if any(path.suffix == CASE for path in paths):
        if len(paths) > 1:
            raise DataError(
                "a case stands alone, it names its files", place=next(p for p in paths if p.suffix == CASE)
            )
        if without:
            raise DataError("without is given with a case", place=paths[0], expected="with logs alone")
        case = load_case(paths[0])
        return Log(case, (), read_streams(case), tuple(case.files().values()))
    with TemporaryDirectory() as folder:
        # The tables that a guessed case needs beside it are read before they go.
        made = make_case(paths, Path(folder) / "case.toml", without=without)
        case = load_case(made.case)
        guesses = [
            f"{f'[{one.section}] {one.setting}'.strip()}: {one.words}"
            for one in made.entries
            if one.why and one.known is not None
        ]
        guesses += [f"? {one}" for one in made.questions]
        return Log(case, tuple(guesses), read_streams(case), tuple(paths))


def _path(file: object) -> Path:
    if not isinstance(file, str | os.PathLike):
        hint = ": open_log(*files)" if isinstance(file, list | tuple) else ""
        raise DataError(f"is given a {type(file).__name__}", key="open_log", expected=f"paths{hint}")
    return Path(file)
