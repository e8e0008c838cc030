"""Shards of a campaign, run anywhere, joined to the campaign that one machine would have run."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock import kernel
from bottomlock.campaign.chunk import ChunkResults
from bottomlock.campaign.chunk_files import Identity, check_files, read_chunk
from bottomlock.campaign.directory import MANIFEST, open_directory, read_paths, shard_of
from bottomlock.campaign.manifest import Clock
from bottomlock.campaign.partition import Chunk, Partition, Shard, all_chunks
from bottomlock.campaign.run import Campaign, Results, execute
from bottomlock.errors import DataError, OutputError, note
from bottomlock.files.records import DIGESTS, read_record
from bottomlock.tables.versions import bit_versions

Manifest = Mapping[str, Any]

_SHARED = ("configuration_hash", "nees_degrees", "order", "scenarios")
"""Entries that are the same in the manifests of all shards of a campaign."""


def merge_shards(
    out: str | Path, directories: Sequence[str | Path], *, force: bool = False, recover: bool = False
) -> Results:
    """Joins all shards of a campaign; the tables are bit for bit those of the campaign run in one go.

    Nothing is written before every shard has been checked: present, finished, of the same campaign, and every file as
    its record states it.

    Args:
        out: directory; new, empty, or of the same campaign.
        directories: those of the shards, in any order.
        force: start over in a directory of another campaign.
        recover: as for `run_campaign`.

    Raises:
        OutputError: for shards that are missing, doubled, unfinished or of another campaign or version, a chunk that is
            missing, and an `out` that holds something else, is in use or cannot be written.
        DataError: for a file that has changed since it was written, or holds other runs than it should.
    """
    if not directories:
        raise OutputError("no shard is named: expected the directories of all shards")
    out, folders = Path(out), [Path(directory) for directory in directories]
    if any(out.resolve() == folder.resolve() for folder in folders):
        raise OutputError(f"{out}: is one of the shards; choose another directory for the campaign")
    manifests = [_manifest(folder) for folder in folders]
    order = _in_order(folders, manifests)
    source = ShardDirectories(order, _partitions(manifests[0]))
    clock = Clock(
        earlier_s=sum(manifest["wall_time_s"] for manifest in manifests),
        kernel_s=sum(manifest["kernel_time_s"] for manifest in manifests),
        batch_s=sum(manifest["batch_time_s"] for manifest in manifests),
    )
    identity = _identity(manifests[0])
    campaign = Campaign(source.partitions, None, identity, source.paths(), _merged(manifests))
    with open_directory(out, identity, force=force, recover=recover):
        tables, manifest = execute(campaign, source, out, clock, force=force)
    assert tables is not None
    return Results(tables.runs, tables.ensemble, tables.consistency, manifest, out, campaign.paths)


class ShardDirectories:
    """The directories of all shards of a campaign, as a source of its chunks."""

    def __init__(self, shards: Sequence[tuple[Path, Manifest]], partitions: Sequence[Partition]) -> None:
        """`shards`: directory and manifest of every shard, in order.

        Raises:
            OutputError: for a chunk that is missing, naming the shard that computes it.
            DataError: for a file that has changed since it was written.
        """
        self.partitions = tuple(partitions)
        self._shards = shards
        self._by_name = {partition.scenario: partition for partition in partitions}
        self._place: dict[Chunk, tuple[Path, Identity]] = {}
        for number, chunk in enumerate(all_chunks(partitions)):
            k = number % len(shards)
            directory, manifest = shards[k]
            again = f"run shard {Shard(k + 1, len(shards))} again"
            self._place[chunk] = (directory, _identity(manifest))
            remedy = f"copy the shard again, or {again}"
            if not check_files(directory, chunk, self._place[chunk][1], remedy=remedy):
                raise OutputError(
                    f"{directory}: chunk {chunk.file_ending} of {chunk.scenario} is missing; {again}"
                )

    def run(self, chunks: Sequence[Chunk], progress: Callable[[Chunk, float], None]) -> ChunkResults:  # noqa: ARG002
        """Reads the chunks in order."""
        for chunk in chunks:
            directory, identity = self._place[chunk]
            yield chunk, read_chunk(directory, chunk, self._by_name[chunk.scenario], identity)

    def paths(self) -> pl.DataFrame:
        """The true paths, which every shard holds.

        Raises:
            DataError: for a shard whose truth is another, or has changed since it was written.
        """
        tables = [read_paths(directory, manifest) for directory, manifest in self._shards]
        for (directory, _), table in zip(self._shards, tables, strict=True):
            if not table.equals(tables[0]):
                raise DataError(f"{directory}: its true paths are not those of {self._shards[0][0]}")
        return tables[0]


def _manifest(directory: Path) -> Manifest:
    """The manifest of a finished shard of this version."""
    manifest = read_record(directory / MANIFEST)
    if manifest is None or "configuration_hash" not in manifest:
        raise OutputError(f"{directory}: holds no campaign of ours (no manifest.json of `bottomlock run`)")
    if manifest.get("version") != kernel.kernel_version():
        raise OutputError(
            f"{directory}: is of version {manifest.get('version')}, this is {kernel.kernel_version()}"
        )
    shard = shard_of(manifest)
    if shard is None:
        raise OutputError(f"{directory}: holds a whole campaign, expected a shard of one (run --shard k/n)")
    if manifest.get("status") != "shard":
        raise OutputError(f"{directory}: shard {shard} is not finished; run the same command to resume it")
    _check_entries(directory / MANIFEST, manifest)
    return manifest


def _check_entries(path: Path, manifest: Manifest) -> None:
    """The entries that a merge reads are there and of their types.

    Raises:
        DataError: naming the entry.
    """
    kinds: dict[str, type | tuple[type, ...]] = {
        "order": list, "scenarios": dict, "nees_degrees": dict, "versions": dict, "configuration_hash": str,
        "engine": str, "threads": int, "wall_time_s": (int, float), "kernel_time_s": (int, float),
        "batch_time_s": (int, float), DIGESTS: dict,
    }  # fmt: skip
    for key, kind in kinds.items():
        if not isinstance(manifest.get(key), kind):
            raise DataError(f"{path}: its entry '{key}' is missing or not what it should be")
    if sorted(map(str, manifest["order"])) != sorted(manifest["scenarios"]) or not manifest["order"]:
        raise DataError(f"{path}: its entry 'order' does not name its scenarios")


def _identity(manifest: Manifest) -> Identity:
    versions = {name: manifest["versions"].get(name, "unknown") for name in bit_versions()}
    return {"configuration_hash": manifest["configuration_hash"], "versions": versions}


def _in_order(directories: Sequence[Path], manifests: Sequence[Manifest]) -> list[tuple[Path, Manifest]]:
    """Directory and manifest of every shard, in the order of the shards."""
    first, n = manifests[0], manifests[0]["shard"]["n"]
    found: dict[int, tuple[Path, Manifest]] = {}
    for directory, manifest in zip(directories, manifests, strict=True):
        shard = shard_of(manifest)
        assert shard is not None
        if manifest["configuration_hash"] != first["configuration_hash"]:
            raise OutputError(f"{directory}: is of another configuration than {directories[0]}")
        if _partitions(manifest) != _partitions(first):
            raise OutputError(f"{directory}: is of another number of runs than {directories[0]}")
        for key in _SHARED:
            if manifest[key] != first[key]:
                raise OutputError(f"{directory}: its manifest's '{key}' is not that of {directories[0]}")
        if shard.n != n:
            raise OutputError(f"{directory}: is shard {shard}, but {directories[0]} is one of {n}")
        if shard.k in found:
            raise OutputError(f"shard {shard} is there twice: {found[shard.k][0]} and {directory}")
        _check_versions(directory, manifest, directories[0], first)
        found[shard.k] = directory, manifest
    missing = [str(Shard(k, n)) for k in range(1, n + 1) if k not in found]
    if missing:
        raise OutputError(f"missing shard{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
    return [found[k] for k in range(1, n + 1)]


def _check_versions(directory: Path, manifest: Manifest, reference: Path, first: Manifest) -> None:
    """Shards are made with the same numpy and polars; kernels of several builds (machines) may meet, with a note."""
    held, expected = (dict(_identity(one)["versions"]) for one in (manifest, first))
    builds = held.pop("kernel_build"), expected.pop("kernel_build")
    other = [f"{name} {held[name]} and {expected[name]}" for name in held if held[name] != expected[name]]
    if other:
        raise OutputError(
            f"{directory}: was made with other versions than {reference} ({', '.join(other)}): bits may differ"
        )
    if builds[0] != builds[1]:
        note(f"{directory}: was made with another build of the kernel than {reference}")


def _partitions(manifest: Manifest) -> list[Partition]:
    return [Partition.from_manifest(name, manifest) for name in manifest["order"]]


def _merged(manifests: Sequence[Manifest]) -> dict[str, Any]:
    """The entries of the whole campaign, with what the shards do not share."""
    shards = [
        {key: manifest[key] for key in ("shard", "versions", "engine", "threads", "wall_time_s")}
        for manifest in manifests
    ]
    return {key: value for key, value in manifests[0].items() if key != "shard"} | {"shards": shards}
