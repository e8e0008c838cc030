"""What a key of a settings file means: the docstring of its attribute, and what neither name nor type can say."""

from typing import Any

from pydantic import Field


def shown(*, unit: str = "", range: str = "", example: Any = None) -> Any:  # noqa: A002, ANN401 - of any key
    """What the key reference and the schema show of a key: a unit not in its name, a range in words, an example.

    The example is needed where the default is none; of a choice it is the first.
    """
    stated = {"unit": unit, "range": range}
    return Field(
        examples=None if example is None else [example],
        json_schema_extra={name: words for name, words in stated.items() if words},
    )
