"""What can be seen of a replay before it begins: its files, its geometry, and its what-if cases."""

from bottomlock.errors import BottomlockError, DataError
from bottomlock.io.beams import read_geometry
from bottomlock.replay import rerun
from bottomlock.replay.case import Case
from bottomlock.replay.streams import Streams


def check_files(case: Case) -> None:
    """Checks that every file of a case is there and that its geometry is right.

    Raises:
        DataError: naming every file at fault and the geometry, a line each.
    """
    files: dict[str, str] = {}
    for section, path in case.files().items():
        if not path.is_file():
            files[str(path)] = f"{files[str(path)]}, [{section}]" if str(path) in files else f"[{section}]"
    faults = [f"{path}: no such file, named in {sections}" for path, sections in files.items()]
    try:
        read_geometry(case.dvl.geometry)
    except BottomlockError as error:
        faults.append(str(error))
    if faults:
        raise DataError("\n".join(faults))


def check_what_ifs(case: Case, streams: Streams) -> None:
    """Aligns the recording and decides the beams of each what-if case.

    Raises:
        DataError: as `rerun.prepare`, and for each what-if case at fault, a line each.
    """
    prepared = rerun.prepare(case, streams)
    faults = []
    for what_if in case.what_if:
        try:
            rerun.returned(prepared, what_if)
        except BottomlockError as error:
            faults.append(str(error))
    if faults:
        raise DataError("\n".join(faults))
