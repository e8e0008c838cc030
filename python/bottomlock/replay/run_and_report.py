"""A replay from its case to its page, in a folder."""

from collections.abc import Callable, Iterable
from pathlib import Path

from bottomlock.files.overwriting import remove_outdated
from bottomlock.replay.case import Case
from bottomlock.replay.report import make_replay_report
from bottomlock.replay.run import open_folder, replay_case, write_replay
from bottomlock.tables.replay import ReplayTables


def run_and_report(
    case: Case,
    out: str | Path,
    *,
    inputs: Iterable[Path] = (),
    threads: int = 0,
    force: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> ReplayTables:
    """Replays a case, and writes tables, page and figures to a folder.

    Args:
        case: the case.
        out: the folder: new, empty, or of the same case.
        inputs: files read beside those that the case names; none of all these may be among those written.
        threads: number of threads, 0 for one per core; the results do not depend on it.
        force: start over in a folder of another case.
        progress: as of `replay_case`.

    Raises:
        DataError, ScenarioError, KernelError: as `replay_case`.
        OutputError: as `open_folder`.
    """
    out = Path(out)
    read = (*inputs, Path(case.dvl.geometry), *case.files().values())
    with open_folder(out, case.content_hash(), inputs=read, force=force):
        replayed = replay_case(case, threads=threads, progress=progress)
        write_replay(replayed, out)
        make_replay_report(out, force=force)
        remove_outdated(out)
    return replayed
