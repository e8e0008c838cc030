"""Runs of the A-KIT sections for tools/score_recorded.py, side by side in processes.

Each part (a section in one world) is written to a file as soon as it is finished. A second call with the same folder
continues where the first was interrupted; a part of other settings, recordings or code has another name.
"""

import hashlib
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import polars as pl

import bottomlock
from bottomlock.files.atomic_write import write_parquet
from bottomlock.replay.case import Case
from bottomlock.replay.run import replay_case
from tools.akit import SECTIONS, akit_case
from tools.akit_twin import twin_runs

TRUSTED = ("lc", "tc", "vb_exact", "info", "weak_sway", "sway_current", "consistent")
SMOOTHED_METHODS = ("lc", "tc", "weak_sway", "sway_current")


@dataclass(frozen=True)
class World:
    """What is changed in the recordings, and which methods are run on them.

    Attributes:
        name: of the world.
        noisy, degraded, drawn, asks, depth, robust: as in `akit_case`.
        methods: the methods; empty for all.
        smooth: with the smoothed pass.
        twin: on an exact truth (`akit_twin`).
    """

    name: str
    noisy: bool = True
    degraded: bool = False
    drawn: bool = True
    asks: tuple[str, ...] = ("lost_34", "outage_120", "outage_300", "caves")
    depth: bool = True
    robust: bool = True
    methods: tuple[str, ...] = ()
    smooth: bool = False
    twin: bool = False

    def settings(self, draws: int) -> str:
        """The lines of the section [replay]."""
        lines = [f"runs = {draws}", f"smooth = {str(self.smooth).lower()}"]
        if self.methods:
            lines.append(f"methods = {list(self.methods)}")
        return "\n".join(lines)


NOISY = World("noisy")
PLAIN = replace(NOISY, name="noisy_plain", robust=False, asks=("lost_34", "caves"), methods=TRUSTED)
SMOOTHED = replace(NOISY, name="noisy_smoothed", asks=("lost_34",), methods=SMOOTHED_METHODS, smooth=True)
WORLDS = (
    NOISY,
    replace(NOISY, name="degraded", degraded=True),
    PLAIN,
    replace(PLAIN, name="degraded_plain", degraded=True),
    SMOOTHED,
    replace(SMOOTHED, name="degraded_smoothed", degraded=True),
    replace(SMOOTHED, name="twin", methods=("lc", "tc"), twin=True),
    World("full", noisy=False, drawn=False, asks=(), methods=("ins", "lc"), smooth=True),
    World("alone", noisy=False, drawn=False, asks=(), depth=False, methods=("ins",)),
)


def code_hash() -> str:
    """SHA-256 of every file of the package, the extension module included."""
    found = hashlib.sha256()
    root = Path(bottomlock.__file__).parent
    for path in sorted(p for p in root.rglob("*") if p.suffix in {".py", ".so", ".pyd", ".toml"}):
        found.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return found.hexdigest()


def section_case(data: Path, folder: Path, world: World, section: int, draws: int) -> Case:
    """One section in one world; `folder` is for its case file."""
    return akit_case(
        data,
        folder,
        section,
        noisy=world.noisy,
        degraded=world.degraded,
        drawn=world.drawn,
        asks=world.asks,
        depth=world.depth,
        robust=world.robust,
        replay=world.settings(draws),
    )


def run_part(data: Path, folder: Path, world: World, section: int, draws: int, code: str) -> Path:
    """The table of runs of one section in one world as a file in `folder`; read from there if it exists."""
    case = section_case(data, folder, world, section, draws)
    key = hashlib.sha256(f"{code} {case.content_hash()}".encode()).hexdigest()[:16]
    part = folder / f"{world.name}_{section:02d}_{key}.parquet"
    if not part.is_file():
        write_parquet(part, twin_runs(case) if world.twin else replay_case(case).runs)
    return part


def recorded_runs(
    data: Path, folder: Path, *, draws: int, jobs: int, worlds: Iterable[World] = WORLDS
) -> dict[str, pl.DataFrame]:
    """Runs every section in every world, and returns the table of runs of each world.

    Args:
        data: folder of the recordings.
        folder: of the parts; those that it holds of the same settings and code are not run again.
        draws: number of draws of a section.
        jobs: number of processes.
        worlds: the worlds.
    """
    folder.mkdir(parents=True, exist_ok=True)
    code = code_hash()
    parts: dict[tuple[str, int], Path] = {}
    worlds = tuple(worlds)
    tasks = [(world, section) for world in worlds for section in SECTIONS]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {
            pool.submit(run_part, data, folder, world, section, draws, code): (world.name, section)
            for world, section in tasks
        }
        for done in as_completed(waiting):
            parts[waiting[done]] = done.result()
            print(f"{len(parts)} of {len(tasks)}: {waiting[done][0]}, section {waiting[done][1]}", flush=True)
    return {
        world.name: pl.concat([pl.read_parquet(parts[world.name, section]) for section in SECTIONS])
        for world in worlds
    }
