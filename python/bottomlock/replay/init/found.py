"""Streams in a table: which columns are IMU, attitude, depth, position or velocity, and when their rows are."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.io.columns import FLAG_WORDS, NS_OF, column_names, unix_times
from bottomlock.recordings.streams import Flags, Floats, Integers
from bottomlock.replay.init import names
from bottomlock.replay.init.any_table import AnyTable
from bottomlock.replay.init.names import named, seconds_and_nanoseconds, split_unit, time_unit

EPOCHS = (("s", 5e8, 5e9), ("ms", 5e11, 5e12), ("us", 5e14, 5e15), ("ns", 5e17, 5e18))
"""Unix times from 1985 to 2128 in each unit."""
RATES_HZ = {"imu": (8.0, 4000.0), "dvl": (0.05, 40.0)}
ANY_RATE_HZ = (0.02, 1000.0)
MOST_ABSENT = 0.05
"""Part of the cells of a column of dates that may hold none."""
_ISO = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d")
LEAST_EVEN, FEW, MOST_OFF_S = 50, 0.01, 1.1
"""Rows, part of them that does not rise, and greatest deviation from an even rate, s, of rows that count as even."""


@dataclass(frozen=True, eq=False)
class Times:
    """Times of a table's rows.

    Attributes:
        time_ns: (n,), as the file has them, or None without any.
        column, unit: as a case's clock names them; column "" where the table is written again.
        why: how the unit was found.
        epoch: whether they are Unix times.
        rate_hz, within_s: of rows at an even rate whose stamps are coarse or jitter, and by how much they do; None
            where the stamps are the times.
    """

    time_ns: Integers | None
    column: str = ""
    unit: str = "ns"
    why: str = ""
    epoch: bool = False
    rate_hz: float | None = None
    within_s: float = 0.0


def evened(times: Times, copies: Flags | None = None) -> Times:
    """The times, or those of an even rate where more than a few stamps do not rise and no row is missing.

    A few rows that repeat a time or go back are left to the clock, which leaves them out and says which; so are copies.

    Args:
        times: as stamped.
        copies: (n,) rows that hold what the row before holds, time included; none by default.
    """
    time_ns = times.time_ns
    if time_ns is None or len(time_ns) < LEAST_EVEN:
        return times
    late = np.diff(time_ns) <= 0
    if float((late if copies is None else late & ~copies[1:]).mean()) <= FEW:
        return times
    row, since_ns = np.arange(len(time_ns)), time_ns - time_ns[0]
    step_ns, begin_ns = (float(one) for one in np.polyfit(row, since_ns, 1))
    off_ns = since_ns - begin_ns - step_ns * row
    within_s = float(np.abs(off_ns - np.median(off_ns)).max()) * 1e-9
    if step_ns <= 0.0 or within_s > MOST_OFF_S:
        return times
    rate_hz = float(f"{1e9 / step_ns:.8g}")
    even = np.round(np.arange(len(time_ns)) * (1e9 / rate_hz)).astype(np.int64)
    why = (
        f"{times.why}; the stamps are coarse or jitter by up to {within_s:.2g} s, "
        f"and the rows are even at {rate_hz:.4g} Hz"
    )
    even += int(np.median(time_ns - even))
    return replace(times, time_ns=even, why=why, rate_hz=rate_hz, within_s=float(f"{1.2 * within_s:.2g}"))


@dataclass(frozen=True, eq=False)
class Found:
    """A stream in a table.

    Attributes:
        kind: "imu", "attitude", "depth", "pressure", "geodetic", "local", "velocity".
        table: where it is.
        columns: role to column name.
        units: role to unit as the name states it, "" where it does not.
        times: of the rows.
        extra: further columns by role, for instance velocities beside a position.
    """

    kind: str
    table: AnyTable
    columns: dict[str, str]
    units: dict[str, str]
    times: Times
    extra: dict[str, str] = field(default_factory=dict)

    def values(self, *roles: str) -> Floats:
        """(n, roles) the columns as numbers, NaN where a cell is none."""
        chosen = {**self.columns, **self.extra}
        return np.stack([numbers(self.table.frame[chosen[role]]) for role in roles], axis=1)


def numbers(series: pl.Series) -> Floats:
    """A column as floats, NaN where a cell is no number; the words of a flag are 1 and 0."""
    found = series.cast(pl.Float64, strict=False)
    if series.dtype == pl.String and found.null_count() > series.null_count():
        words = series.str.strip_chars().str.to_lowercase().replace(FLAG_WORDS)
        found = words.cast(pl.Float64, strict=False)
    return np.asarray(found.fill_null(np.nan).to_numpy(), dtype=np.float64)


def find_streams(table: AnyTable) -> list[Found]:
    """Every stream of a table, by the names of its columns."""
    triples: dict[tuple[str, str], dict[int, str]] = {}
    single: dict[str, str] = {}
    units: dict[str, str] = {}
    for name in table.frame.columns:
        what = named(name, table.units.get(name, ""))
        if what is None or not np.isfinite(numbers(table.frame[name])).any():
            continue
        units[name] = what.unit
        bare = split_unit(name)[0]
        stem = (
            re.sub(r"[xyzabcw0-9]", "", bare.lower()) + "|" + re.sub(r"\D", "", re.sub(r"\d\D*$", "", bare))
        )
        if what.quantity in _GROUPS:
            triples.setdefault((what.quantity, stem), {}).setdefault(what.component, name)
        else:
            single.setdefault(what.quantity, name)
    groups = {quantity: _triple(triples, quantity) for quantity in _GROUPS}
    found: list[tuple[str, dict[str, str], dict[str, str]]] = []
    found += _imu(groups, single)
    found += _others(table, groups, single)
    kinds = [kind for kind, _, _ in found]
    times = table_times(table, "imu" if "imu" in kinds else "dvl" if kinds == ["velocity"] else "")
    streams = []
    for kind, columns, extra in found:
        of = {role: units.get(name, "") for role, name in {**columns, **extra}.items()}
        stream = Found(kind, table, columns, of, times, extra)
        streams.append(_let_go(stream) if "imu" in kinds and kind != "imu" else stream)
    return streams


HELD = 0.5
"""Part of the rows of an IMU that repeat another sensor's reading, from which the table holds it until the next."""


def _let_go(found: Found) -> Found:
    """A stream without the rows that hold its last reading, as a logger fills the rows of a faster sensor."""
    values = found.values(*found.columns)
    known = np.isfinite(values).all(axis=1)
    rows = np.flatnonzero(known)
    fresh = np.concatenate([[True], (np.diff(values[rows], axis=0) != 0.0).any(axis=1)])[: len(rows)]
    if not len(rows) or 1.0 - float(fresh.mean()) < HELD:
        return found
    words = (
        f"{len(rows) - int(fresh.sum())} of {len(rows)} rows hold the reading before them: they are left out"
    )
    table = replace(found.table, frame=found.table.frame[rows[fresh]], plain=False, remark=words)
    return replace(found, table=table, times=table_times(table, "dvl" if found.kind == "velocity" else ""))


_GROUPS = (
    names.FORCE, names.OMEGA, names.VELOCITY_INCREMENT, names.ANGLE_INCREMENT, names.VELOCITY, names.QUATERNION,
    names.NUMBERED,
)  # fmt: skip
OFF_UNIT = 0.1
"""Median departure of the norm of four numbered columns from 1, from which they are no quaternion."""


def _triple(triples: dict[tuple[str, str], dict[int, str]], quantity: str) -> tuple[str, ...] | None:
    """The columns of a quantity: the first group with all components."""
    wanted = 4 if quantity in {names.QUATERNION, names.NUMBERED} else 3
    for (what, _), columns in triples.items():
        if what != quantity or len(columns) < wanted:
            continue
        first = 1 if 0 not in columns else 0
        if all(first + k in columns for k in range(wanted)):
            return tuple(columns[first + k] for k in range(wanted))
    return None


_Streams = list[tuple[str, dict[str, str], dict[str, str]]]


def _imu(groups: dict[str, tuple[str, ...] | None], single: dict[str, str]) -> _Streams:
    force, omega = groups[names.FORCE], groups[names.OMEGA]
    if omega is None and {"rollrate", "pitchrate", "yawrate"} <= single.keys():
        omega = (single["rollrate"], single["pitchrate"], single["yawrate"])
    extra = {}
    moved, turned = groups[names.VELOCITY_INCREMENT], groups[names.ANGLE_INCREMENT]
    if moved and turned:
        force, omega = moved, turned
        extra = {"increments": force[0]} | ({"interval": single["interval"]} if "interval" in single else {})
    if force is None or omega is None:
        return []
    columns = {f"force{k}": force[k] for k in range(3)} | {f"omega{k}": omega[k] for k in range(3)}
    return [("imu", columns, extra)]


def _others(table: AnyTable, groups: dict[str, tuple[str, ...] | None], single: dict[str, str]) -> _Streams:
    found: _Streams = []
    angles: dict[str, str] = {part: single[part] for part in ("roll", "pitch", "yaw") if part in single}
    quaternion, numbered = groups[names.QUATERNION], groups[names.NUMBERED]
    if len(angles) == 3:
        found.append(("attitude", angles, {}))
    elif quaternion:
        found.append(("attitude", {f"q{k}": quaternion[k] for k in range(4)}, {}))
    elif numbered and _is_unit(table, numbered):
        found.append(("attitude", {f"q{k}": numbered[k] for k in range(4)}, {"numbered": numbered[0]}))
    ned = [single.get(f"velocity_{axis}") for axis in ("north", "east", "down")]
    beside = {f"ned{k}": name for k, name in enumerate(ned) if name} if all(ned) else {}
    velocity = groups[names.VELOCITY]
    if velocity is None and {"surge", "sway", "heave"} <= single.keys():
        velocity = (single["surge"], single["sway"], single["heave"])
    body = {f"v{k}": velocity[k] for k in range(3)} if velocity else {}
    moving = "velocity", body, {"valid": single["valid"]} if "valid" in single else {}
    if body and groups[names.FORCE]:
        # A logger's table of all sensors; beside positions alone it is that of an estimate.
        found.append(moving)
        body = {}
    if {"latitude", "longitude"} <= single.keys():
        place = {"latitude": single["latitude"], "longitude": single["longitude"]}
        found.append(
            ("geodetic", place, beside | ({"height": single["height"]} if "height" in single else {}) | body)
        )
    elif {"north", "east"} <= single.keys():
        place = {"north": single["north"], "east": single["east"]}
        down = single.get("down", single.get("depth"))
        found.append(("local", place, ({} if down is None else {"down": down}) | beside | body))
    elif body:
        found.append(moving)
    depth = single.get("depth")
    if (
        depth is not None
        and (depth.lower() != "data" or "depth" in table.label)
        and not any(kind == "local" for kind, _, _ in found)
    ):
        found.append(("depth", {"depth": depth}, {}))
    elif "pressure" in single and depth is None:
        found.append(("pressure", {"pressure": single["pressure"]}, {}))
    return found


def _is_unit(table: AnyTable, columns: tuple[str, ...]) -> bool:
    """Whether columns have the norm of a quaternion."""
    size = np.linalg.norm([numbers(table.frame[name]) for name in columns], axis=0)
    return bool(abs(float(np.nanmedian(size)) - 1.0) < OFF_UNIT)


def table_times(table: AnyTable, kind: str) -> Times:
    """Times of a table's rows, even where their stamps are coarse: see `evened`.

    Raises:
        DataError: for a column of times with another kind of dates.
    """
    times = _stamps(table, kind)
    late = times.time_ns is not None and (np.diff(times.time_ns) <= 0).any()
    return evened(times, _copies(table.frame) if late else None)


def _copies(frame: pl.DataFrame) -> Flags:
    """(n,) rows that are the same as the row before."""
    same = pl.all_horizontal(pl.all().eq_missing(pl.all().shift(1)))
    return np.asarray(frame.select(same).to_series().fill_null(value=False).to_numpy(), dtype=np.bool_)


SHUFFLED = 0.1
"""Part of the rows that go back, and of those far from their place, from which they are put in the order of their
times."""


def in_order(table: AnyTable) -> AnyTable:
    """The table with its rows by their times, where they are in no order and each has a time of its own."""
    if table.part:
        return table
    try:
        time_ns = _stamps(table, "").time_ns
    except DataError:
        return table
    if time_ns is None or len(time_ns) < LEAST_EVEN:
        return table
    order = np.argsort(time_ns, kind="stable")
    back = float((np.diff(time_ns) < 0).mean())
    # Stamps that jitter only change places with their neighbours: their rows are in order.
    astray = float((np.abs(order - np.arange(len(order))) > LEAST_EVEN).mean())
    if min(back, astray) < SHUFFLED or len(np.unique(time_ns)) < (1.0 - FEW) * len(time_ns):
        return table
    words = f"{100.0 * back:.0f} % of the rows go back in time: all are sorted by it"
    frame = table.frame[order]
    return replace(table, frame=frame, plain=False, remark="; ".join(filter(None, (table.remark, words))))


def _stamps(table: AnyTable, kind: str) -> Times:
    """Times of a table's rows: the best column by name, as ISO 8601 dates, or its unit by name, epoch or rate.

    Raises:
        DataError: for a column of times with another kind of dates.
    """
    frame = table.frame
    if table.part and frame.schema.get("time_ns") == pl.Int64:
        # A log's own: nothing is left to guess.
        stamps = np.asarray(frame["time_ns"].to_numpy(), dtype=np.int64)
        return Times(stamps, "time_ns", epoch=bool(np.median(stamps) > EPOCHS[-1][1]))
    pair = seconds_and_nanoseconds(frame.columns)
    if pair is not None:
        whole, part = (numbers(frame[name]) for name in pair)
        time_ns = np.nan_to_num(whole).astype(np.int64) * 1_000_000_000 + np.nan_to_num(part).astype(np.int64)
        return Times(time_ns, why=f"{pair[0]} and {pair[1]} together", epoch=bool(whole[0] > 5e8))
    candidates = [
        (name, unit)
        for name in frame.columns
        if (unit := time_unit(name, table.units.get(name, ""))) is not None
    ]
    # A measurement's own stamp before the time of the logger (%time), and one with a unit before one without.
    candidates.sort(key=lambda one: ("stamp" not in one[0].lower(), one[1] == "", one[0].startswith("%")))
    for name, unit in candidates:
        series = frame[name]
        if isinstance(series.dtype, (pl.Datetime, pl.Duration)):
            time_ns = np.asarray(series.dt.cast_time_unit("ns").cast(pl.Int64).to_numpy(), dtype=np.int64)
            return Times(time_ns, why=f"times of {name}", epoch=series.dtype == pl.Datetime)
        written = iso_times(series)
        if written is not None:
            return Times(written, why=f"dates of {name}", epoch=True)
        value = numbers(series)
        if np.isfinite(value).mean() > 0.9 and np.nanmax(value) > np.nanmin(value):
            return _numeric_times(series, value, name, unit, kind, table.path)
    for name, _ in candidates:
        cell = str(frame[name].first(ignore_nulls=True) or "").strip()
        if cell and not np.isfinite(numbers(frame[name])).any():
            raise DataError(
                f"is '{cell}' in the first row (columns: {column_names(frame)})",
                place=table.path,
                key=f"column '{name}'",
                expected="a number, or an ISO 8601 date and time such as 2024-05-01T12:00:00.5Z",
            )
    return Times(None, why="no column of times")


def iso_times(series: pl.Series) -> Integers | None:
    """Unix times, ns, of a column of dates and times, as `unix_times`; None for other columns."""
    if series.dtype != pl.String or not _ISO.match(str(series.first(ignore_nulls=True) or "").strip()):
        return None
    parsed = unix_times(series)
    if parsed.null_count() > MOST_ABSENT * len(parsed):
        return None
    filled = parsed.fill_null(strategy="forward").fill_null(strategy="backward")
    return np.asarray(filled.to_numpy(), dtype=np.int64)


def _numeric_times(series: pl.Series, value: Floats, name: str, unit: str, kind: str, path: Path) -> Times:
    low, high = RATES_HZ.get(kind, ANY_RATE_HZ)
    middle = float(np.nanmedian(value))
    steps = np.diff(value[np.isfinite(value)])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else np.nan
    if float((steps == 0.0).mean()) > 0.5:
        # Whole seconds, or the like: the rate is that of the rows.
        step = float(steps.mean()) or step
    epoch = next((u for u, least, most in EPOCHS if least < middle < most), None)
    if epoch is not None and (not unit or unit == epoch):
        why = f"a median of {middle:.4g} is a Unix time in {epoch}"
        return Times(_to_ns(series, value, epoch), name, epoch, why, epoch=True)
    rate_hz = (len(value) - 1) / max(float(np.nanmax(value) - np.nanmin(value)), 1e-300)
    if rate_hz > RATES_HZ["imu"][1] and unit in {"", "s"}:
        raise DataError(
            f"is {value[0]:.10g} in the first row, and rises by {1.0 / rate_hz:.2g} from row to row",
            place=path,
            key=f"column '{name}'",
            expected="a time in s, ms, us or ns, or ISO 8601 dates",
            hint="are these days? Multiply by 86400",
        )
    fitting = [u for u in ("s", "ms", "us", "ns") if low <= NS_OF["s"] / (step * NS_OF[u]) <= high]
    chosen = unit if unit in fitting else (fitting[0] if fitting else (unit or "s"))
    why = f"a median step of {step:.4g} {chosen} is {1e9 / (step * NS_OF[chosen]):.4g} Hz"
    if unit and unit != chosen:
        why += f" (its name says {unit}, which would be {1e9 / (step * NS_OF[unit]):.3g} Hz)"
    return Times(_to_ns(series, value, chosen), name, chosen, why)


def _to_ns(series: pl.Series, value: Floats, unit: str) -> Integers:
    if unit == "ns":
        whole = series.cast(pl.Int64, strict=False)
        if whole.null_count() == 0:
            return np.asarray(whole.to_numpy(), dtype=np.int64)
    known = np.where(np.isfinite(value), value, np.nan)
    filled = np.asarray(pl.Series(known).fill_nan(None).forward_fill().backward_fill().to_numpy())
    return np.asarray(np.round(filled * NS_OF[unit]), dtype=np.int64)
