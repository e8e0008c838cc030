"""Shards of a campaign, flown anywhere, joined to the campaign that one machine would have flown."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bottomlock import kernel
from bottomlock.atomic_write import read_json, write_json
from bottomlock.campaign.aggregate import Results, finish, open_tallies
from bottomlock.campaign.directory import MANIFEST, is_finished, prepare, shard_of, take_chunk, take_truth
from bottomlock.campaign.manifest import Clock
from bottomlock.campaign.partition import Partition, Shard
from bottomlock.errors import OutputError

Manifest = Mapping[str, Any]


def merge_shards(out: Path, directories: Sequence[Path], *, force: bool = False) -> Results:
    """Joins all shards of a campaign; the tables are bit for bit those of the campaign flown in one go.

    Nothing is written before every shard is known to be there, finished, and of the same campaign.

    Args:
        out: directory; new, empty, or of the same campaign.
        directories: those of the shards, in any order.
        force: start over in a directory of another campaign.

    Raises:
        OutputError: for shards that are missing, doubled, unfinished or of another campaign or version, a chunk that is
            missing, and an `out` that is not ours or cannot be written.
        DataError: for a chunk that is damaged.
    """
    clock = Clock()
    if not directories:
        raise OutputError("no shard is named: expected the directories of all shards")
    if any(out.resolve() == directory.resolve() for directory in directories):
        raise OutputError(f"{out}: is one of the shards; choose another directory for the campaign")
    manifests = [_manifest(directory) for directory in directories]
    sources = _sources(directories, manifests)
    first = manifests[0]
    plans = [Partition.from_manifest(name, first) for name in first["order"]]
    spans = [(plan.name, span) for plan in plans for span in plan.spans()]
    taken = [
        (sources[number % len(sources)], number, name, span) for number, (name, span) in enumerate(spans)
    ]
    for source, number, name, span in taken:
        if not is_finished(source, name, span):
            shard = Shard(number % len(sources) + 1, len(sources))
            raise OutputError(
                f"{source}: chunk {span.stem} of {name} is missing; flying shard {shard} again makes it"
            )
    prepare(out, first["configuration_hash"], force=force)
    merged = _merged(manifests)
    write_json(out / MANIFEST, merged | {"status": "running"})
    take_truth(out, sources[0])
    for source, _, name, span in taken:
        if not is_finished(out, name, span):
            take_chunk(out, source, name, span)
    times = {"wall_time_s": round(merged["wall_time_s"] + clock.times()["wall_time_s"], 3)}
    with open_tallies(out, plans) as tallies:
        return finish(out, tallies, merged | times)


def _manifest(directory: Path) -> Manifest:
    """The manifest of a finished shard of this version."""
    manifest = read_json(directory / MANIFEST)
    if manifest is None or "configuration_hash" not in manifest:
        raise OutputError(f"{directory}: holds no campaign of ours")
    if manifest.get("version") != kernel.kernel_version():
        raise OutputError(
            f"{directory}: is of version {manifest.get('version')}, this is {kernel.kernel_version()}"
        )
    shard = shard_of(manifest)
    if shard is None:
        raise OutputError(f"{directory}: holds a whole campaign, expected a shard of one (run --shard k/n)")
    if manifest.get("status") != "shard":
        raise OutputError(f"{directory}: shard {shard} is not finished; the command that flew it resumes it")
    return manifest


def _sources(directories: Sequence[Path], manifests: Sequence[Manifest]) -> list[Path]:
    """The directory of every shard, in order."""
    first, n = manifests[0], manifests[0]["shard"]["n"]
    found: dict[int, Path] = {}
    for directory, manifest in zip(directories, manifests, strict=True):
        shard = shard_of(manifest)
        assert shard is not None
        if manifest["configuration_hash"] != first["configuration_hash"]:
            raise OutputError(f"{directory}: is of another configuration than {directories[0]}")
        if _cut(manifest) != _cut(first):
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


def _cut(manifest: Manifest) -> list[Partition]:
    return [Partition.from_manifest(name, manifest) for name in manifest["order"]]


def _merged(manifests: Sequence[Manifest]) -> dict[str, Any]:
    """The manifest of the whole; its times are sums over the shards."""
    whole = {key: value for key, value in manifests[0].items() if key != "shard"}
    clock = Clock(
        kernel_s=sum(manifest["kernel_time_s"] for manifest in manifests),
        batch_s=sum(manifest["batch_time_s"] for manifest in manifests),
    )
    wall_s = sum(manifest["wall_time_s"] for manifest in manifests)
    shards = [
        {key: manifest[key] for key in ("shard", "versions", "engine", "threads", "wall_time_s")}
        for manifest in manifests
    ]
    return whole | clock.times() | {"status": "complete", "wall_time_s": round(wall_s, 3), "shards": shards}
