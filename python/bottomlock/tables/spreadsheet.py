"""Tables as CSV for spreadsheets, in which no text is a formula."""

import polars as pl

_FORMULA = r"^([=+\-@\t\r])"


def csv_text(table: pl.DataFrame, *, float_precision: int | None) -> str:
    """A table as CSV; text that a spreadsheet would take for a formula begins with an apostrophe, which makes it text.

    Numbers stay as they are: with all digits where no precision is given.

    >>> print(csv_text(pl.DataFrame({"name": ["=1+1", "tc"], "value": [-1.0, 2.0]}), float_precision=1), end="")
    name,value
    '=1+1,-1.0
    tc,2.0
    """
    return table.with_columns(pl.col(pl.String).str.replace(_FORMULA, "'$1")).write_csv(
        float_precision=float_precision
    )
