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
NOISE, CLOCK = "imu.errors.noise", "imu.clock.offset_s"
OWN, TUNED = (
    TEXT.replace("0.5   # guessed", one) for one in ("0.75  # r: 2 | guessed", "0.7  # r: 1 | guessed")
)
CASES = {
    "a number, before the user's own comment": (TEXT, {NOISE: 0.75}, OWN),
    "an earlier remark goes": (TUNED, {NOISE: 0.75}, OWN),
    "new keys: behind the last of their table, or in a new table at the end": (
        TEXT, {"imu.errors.bias": 1.5, "dvl.errors.scale": 0.7},
        TEXT.replace("1e-3\n", "1e-3\nbias = 1.5  # r: 2\n") + "\n[dvl.errors]\nscale = 0.7  # r: 2\n",
    ),
    "a key with dots": (TEXT, {"imu.other.gyro_bias": 3.0}, TEXT.replace("bias = 2.0", "bias = 3.0  # r: 2")),
    "in braces": (
        '[imu]\nclock = { column = "t", offset_s = 0.5 }  # host\n', {CLOCK: 0.25},
        '[imu]\nclock = { column = "t", offset_s = 0.25 }  # r: 2 | host\n',
    ),
    "new in braces": (
        '[imu]\nclock = { column = "t" }\n', {CLOCK: 0.25},
        '[imu]\nclock = { column = "t", offset_s = 0.25}  # r: 2\n',
    ),
    "in braces with braces": (
        "[imu]\nerrors = { noise = 0.5, of = { a = 1 } }\n", {NOISE: 0.75},
        "[imu]\nerrors = { noise = 0.75, of = { a = 1 } }  # r: 2\n",
    ),
    "a quoted key": ('[imu.errors]\n"noise" = 0.5\n', {NOISE: 0.75}, '[imu.errors]\n"noise" = 0.75  # r: 2\n'),
    "keys with dots follow, which a table of its own would swallow": (
        "imu.a = 1\nimu.b = 2\n", {NOISE: 0.5}, "imu.a = 1\nimu.errors = {noise = 0.5}  # r: 2\nimu.b = 2\n",
    ),
    "the comment of the next table stays with it": (
        "[imu]\nb = 1\n\n# of the DVL\n[dvl]\n", {"imu.a": 0.5},
        "[imu]\nb = 1\na = 0.5  # r: 2\n\n# of the DVL\n[dvl]\n",
    ),
}  # fmt: skip
"""A text, numbers by their keys, and the text with these numbers, each with the remark "r: 2"."""


def put(text: str, values: dict[str, float]) -> str:
    return edited(text, values, dict.fromkeys(values, "r: 2"), place="case")


@pytest.mark.parametrize("case", CASES)
def test_numbers_are_put_in_place(case: str) -> None:
    text, values, expected = CASES[case]
    assert put(text, values) == expected


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
    values = {"imu.errors.of.noise": 0.25, NOISE: 0.75, "dvl.errors.scale": 0.5}
    wanted = tomllib.loads(text)
    for key, value in values.items():
        *tables, name = key.split(".")
        at = wanted
        for part in tables:
            at = at.setdefault(part, {})
        at[name] = value
    result = put(text, values)
    assert tomllib.loads(result) == wanted
    assert result.count("of a data sheet") == text.count("of a data sheet")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[imu\n", "^case: not valid TOML"),
        ("imu = 3\n", r"^case: imu is no table, expected a table with 'imu\.a'$"),
        ("[[imu]]\na = 1\n", r"^case: imu is no table, expected a table with 'imu\.a'$"),
    ],
)
def test_what_holds_no_key_is_refused(text: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        put(text, {"imu.a": 0.5})
