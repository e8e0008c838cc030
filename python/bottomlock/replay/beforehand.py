"""What can be seen of a replay before it begins: its files, the geometries they need, and its what-if cases."""

from bottomlock.errors import BottomlockError, DataError
from bottomlock.io.beams import read_geometry
from bottomlock.recordings.streams import Floats
from bottomlock.replay import rerun
from bottomlock.replay.case import Case
from bottomlock.replay.streams import Streams


def check_files(case: Case) -> None:
    """Checks that every file of a case is there and that every geometry is right.

    Raises:
        DataError: naming every file and geometry at fault, a line each.
    """
    files: dict[str, str] = {}
    for section, path in case.files().items():
        if not path.is_file():
            files[str(path)] = f"{files[str(path)]}, [{section}]" if str(path) in files else f"[{section}]"
    faults = [f"{path}: no such file, named in {sections}" for path, sections in files.items()]
    recordings = [case.dvl.noise.of, *(what_if.validity_of for what_if in case.what_if)]
    for geometry in dict.fromkeys(
        [case.dvl.geometry, *(one.geometry for one in recordings if one is not None)]
    ):
        try:
            read_geometry(geometry)
        except BottomlockError as error:
            faults.append(str(error))
    if faults:
        raise DataError("\n".join(faults))


def check_what_ifs(case: Case, streams: Streams, residuals: Floats | None) -> None:
    """Aligns the first run and decides the beams of each what-if case.

    Raises:
        DataError: as `rerun.prepare`, and for each what-if case at fault, a line each.
    """
    prepared = rerun.prepare(case, streams, 0, residuals)
    faults = []
    for what_if in case.what_if:
        try:
            rerun.returned(case, prepared, what_if)
        except BottomlockError as error:
            faults.append(str(error))
    if faults:
        raise DataError("\n".join(faults))
