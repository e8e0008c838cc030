"""The key reference: every key of every model has what a user needs, its examples hold, and the site has it."""

import json
import re
import tomllib
from collections.abc import Iterator
from typing import Annotated, Any, get_args

import pytest
from pydantic import BaseModel, TypeAdapter

from bottomlock.cli.keys import Kind, keys, matching, models, reference
from bottomlock.config.key_reference import key_of, section_models, sections_of
from bottomlock.config.scenario_sections import Dvl
from bottomlock.errors import ScenarioError
from tools import key_reference


def every_model() -> Iterator[type[BaseModel]]:
    """Every model that a key of a file belongs to."""
    waiting = [*models().values()]
    seen: set[type[BaseModel]] = set()
    while waiting:
        model = waiting.pop()
        if model not in seen:
            seen.add(model)
            yield model
            waiting += [
                one for field in model.model_fields.values() for one in section_models(field.annotation)
            ]


def test_every_key_is_described_and_its_example_is_valid() -> None:
    """A key without meaning or range, a number without unit, and an example that the model rejects all fail."""
    count = 0
    for model in every_model():
        for name, field in model.model_fields.items():
            if section_models(field.annotation):
                continue
            key, place = key_of(model, name), f"{model.__name__}.{name}"
            assert key.meaning, place
            assert key.range or key.type in {"true or false", "table"}, place
            assert key.unit or "number" not in key.type, place
            value = tomllib.loads(key.example)[name]
            declared: Any = (
                Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
            )
            TypeAdapter(declared).validate_python(value)
            count += 1
    assert count > 400


@pytest.mark.parametrize("kind", get_args(Kind))
def test_a_page_defines_every_key(kind: Kind) -> None:
    """Under the heading of its section, with its meaning, unless the page has the same section above."""
    page = key_reference.pages()[f"keys/{kind}.md"]
    bodies = re.split(r"^## .*\n", page, flags=re.MULTILINE)[1:]
    sections = reference(kind)
    assert re.findall(r"^## (.*)$", page, re.MULTILINE) == [key_reference.heading(one) for one in sections]
    defined = {(one.model, one.keys) for one, body in zip(sections, bodies, strict=True) if "`\n: " in body}
    for section, body in zip(sections, bodies, strict=True):
        if "Its keys are those of [" in body:
            assert (section.model, section.keys) in defined
            continue
        for key in section.keys:
            assert f"\n`{key.name}`\n: {key.meaning}\n: {key.type}" in body


@pytest.mark.parametrize("kind", get_args(Kind))
def test_every_kind_prints(kind: Kind, capsys: pytest.CaptureFixture[str]) -> None:
    """As words and as JSON, which has every key of the words."""
    keys(kind)
    words = capsys.readouterr().out
    keys(kind, as_json=True)
    content = json.loads(capsys.readouterr().out)
    for section in content:
        for key in section["keys"]:
            assert f"  {key['name']}: " in words
            assert key["example"] in words


def test_words_narrow_the_list_and_unknown_ones_name_the_nearest() -> None:
    """A section's name gives the section, a key's name the key in every section."""
    assert {one.path for one in matching(reference("scenario"), "imu.limits")} == {"imu.limits"}
    tilts = matching(reference("scenario"), "tilt_deg")
    assert [(one.path, [key.name for key in one.keys]) for one in tilts] == [("dvl", ["tilt_deg"])]
    with pytest.raises(ScenarioError, match="did you mean 'tilt_deg'"):
        keys("scenario", "tilt_dge")


def test_ranges_are_those_of_the_validators() -> None:
    """Bounds, choices, lists and optional keys in words, by hand."""
    described = {key.name: (key.type, key.range) for key in sections_of(Dvl)[0].keys}
    assert described["rate_hz"] == ("number", "> 0, ≤ 100")
    assert described["tilts_deg"] == ("list of numbers", "each > -90, < 90")
    assert described["directions"] == ("list of lists of 3 numbers", "each finite")
    assert described["max_range_m"] == ("number", "> 0")
    assert described["beam_noise_mps"] == ("number", "> 0")
