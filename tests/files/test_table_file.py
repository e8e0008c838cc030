"""Tables of a user: damaged Parquet, a library that panics, numbers beyond the type: one line, naming the file."""

import io
from pathlib import Path

import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.files import table_file
from bottomlock.files.table_file import check_regular, read_parquet, read_table_file
from bottomlock.io.beams import Columns, times_as_they_stand
from bottomlock.io.columns import column_numbers
from bottomlock.recordings.stream_sections import Clock
from bottomlock.replay.read_tables import column_stamps

FRAME = pl.DataFrame(
    {"time_ns": range(200), "x": [0.1 * k if k % 7 else None for k in range(200)], "word": ["a", "b"] * 100}
)


@pytest.mark.parametrize("compression", ["uncompressed", "zstd", "snappy", "lz4"])
@pytest.mark.parametrize("rows", [0, 1, 200])
@pytest.mark.parametrize("size", [None, 64])
def test_sound_files_pass(tmp_path: Path, compression: str, rows: int, size: int | None) -> None:
    """Nulls, dictionaries, several row groups and pages, any compression; nested columns as well."""
    path = tmp_path / "a.parquet"
    frame = FRAME.head(rows).with_columns(pl.concat_list("x", "x").alias("nested"))
    frame.write_parquet(path, compression=compression, row_group_size=size, data_page_size=size)  # type: ignore[arg-type]
    assert read_parquet(path).equals(frame)
    assert read_parquet(path, ["x"]).columns == ["x"]


def test_a_count_of_a_page_that_is_wrong_is_found_before_it_is_allocated(tmp_path: Path) -> None:
    """Of a damaged count of values the library asks for 2 EiB, and the process ends."""
    path = tmp_path / "a.parquet"
    FRAME.head(8).select(pl.col("x").fill_null(0.0)).write_parquet(
        path, compression="uncompressed", statistics=False
    )
    whole = path.read_bytes()
    # Header of the data page (field 5): its values as a zigzag number (field 1), then PLAIN.
    at = whole.index(b"\x15\x10\x15\x00", 4)
    for value in (0x11, 0x12, 0x00):
        path.write_bytes(whole[: at + 1] + bytes([value]) + whole[at + 2 :])
        with pytest.raises(DataError, match=r"a\.parquet: is damaged or not Parquet \("):
            read_parquet(path)


@pytest.mark.parametrize("cut", [0, 3, 11, 50, -1, -9, -40])
def test_a_file_that_is_cut_off(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "a.parquet"
    FRAME.write_parquet(path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(DataError) as raised:
        read_parquet(path)
    assert "\n" not in str(raised.value)


def test_more_values_than_the_memory_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A column of one value has few bytes in the file, whatever its length: it is refused before it is unpacked."""
    path = tmp_path / "a.parquet"
    pl.DataFrame({"x": [0.5] * 2_000_000}).write_parquet(path, compression="zstd")
    assert path.stat().st_size < 100_000
    monkeypatch.setattr(table_file, "available_memory_bytes", lambda: 20e6)
    with pytest.raises(DataError, match=r"takes about .* GB of memory"):
        read_parquet(path)


def test_a_panic_of_the_library_is_an_error_of_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A panic is no `Exception`: it would pass every handler."""
    path = tmp_path / "a.parquet"
    FRAME.write_parquet(path)

    def panic(*_: object, **__: object) -> pl.DataFrame:
        raise pl.exceptions.PanicException("assertion failed\nsecond line")

    monkeypatch.setattr(pl, "read_parquet", panic)
    with pytest.raises(DataError, match=r"a\.parquet: cannot be read \(assertion failed\)$"):
        read_parquet(path)


def test_what_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_table_file(tmp_path / "none.csv")
    with pytest.raises(DataError, match="is a folder"):
        read_table_file(tmp_path)
    with pytest.raises(DataError, match="is a pipe or a device"):
        read_table_file(Path("/dev/zero"))
    with pytest.raises(DataError, match="cannot be read"):
        check_regular(Path("a" * 5000))


@pytest.mark.parametrize("value", [2.0**64, 1e300, -1e300])
@pytest.mark.parametrize("unit", ["ns", "s"])
def test_times_beyond_64_bits(value: float, unit: str) -> None:
    """Named by row and column, whether the table holds floats or unsigned integers."""
    table = pl.DataFrame({"time_ns": [0.0, value]})
    columns = Columns.model_validate({"time_unit": unit})
    with pytest.raises(DataError, match="a: row 1: column 'time_ns'"):
        times_as_they_stand(table, columns, "a")
    with pytest.raises(DataError, match=r"a: row 1: column 'time_ns'.*check the unit"):
        column_stamps(table, Clock.model_validate({"column": "time_ns", "unit": unit}), place="a")
    wide = pl.DataFrame({"time_ns": pl.Series([0, 2**64 - 1], dtype=pl.UInt64)})
    with pytest.raises(DataError, match="row 1: column 'time_ns' is 18446744073709551615"):
        times_as_they_stand(wide, Columns(), "a")
    with pytest.raises(DataError, match="row 1: column 'time_ns' is 18446744073709551615"):
        column_stamps(wide, Clock.model_validate({"column": "time_ns", "unit": "ns"}), place="a")
    assert column_numbers(table, "time_ns", "a")[1] == value


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("name", ["c[1]", "a*", "b?", "{x,y}", "**"])
def test_a_name_is_no_pattern(tmp_path: Path, name: str, suffix: str) -> None:
    """The file of that name is read, and not the one that the name as a pattern fits."""
    for stem, value in ((name, 1), ("c1", 2), ("ab", 3), ("bc", 4), ("x", 5)):
        frame = pl.DataFrame({"a": [str(value)]})
        path = tmp_path / f"{stem}{suffix}"
        frame.write_csv(path) if suffix == ".csv" else path.write_bytes(parquet(frame))
    assert read_table_file(tmp_path / f"{name}{suffix}")["a"].to_list() == ["1"]


def test_names_of_columns_stay_on_their_line() -> None:
    """Whatever a spreadsheet or a damaged file has in them."""
    table = pl.DataFrame({"beam1\nmps": [1.0], "\x1b[2J": [2.0]})
    with pytest.raises(
        DataError, match=r"^a: column 'time' is missing \(there are beam1\\x0amps, \\x1b\[2J\)$"
    ):
        column_numbers(table, "time", "a")


def parquet(frame: pl.DataFrame) -> bytes:
    """Its bytes: the library writes no file of such a name."""
    content = io.BytesIO()
    frame.write_parquet(content)
    return content.getvalue()
