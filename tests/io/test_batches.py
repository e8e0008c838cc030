"""What is read in columns, or once for many equal lines, is what would be read one by one."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bottomlock.io import json_lines, lines, sentences
from bottomlock.io.account import Account
from bottomlock.io.dollar_sentences import Names

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


@given(st.text("a \t\r\n\0\x0b", max_size=60).map(str.encode))
def test_lines_are_cut_alike_alone_and_in_a_file(text: bytes) -> None:
    """A short file is cut line by line, a longer one at once."""
    short = list(lines.batches(text))
    found = [one for batch in lines.batches(text + b"\n" + b" \n" * 2000) for one in _told(batch)]
    assert [one for batch in short for one in _told(batch)] == found


def _told(batch: lines.Lines) -> list[tuple[int, int, bytes]]:
    return list(zip(batch.number.tolist(), batch.start.tolist(), batch.texts(), strict=True))


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


def test_a_key_given_twice_at_any_depth_is_damage() -> None:
    """Nothing of such an object is kept; a colon in a text is no key."""
    for text in (
        '{"a":1,"a":1}',
        '{"b":[{"a":1,"a":1}]}',
        '{"b":{"c":{"a":1,"a":1}}}',
        '{"b":[[{"a":1,"a":1}]]}',
    ):
        assert json_lines.parse(text.encode()) == json_lines.Line((), damaged=True)
    assert json_lines.parse(b'{"b":"c:d"}') == json_lines.Line(({"b": "c:d"},), damaged=False)


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


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (Names(b"PNOR", letters=(0, 3), digits=2, longest=400), rb"PNOR[A-Z]{0,3}[0-9]{0,2}"),
        (Names(b"DV", letters=(2, 4), digits=0, longest=600), rb"DV[A-Z]{2,4}"),
    ],
)
def test_names_of_sentences(names: Names, pattern: bytes) -> None:
    """Against the regular expression of the name; the same name has the same number, another one another."""
    tails = [
        b"",
        b"A",
        b"BT",
        b"BT0",
        b"BT12",
        b"BTX",
        b"BTXY",
        b"BTXYZ",
        b"B0T",
        b"123",
        b"1",
        b"bt",
        b"B\0",
        b"B\0\0",
    ]
    words = [names.prefix[:-1], *(names.prefix + tail for tail in tails), b"X" + names.prefix]
    raw = np.frombuffer(b",".join(words), dtype=np.uint8)
    length = np.array([len(word) for word in words])
    start = np.cumsum(length + 1) - length - 1
    code, good = names.read(raw, start, length)
    assert good.tolist() == [re.fullmatch(pattern, word) is not None for word in words]
    assert len(set(code[good].tolist())) == good.sum()
