"""The rows of `tools.first_line`: recordings, faulty logs, planted mistakes and right logs, each with its truth."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.geodesy import radii_m
from tests import dive as dives
from tests import recorded_dives
from tests.dive_logs import write
from tests.replay.akit import LAG_S

ROOT = Path(__file__).resolve().parent.parent
Floats = NDArray[np.float64]
Kind = Literal["recording", "case", "mistake", "right"]


@dataclass(frozen=True, eq=False)
class Truth:
    """Where the vehicle was.

    Attributes:
        time_s: Unix time.
        north_m, east_m, down_m: from `home`; no depth where it is not judged.
        home: latitude and longitude, degrees.
        absolute: the files hold positions, so that the track is judged where it is; else it is moved to begin at the
            truth.
        sd_m: noise of the truth, 1 sigma horizontally.
    """

    time_s: Floats
    north_m: Floats
    east_m: Floats
    down_m: Floats | None = None
    home: tuple[float, float] = (0.0, 0.0)
    absolute: bool = False
    sd_m: float = 0.0


@dataclass(frozen=True)
class Row:
    """A run.

    Attributes:
        name: unique.
        kind: of what it is.
        make: writes the files, and returns their paths and the truth; None for that of the files themselves, if any.
        faultless: nothing is wrong with the log, so that neither a refusal nor a "no" is right beside a right track.
        untrue: words of a refusal that are not true of this input.
    """

    name: str
    kind: Kind
    make: Callable[[Path], tuple[list[Path], Truth | None]]
    faultless: bool = True
    untrue: str = ""


def recordings() -> Path:
    """The folder of the open recordings."""
    return Path(os.environ.get("BOTTOMLOCK_RECORDINGS", ROOT.parent / "shared" / "data"))


def rows() -> list[Row]:
    """Every row whose inputs are here."""
    recorded = [row for name, make in RECORDED.items() if name not in absent() for row in make()]
    return [*_right(), *_cases(), *_mistakes(), *_shipped(), *recorded]


def absent() -> list[str]:
    """Recordings that are not here."""
    return [name for name in RECORDED if not (recordings() / name).is_dir()]


def local(latitude_deg: Floats, longitude_deg: Floats, home: tuple[float, float]) -> tuple[Floats, Floats]:
    """North and east, m, of positions within a few kilometres of a place."""
    along, across = radii_m(np.asarray(np.deg2rad(home[0])))
    north = np.deg2rad(latitude_deg - home[0]) * along
    return north, np.deg2rad(longitude_deg - home[1]) * across * np.cos(np.deg2rad(home[0]))


# Dives of tests/dive.py.


DEEP = {"depth", "bag", "driver_bag", "one_table"}
"""Files with a depth."""


@cache
def _drawn(options: tuple[tuple[str, Any], ...]) -> dives.Dive:
    return dives.drawn_dive(**dict(options))


def _dive(
    kind: Kind,
    name: str,
    words: str,
    fault: str = "nothing",
    *,
    faultless: bool = False,
    untrue: str = "",
    geometry: str = "waterlinked_a50",
    **options: Any,  # noqa: ANN401 - of `dives.drawn_dive`
) -> Row:
    options = {"seed": 3, "seconds": 180.0, "imu_hz": 25.0, "geometry": geometry} | options

    def make(folder: Path) -> tuple[list[Path], Truth]:
        held = dives.FAULTS[fault](dives.tables(_drawn(tuple(sorted(options.items())))))
        files = write(held, folder, words, geometry=geometry)
        true = held["truth"]
        truth = Truth(
            true["time_s"].to_numpy(), true["north"].to_numpy(), true["east"].to_numpy(),
            down_m=true["down"].to_numpy() if DEEP & set(words.split()) else None,
            home=(dives.LATITUDE_DEG, dives.LONGITUDE_DEG), absolute=bool({"gps", "nav"} & set(words.split())),
        )  # fmt: skip
        return files, truth

    return Row(f"{kind}: {name}", kind, make, faultless, untrue)


def _right() -> Iterator[Row]:
    """Logs without a fault, which must not be refused or called wrong."""
    right, velocity = partial(_dive, "right", faultless=True), "imu velocity depth ahrs"
    beams = "imu waterlinked-json depth ahrs"
    for seed in (3, 4, 5):
        yield right(f"velocity, dive {seed}", velocity, seed=seed)
        yield right(f"velocity, gps, dive {seed}", f"{velocity} gps", seed=seed)
        yield right(f"beams of json, dive {seed}", beams, seed=seed)
        yield right(f"bag, dive {seed}", "bag", seed=seed)
    yield right("beams of json, gps", f"{beams} gps")
    yield right("beams of PD0", "imu pd0 depth ahrs", geometry="teledyne_20")
    yield right("beams as a table, gps", "imu beams depth ahrs gps")
    yield right("velocity, IMU alone", "imu velocity")
    yield right("calm dive of 420 s", velocity, lively=0.3, seconds=420.0)
    yield right("dive of 60 s", velocity, seconds=60.0)
    for order in ("q0 to q3, scalar last", "q1 to q4, scalar first"):
        yield right(order, velocity, order)


def _cases() -> Iterator[Row]:
    """Kinds of logs that people have reported."""
    case = partial(_dive, "case")
    velocity, json = "imu velocity depth ahrs", "imu waterlinked-json depth ahrs"
    yield case("01 one table with blanks", "one_table", faultless=True)
    yield case("01 one table with blanks, beams", "one_table_beams", faultless=True)
    yield case("02 a column of intervals", velocity, "intervals for times")
    yield case("04 zeros when lost", velocity, "zeros for lost velocities")
    yield case("04 zeros when lost, 420 s", velocity, "zeros for a minute", seconds=420.0)
    yield case("05 code -32.768", velocity, "-32.768 for lost velocities")
    yield case("05 code -32.768, 420 s", velocity, "-32.768 for lost velocities", seconds=420.0)
    yield case("06 pressure of the hull", "bag", "hull pressure")
    yield case("07 frozen depth", json, "frozen depth")
    yield case("07 depth jumps", json, "depth jumps")
    yield case("07 depth drifts, gps", velocity + " gps", "depth drifts")
    yield case("07 depth drifts, no IMU", "velocity depth ahrs gps", "depth drifts")
    yield case("08 compass jumps", json, "compass jumps", seconds=240.0)
    yield case("08 compass jumps, gps", json + " gps", "compass jumps", seconds=240.0)
    for seed in (3, 6, 7):
        yield case(f"09 dead reckoning nearer, dive {seed}", json + " nav", seed=seed, faultless=True)
    yield case("10 driver with 0 m/s at -1 m", "driver_bag")
    yield case("13 course before heading", json, "course before heading", sway_mps=0.25)
    yield case("14 identity for an attitude", "bag", "identity for an attitude")
    yield case("15 stamps of 0", "bag", "no stamps of the DVL")
    yield case("16 GPS time", json, "DVL on GPS time")
    yield case("17 True and False", velocity, "flags as True and False", faultless=True)
    yield case("18 beams and velocity in one table", "imu echo depth ahrs", faultless=True)
    yield case("20 lever arm", json, seconds=420.0, lever_m=(0.9, 0.3, 0.1))
    yield case("20 lever arm, IMU of 100 Hz", json, seconds=420.0, imu_hz=100.0, lever_m=(0.9, 0.3, 0.1))
    yield case("22 clock set after 40 s", json, "clock set after 40 s")
    names = "none of its columns has a known name"
    yield case("23 date in six columns", "imu civil", untrue=r"no file holds a DVL.*dvl_second.csv: velocity")
    yield case("23 heading alone", json.replace("ahrs", "heading"), untrue=names)
    yield case("23 depth in feet", velocity, "depth in feet")
    yield case("23 array of JSON", "imu array", untrue="truncated")
    yield case("23 UTF-16", "imu utf16", untrue="no known format")
    yield case("23 topics as columns", "imu topics depth ahrs", untrue=names)
    yield case("23 echo without names", "imu bare depth ahrs", untrue=r"ros2_echo.csv: imu|" + names)
    yield case("23 NQ.RES", "imu nqres depth ahrs", untrue=r"nqres.log: imu")
    yield case("29 DVL looks forward", json, mounting_rpy_deg=(-90.0, 0.0, -90.0))
    yield case("29 DVL looks forward, velocity", velocity, mounting_rpy_deg=(-90.0, 0.0, -90.0))


def _mistakes() -> Iterator[Row]:
    """Mistakes of users, in inputs that are right but for them."""
    mistake, velocity = partial(_dive, "mistake"), "imu velocity depth ahrs"
    for fault in (
        "deg/s named rad/s", "rad/s named deg/s", "IMU in g named m/s2", "IMU axes exchanged", "IMU with z up",
        "gyro z reversed", "dropped readings", "DVL clock 1.5 s late", "velocities 8 % too large", "DVL times in ms",
        "radians named degrees", "heading from east", "pressure named depth", "depth upwards",
        "velocities in feet a second", "velocity forward, left, up", "velocity forward, left, down",
    ):  # fmt: skip
        yield mistake(fault, velocity, fault)
    swapped = "beams 2 and 3 exchanged"
    yield mistake(swapped, "imu waterlinked-json depth ahrs", swapped)
    yield mistake(f"{swapped}, table", "imu beams depth ahrs", swapped)
    yield mistake("magnetic heading, gps", velocity + " gps", "magnetic heading")
    yield mistake("magnetic heading", velocity, "magnetic heading")
    yield mistake("velocities 8 % too large, gps", velocity + " gps", "velocities 8 % too large")
    mirrored, dead = "velocity forward, left, down", "beams 1 and 2 dead"
    yield mistake(f"{mirrored}, gps", velocity + " gps", mirrored)
    yield mistake("beam 1 dead, table", "imu beams depth ahrs", "beam 1 dead")
    yield mistake(f"{dead}, gps", "imu waterlinked-json depth ahrs gps", dead, seed=5)
    swapped = "latitude and longitude exchanged"
    yield mistake(swapped, velocity + " gps", swapped)
    yield mistake("heading from east, gps", velocity + " gps", "heading from east")
    yield mistake("beams of 30 deg, geometry unknown", "imu beams depth ahrs", geometry="teledyne_30")
    yield mistake("DVL turned by 30 deg", velocity, mounting_rpy_deg=(0.0, 0.0, 30.0))
    yield mistake("DVL turned by 90 deg", velocity, mounting_rpy_deg=(0.0, 0.0, 90.0))
    yield mistake("lever arm, velocity", velocity, lever_m=(0.9, 0.3, 0.1), seconds=420.0)


# Recordings.


def _shipped() -> Iterator[Row]:
    """`data/logs`: a simulated survey with its truth, a vehicle in a pool without one."""
    survey, pool = ROOT / "data" / "logs" / "survey_dive", ROOT / "data" / "logs" / "robosub"

    def simulated(folder: Path, *, names: str) -> tuple[list[Path], Truth]:
        true = pl.read_csv(survey / "truth.csv")
        place = [true[f"{axis}_m"].to_numpy() for axis in ("north", "east", "down")]
        seconds = true["time_ns"].to_numpy() * 1e-9
        truth = Truth(seconds, place[0], place[1], place[2], absolute="usbl.csv" in names)
        return _copied(folder, survey, names), truth

    for name, names in {
        "with acoustic positions": "dvl.pd0 imu.parquet depth.csv compass.csv usbl.csv",
        "without positions": "dvl.pd0 imu.parquet depth.csv compass.csv",
    }.items():
        yield Row(f"survey_dive: {name}", "recording", partial(simulated, names=names))
    names = "night2_imu.csv night2_ahrs.csv night2_depth.csv night2_dvl.csv"
    yield Row("robosub", "recording", lambda f: (_copied(f, pool, names), None))


def _copied(folder: Path, source: Path, names: str) -> list[Path]:
    """Copies of files, so that a case beside them can be written."""
    return [Path(shutil.copy(source / name, folder)) for name in names.split()]


@cache
def _converted(name: Literal["stpere", "glider"]) -> Mapping[str, pl.DataFrame]:
    """The tables of a dive as its users would hold them."""
    with TemporaryDirectory() as folder:
        getattr(recorded_dives, name)(recordings(), Path(folder))
        return {path.stem: pl.read_csv(path) for path in Path(folder).glob("*.csv")}


def _of_gps(gps: pl.DataFrame, *, absolute: bool, sd_m: float) -> Truth:
    latitude, longitude = gps["latitude"].to_numpy(), gps["longitude"].to_numpy()
    home = float(latitude[0]), float(longitude[0])
    return Truth(
        gps["time"].to_numpy(), *local(latitude, longitude, home), home=home, absolute=absolute, sd_m=sd_m
    )


def _tables_of(name: Literal["stpere", "glider"], words: str, begin: float, end: float, sd_m: float) -> Callable[
    [Path], tuple[list[Path], Truth]
]:  # fmt: skip
    """Maker of the row of a section, s from the first DVL record."""

    def make(folder: Path) -> tuple[list[Path], Truth]:
        first = float(_converted(name)["dvl"]["time"][0])
        within = pl.col("time").is_between(first + begin, first + end)
        tables = {one: table.filter(within) for one, table in _converted(name).items()}
        files = [folder / f"{one}.csv" for one in words.split()]
        for file in files:
            tables[file.stem].write_csv(file, float_precision=9)
        return files, _of_gps(tables["gps"], absolute="gps" in words, sd_m=sd_m)

    return make


AIDED = [
    (f"{dvl}{gps}", f"{title}{gps and ', gps'}")
    for dvl, title in (("dvl", "velocity"), ("dvl_beams", "beams"))
    for gps in (" gps", "")
]
"""Files of a DVL and of positions, and their names in that of a row."""


def _stpere() -> Iterator[Row]:
    """Whole, in sections of 300 s, and in sections of 100 s of every second hundred."""
    sections = [(0.0, 1700.0), *((300.0 * k, 300.0 * k + 300.0) for k in range(5))]
    sections += [(200.0 * k, 200.0 * k + 100.0) for k in range(9)]
    for begin, end in sections:
        for words, title in AIDED:
            make = _tables_of("stpere", f"imu ahrs {words}", begin, end, 1.0)
            yield Row(f"stpere {begin:.0f} to {end:.0f} s, {title}", "recording", make)
    # As the instruments wrote it: the MTi in its own axes, beside a DVL in the vehicle's.
    for gps in (" gps", ""):
        make = _tables_of("stpere", f"mti dvl{gps}", 0.0, 1700.0, 1.0)
        yield Row(f"stpere, MTi in its own axes{gps and ', gps'}", "recording", make)


def _glider() -> Iterator[Row]:
    for words, title in AIDED:
        make = _tables_of("glider", f"attitude depth {words}", -60.0, 1e5, 5.0)
        yield Row(f"glider, {title}", "recording", make)


def _boat() -> Iterator[Row]:
    def make(folder: Path, *, words: str) -> tuple[list[Path], Truth]:
        source = recordings() / "sontek_caputh"
        truth = _of_gps(pl.read_csv(source / "gps.csv"), absolute="gps" in words, sd_m=0.5)
        return _copied(folder, source, " ".join(f"{one}.csv" for one in words.split())), truth

    for words, title in AIDED:
        yield Row(f"boat, {title}", "recording", partial(make, words=f"attitude {words}"))


def _rov() -> Iterator[Row]:
    """Beside the estimate of the vehicle's own filter, which is no other instrument's."""
    source, name = recordings() / "bluerov2_a50_bin", "00000029_filtered.BIN"
    yield Row("bluerov2 log", "recording", lambda folder: (_copied(folder, source, name), None))


def _akit() -> Iterator[Row]:
    sets = {
        "imu dvl nav": "all in one table of navigation",
        "imu dvl gps": "positions alone",
        "imu dvl ahrs depth": "no positions",
        "imu dvl depth": "no attitude",
        "dvl ahrs": "no IMU",
        "imu beams ahrs depth": "beams, no positions",
        "imu beams nav": "beams, navigation",
    }
    for section in (1, 3, 6, 10):
        for words, title in sets.items():
            # The tilt of these beams stands nowhere, and "no" that names it is right.
            known = "beams" not in words
            yield Row(f"akit {section:02d}, {title}", "recording", _akit_made(section, words), known)
    for section in (2, 7):
        yield Row(f"akit {section:02d}, as published", "recording", _akit_made(section, ""))


def _akit_made(section: int, words: str) -> Callable[[Path], tuple[list[Path], Truth]]:
    """A section with the clocks that its README found, in the axes as published; without words the files themselves."""

    def make(folder: Path) -> tuple[list[Path], Truth]:
        source = recordings() / "akit_snapir"
        names = [f"imu_{section:02d}.parquet", f"dvl_{section:02d}.csv", f"gt_{section:02d}.csv"]
        imu = pl.read_parquet(source / names[0])
        dvl, nav = (pl.read_csv(source / name) for name in names[1:])
        start_s = dives.EPOCH_S if words else 0.0
        lon, lat, down = nav.to_numpy().T[1], nav.to_numpy().T[2], -nav.to_numpy().T[3]
        home = float(np.rad2deg(lat[0])), float(np.rad2deg(lon[0]))
        place = local(np.rad2deg(lat), np.rad2deg(lon), home)
        seconds = np.arange(float(nav.height)) + LAG_S[section] + start_s
        absolute = not words or bool({"nav", "gps"} & set(words.split()))
        truth = Truth(seconds, *place, home=home, absolute=absolute, sd_m=0.3)
        if not words:
            return _copied(folder, source, " ".join(names)), truth
        of_dvl = np.arange(dvl.height) + 1.03 + start_s
        v = dvl.to_numpy()[:, 1:]
        azimuth, tilt = np.deg2rad([45.0, 135.0, 225.0, 315.0]), np.full(4, np.deg2rad(30.0))
        level = np.sin(tilt)
        beams = v @ np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.cos(tilt)])
        of_nav = ("roll_deg", "pitch_deg", "heading_deg")
        angles = dict(zip(of_nav, np.rad2deg(nav.to_numpy().T[7:10]), strict=True))
        places = {"latitude": np.rad2deg(lat), "longitude": np.rad2deg(lon)}
        of_imu = {"time_s": np.arange(imu.height) * 0.01 + start_s}
        held = {
            "imu": pl.DataFrame(of_imu).hstack(imu),
            "dvl": pl.DataFrame({"time_s": of_dvl} | dict(zip(("vx", "vy", "vz"), v.T, strict=True))),
            "beams": pl.DataFrame({"time_s": of_dvl} | {f"beam{k + 1}_mps": one for k, one in enumerate(beams.T)}),
            "nav": pl.DataFrame({"time_s": seconds} | places | {"height": -down} | angles),
            "gps": pl.DataFrame({"time_s": seconds} | places),
            "ahrs": pl.DataFrame({"time_s": seconds} | angles),
            "depth": pl.DataFrame({"time_s": seconds, "depth_m": down}),
        }  # fmt: skip
        return write(held, folder, words), truth

    return make


RECORDED: dict[str, Callable[[], Iterator[Row]]] = {
    "stpere_ictineu": _stpere,
    "akit_snapir": _akit,
    "sontek_caputh": _boat,
    "glider_pathfinder": _glider,
    "bluerov2_a50_bin": _rov,
}
"""What makes the rows of each folder of recordings."""
