"""What is read in columns, or once for many equal lines, is what would be read one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bottomlock.io import json_lines, lines, sentences
from bottomlock.io.account import Account

FIELDS = st.lists(st.text("0123456789+-. eE_naif\t\x0b", max_size=24).map(str.encode), min_size=1, max_size=8)
MANY = 200
"""Copies of a field that make a column of it."""


def _cut(fields: list[bytes]) -> tuple[lines.Lines, np.ndarray, np.ndarray]:
    text = b",".join(fields)
    (batch,) = lines.batches(b"," + text + b",\n")
    end = np.cumsum([len(field) + 1 for field in fields])
    return batch, end - [len(field) for field in fields], end


@pytest.mark.parametrize("copies", [1, MANY])
@given(FIELDS)
@example([b"0" * 23 + b"7", b"9" * 20, b"-" + b"9" * 19, b" 12 ", b"+5", b"1_0", b"1.0"])
def test_numbers_are_read_alike_alone_and_in_columns(copies: int, fields: list[bytes]) -> None:
    """Decimal and whole numbers, blanks, signs, words and digits beyond 64 bits."""
    batch, start, end = _cut(fields * copies)
    wholes = lines.wholes(batch, start, end)
    assert wholes == [sentences.whole(field) for field in fields] * copies
    values, good = lines.numbers(batch.raw, start, end)
    one_by_one = [sentences.number(field) for field in fields] * copies
    assert good.tolist() == [value is not None for value in one_by_one]
    assert values[good].tolist() == [value for value in one_by_one if value is not None]


PIECES = (
    *(
        '{"a":',
        '{"time":',
        '"b":',
        "{",
        "}",
        "[",
        "]",
        ",",
        ":",
        " ",
        "é",
        "1",
        "-0",
        "1.0",
        "2e999",
        "9" * 30,
    ),
    *(
        '"x:y"',
        '"\\u0030"',
        "NaN",
        "-Infinity",
        "true",
        "null",
        '{"a":1,"a":2}',
        '{"c":{"a":[{"b":{"a":1}}]}}',
    ),
)
JSON = st.lists(st.sampled_from(PIECES), max_size=12).map(lambda parts: "".join(parts).strip())


@given(JSON)
def test_the_fast_parser_finds_what_the_standard_one_does(text: str) -> None:
    """Objects, keys given twice, words for infinities, and what stands before or behind."""
    fast, slow = json_lines.parse(text.encode()), json_lines._parse_in_pieces(text)
    assert repr(fast) == repr(slow)


@given(
    st.lists(
        st.sampled_from([b"{}", b'{"v":1}', b'{"k":"x"}{"v":2}', b'{"k":"y"}{"k":"x"}', b"{", b"x"]),
        min_size=1,
    )
)
def test_equal_lines_give_what_each_of_them_would(texts: list[bytes]) -> None:
    """The same objects in the same order, and the same account, reason by reason."""

    def other(found: json_lines.Object) -> str | None:
        return None if "v" in found else str(found.get("k", "reply"))

    together, alone = Account(unit="line"), Account(unit="line")
    objects = list(json_lines.objects(b"\n".join(texts), other, together))
    one_by_one = [
        (k, one)
        for k, text in enumerate(texts, 1)
        for _, one in json_lines.objects(b"\n" * (k - 1) + text, other, alone)
    ]
    assert objects == one_by_one
    assert list(together.to_json().items()) == list(alone.to_json().items())
