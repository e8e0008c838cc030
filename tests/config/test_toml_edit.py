"""Numbers in a user's TOML text are replaced key by key; comments and everything else stay."""

from __future__ import annotations

import tomllib

import pytest

from bottomlock.config.toml_edit import edited
from bottomlock.errors import ScenarioError

TEXT = """# my dive
name = "dive"

[imu]
file = "imu.csv"  # of the logger
other.gyro_bias = 2.0

[imu.errors]  # see the data sheet
noise = 0.5   # guessed: "scatter" = 3
walk = 1e-3

[[what_if]]
name = "noise"
noise = 7.0
# the end
"""


def test_values_are_replaced_and_comments_stay() -> None:
    """A key of the same name in another table is not touched, and an own comment follows the remark."""
    text = edited(TEXT, {"imu.errors.noise": 0.75}, {"imu.errors.noise": "tuned: ± 0.1"}, place="case")
    assert text == TEXT.replace(
        'noise = 0.5   # guessed: "scatter" = 3', 'noise = 0.75  # tuned: ± 0.1 | guessed: "scatter" = 3'
    )
    again = edited(text, {"imu.errors.noise": 0.8}, {"imu.errors.noise": "tuned: ± 0.2"}, place="case")
    assert 'noise = 0.8  # tuned: ± 0.2 | guessed: "scatter" = 3\n' in again


def test_new_keys_go_to_their_tables() -> None:
    """After the last key of a table that is there, and into a new table at the end where there is none."""
    text = edited(
        TEXT,
        {"imu.errors.bias": 1.5, "dvl.errors.scale": 0.7},
        {"imu.errors.bias": "r", "dvl.errors.scale": "r"},
        place="case",
    )
    assert "walk = 1e-3\nbias = 1.5  # r\n\n[[what_if]]" in text
    assert text.endswith("# the end\n\n[dvl.errors]\nscale = 0.7  # r\n")
    assert tomllib.loads(text)["what_if"] == [{"name": "noise", "noise": 7.0}]


def test_a_key_with_dots_is_found() -> None:
    """other.gyro_bias in [imu] is imu.other.gyro_bias."""
    text = edited(TEXT, {"imu.other.gyro_bias": 3.0}, {"imu.other.gyro_bias": "r"}, place="case")
    assert text == TEXT.replace("other.gyro_bias = 2.0", "other.gyro_bias = 3.0  # r")


def test_braces_on_one_line_are_edited() -> None:
    """A key of an inline table is replaced there, or added to it; the comment follows the remark."""
    text = '[imu]\nclock = { column = "t", offset_s = 0.5 }  # host\n'
    again = edited(text, {"imu.clock.offset_s": 0.25}, {"imu.clock.offset_s": "tuned: r"}, place="case")
    assert again == '[imu]\nclock = { column = "t", offset_s = 0.25 }  # tuned: r | host\n'
    text = '[imu]\nclock = { column = "t" }\n'
    again = edited(text, {"imu.clock.offset_s": 0.25}, {"imu.clock.offset_s": "r"}, place="case")
    assert again == '[imu]\nclock = { column = "t", offset_s = 0.25}  # r\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "[imu]\nerrors = { noise = 0.5, of = { a = 1 } }\n",
            "[imu]\nerrors = { noise = 0.75, of = { a = 1 } }  # r\n",
        ),
        ('[imu.errors]\n"noise" = 0.5\n', '[imu.errors]\n"noise" = 0.75  # r\n'),
    ],
)
def test_braces_in_braces_and_quoted_keys_are_edited(text: str, expected: str) -> None:
    assert edited(text, {"imu.errors.noise": 0.75}, {"imu.errors.noise": "r"}, place="case") == expected


def test_what_is_no_toml_is_named() -> None:
    with pytest.raises(ScenarioError, match="case: not valid TOML"):
        edited("[imu\n", {"imu.noise": 0.75}, {"imu.noise": "r"}, place="case")


FORMS = (
    "[imu]\nerrors = { a = 0.5, of = { noise = 1 } }  # of a data sheet\nb = 2\n",
    "imu = { errors = { noise = 0.5 }, b = 2 }\n[dvl]\na = 1\n",
    "imu = { b = 2 }  # of a data sheet\n[dvl]\na = 1\n",
    "imu.errors.noise = 0.5  # of a data sheet\n[dvl]\n",
    "[imu]\na = 1\n[dvl]\nb = 2\n\n[imu.errors]\nnoise = 3\n[dvl.errors]\nx = 1\n",
    '[dvl]\ntext = """\n[imu.errors]\nnoise = 1\n"""\nlist = [\n  1, # of a data sheet\n  2,\n]\n',
)


@pytest.mark.parametrize("text", FORMS)
def test_values_change_and_nothing_else(text: str) -> None:
    """Braces at any depth, keys with dots, tables out of order, text that looks like a table."""
    values = {"imu.errors.of.noise": 0.25, "imu.errors.noise": 0.75, "dvl.errors.scale": 0.5}
    wanted = tomllib.loads(text)
    for key, value in values.items():
        *tables, name = key.split(".")
        at = wanted
        for part in tables:
            at = at.setdefault(part, {})
        at[name] = value
    result = edited(text, values, dict.fromkeys(values, "tuned: r"), place="case")
    assert tomllib.loads(result) == wanted
    assert result.count("of a data sheet") == text.count("of a data sheet")


def test_a_new_table_does_not_swallow_keys_with_dots() -> None:
    """The keys that follow stay in their table, so that the new one is in braces."""
    key = "imu.errors.noise"
    text = edited("imu.a = 1\nimu.b = 2\n", {key: 0.5}, {key: "r"}, place="case")
    assert text == "imu.a = 1\nimu.errors = {noise = 0.5}  # r\nimu.b = 2\n"


def test_a_new_key_leaves_the_comment_of_the_next_table_where_it_is() -> None:
    text = edited("[imu]\nb = 1\n\n# of the DVL\n[dvl]\n", {"imu.a": 0.5}, {"imu.a": "r"}, place="case")
    assert text == "[imu]\nb = 1\na = 0.5  # r\n\n# of the DVL\n[dvl]\n"


@pytest.mark.parametrize("text", ["imu = 3\n", "[[imu]]\na = 1\n"])
def test_a_key_of_what_is_no_table_is_refused(text: str) -> None:
    with pytest.raises(ScenarioError, match=r"^case: imu is no table, expected a table with 'imu\.a'$"):
        edited(text, {"imu.a": 0.5}, {"imu.a": "r"}, place="case")
