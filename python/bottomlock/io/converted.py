"""The tables of `bottomlock convert`, held against the account beside them, which is their record."""

from pathlib import Path

from bottomlock.errors import DataError
from bottomlock.files.atomic_write import read_json
from bottomlock.files.records import DIGESTS, OWN_DIGEST, read_record, sha256_of

WATER_ENDING = "_water"
"""What the name of a water table has after that of the beam table, whose account is its own."""

_REMEDY = "convert the log again, or remove the account if the change is meant"


def check_converted(path: Path) -> None:
    """Checks a Parquet file that has an account of `bottomlock convert` beside it; any other file passes.

    Raises:
        DataError: for a table or an account that has changed since the conversion.
    """
    account, tables = path.with_suffix(".json"), 1
    if not account.is_file() and path.stem.endswith(WATER_ENDING):
        # Only an account of two tables has one of the water; without, it is the user's own.
        account, tables = path.with_name(path.stem.removesuffix(WATER_ENDING) + ".json"), 2
    if path.suffix.lower() != ".parquet" or not account.is_file() or not path.is_file():
        return
    try:
        content = read_json(account)
        if content is None or not {OWN_DIGEST, DIGESTS} & content.keys():
            return
        digests = (read_record(account) or {}).get(DIGESTS, {})
    except DataError as error:
        raise DataError(error, hint=_REMEDY) from error
    if len(digests) < tables:
        return
    # Both may have been renamed together.
    if sha256_of(path) not in digests.values():
        raise DataError(
            f"has changed since `bottomlock convert` wrote it ({account.name} has another SHA-256)",
            place=path,
            hint=_REMEDY,
        )
