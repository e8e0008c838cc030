"""Shards of a campaign, run anywhere, joined to the campaign that one machine would have run."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock import kernel
from bottomlock.atomic_write import read_json
from bottomlock.campaign.directory import MANIFEST, is_finished, read_chunk, read_paths, shard_of
from bottomlock.campaign.engine import ChunkResults
from bottomlock.campaign.manifest import Clock
from bottomlock.campaign.partition import Chunk, Partition, Shard, all_chunks
from bottomlock.campaign.run import Campaign, Results, execute
from bottomlock.errors import OutputError

Manifest = Mapping[str, Any]


def merge_shards(out: Path, directories: Sequence[Path], *, force: bool = False) -> Results:
    """Joins all shards of a campaign; the tables are bit for bit those of the campaign run in one go.

    Nothing is written before every shard has been checked: present, finished, and of the same campaign.

    Args:
        out: directory; new, empty, or of the same campaign.
        directories: those of the shards, in any order.
        force: start over in a directory of another campaign.

    Raises:
        OutputError: for shards that are missing, doubled, unfinished or of another campaign or version, a chunk that is
            missing, and an `out` that holds something else or cannot be written.
        DataError: for a chunk that is damaged.
    """
    if not directories:
        raise OutputError("no shard is named: expected the directories of all shards")
    if any(out.resolve() == directory.resolve() for directory in directories):
        raise OutputError(f"{out}: is one of the shards; choose another directory for the campaign")
    manifests = [_manifest(directory) for directory in directories]
    source = ShardDirectories(_in_order(directories, manifests), _partitions(manifests[0]))
    clock = Clock(
        earlier_s=sum(manifest["wall_time_s"] for manifest in manifests),
        kernel_s=sum(manifest["kernel_time_s"] for manifest in manifests),
        batch_s=sum(manifest["batch_time_s"] for manifest in manifests),
    )
    campaign = Campaign(source.partitions, None, source.paths(), _merged(manifests))
    tables, manifest = execute(campaign, source, out, clock, force=force)
    assert tables is not None
    return Results(tables.runs, tables.ensemble, tables.consistency, manifest)


class ShardDirectories:
    """The directories of all shards of a campaign, as a source of its chunks."""

    def __init__(self, directories: Sequence[Path], partitions: Sequence[Partition]) -> None:
        """`directories`: in the order of the shards.

        Raises:
            OutputError: for a chunk that is missing, naming the shard that computes it.
        """
        self.partitions = tuple(partitions)
        self._directories = directories
        self._by_name = {partition.scenario: partition for partition in partitions}
        self._place: dict[Chunk, Path] = {}
        for number, chunk in enumerate(all_chunks(partitions)):
            k = number % len(directories)
            self._place[chunk] = directories[k]
            if not is_finished(directories[k], chunk):
                raise OutputError(
                    f"{directories[k]}: chunk {chunk.file_ending} of {chunk.scenario} is missing; "
                    f"run shard {Shard(k + 1, len(directories))} again"
                )

    def run(self, chunks: Sequence[Chunk], progress: Callable[[Chunk, float], None]) -> ChunkResults:  # noqa: ARG002
        """Reads the chunks in order."""
        for chunk in chunks:
            yield chunk, read_chunk(self._place[chunk], chunk, self._by_name[chunk.scenario])

    def paths(self) -> pl.DataFrame:
        """The true paths, which every shard holds."""
        return read_paths(self._directories[0])


def _manifest(directory: Path) -> Manifest:
    """The manifest of a finished shard of this version."""
    manifest = read_json(directory / MANIFEST)
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
    return manifest


def _in_order(directories: Sequence[Path], manifests: Sequence[Manifest]) -> list[Path]:
    """The directory of every shard, in the order of the shards."""
    first, n = manifests[0], manifests[0]["shard"]["n"]
    found: dict[int, Path] = {}
    for directory, manifest in zip(directories, manifests, strict=True):
        shard = shard_of(manifest)
        assert shard is not None
        if manifest["configuration_hash"] != first["configuration_hash"]:
            raise OutputError(f"{directory}: is of another configuration than {directories[0]}")
        if _partitions(manifest) != _partitions(first):
            raise OutputError(f"{directory}: is of another number of runs than {directories[0]}")
        if shard.n != n:
            raise OutputError(f"{directory}: is shard {shard}, but {directories[0]} is one of {n}")
        if shard.k in found:
            raise OutputError(f"shard {shard} is there twice: {found[shard.k]} and {directory}")
        found[shard.k] = directory
    missing = [str(Shard(k, n)) for k in range(1, n + 1) if k not in found]
    if missing:
        raise OutputError(f"missing shard{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
    return [found[k] for k in range(1, n + 1)]


def _partitions(manifest: Manifest) -> list[Partition]:
    return [Partition.from_manifest(name, manifest) for name in manifest["order"]]


def _merged(manifests: Sequence[Manifest]) -> dict[str, Any]:
    """The entries of the whole campaign, with what the shards do not share."""
    shards = [
        {key: manifest[key] for key in ("shard", "versions", "engine", "threads", "wall_time_s")}
        for manifest in manifests
    ]
    return {key: value for key, value in manifests[0].items() if key != "shard"} | {"shards": shards}
