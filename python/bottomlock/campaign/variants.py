"""Variants of scenarios: the product of the values of some keys, each a campaign in a folder of its own.

A variant keeps the names and the seed of its scenarios, and with them every random number that its settings do not
change: run k of one variant is paired with run k of another.
"""

import itertools
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bottomlock.campaign.run import CampaignProgress, Results, check_campaign, run_campaign
from bottomlock.config.scenario import Scenario
from bottomlock.config.toml_file import toml_value
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.files.campaign_tables import KIND, VARIANTS
from bottomlock.files.output_folder import is_occupied, locked
from bottomlock.files.records import read_record, write_record

MOST_VARIANTS = 200
"""More of them are taken for a mistake."""

_OF_THE_BASE = ("name", "description")
"""Keys that are no settings: the name decides the random numbers."""


@dataclass(frozen=True)
class Variant:
    """One variant: its folder, the values that make it, and its scenarios."""

    folder: str
    values: dict[str, Any]
    scenarios: tuple[Scenario, ...]

    @property
    def runs(self) -> int:
        """Runs of all its scenarios."""
        return sum(scenario.campaign.runs for scenario in self.scenarios)


def parse_set(text: str) -> tuple[str, list[Any]]:
    """Key and values of `KEY=VALUE,VALUE,...`: values of TOML, or bare words.

    Raises:
        ScenarioError: for a text without key or value.

    Examples:
        >>> parse_set("dvl.beams_lost=[3,4],[]")
        ('dvl.beams_lost', [[3, 4], []])
        >>> parse_set("filter.gate=joint,off")
        ('filter.gate', ['joint', 'off'])
    """
    key, _, listed = text.partition("=")
    values = _toml(f"[{listed}]")
    if not isinstance(values, list):
        values = [_toml(part.strip()) for part in listed.split(",")]
    if not key.strip() or not values or "" in values:
        raise ScenarioError(
            place=f"--set {text}",
            expected="a key and its values, such as --set imu.gyro_bias_deg_per_h=0.01,3,50",
        )
    return key.strip(), values


def _toml(text: str) -> Any:  # noqa: ANN401 - a value of any key
    """A value of TOML; the text itself where it is none."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        return text


def make_variants(scenarios: Sequence[Scenario], sets: Mapping[str, Sequence[Any]]) -> list[Variant]:
    """Every combination of the values, in the order in which they are given.

    Raises:
        ScenarioError: for a key that no scenario has, which names the nearest, a value that it rejects, a value that
            is given twice, and more than `MOST_VARIANTS`.
    """
    for key, values in sets.items():
        if key in _OF_THE_BASE:
            raise ScenarioError(
                "it is no setting", place=f"--set {key}", hint="copy the scenario to rename it"
            )
        texts = [toml_value(value) for value in values]
        twice = next((word for word in texts if texts.count(word) > 1), None)
        if twice is not None:
            raise ScenarioError(f"the value {twice} is given twice", place=f"--set {key}")
    combinations = [dict(zip(sets, values, strict=True)) for values in itertools.product(*sets.values())]
    if len(combinations) > MOST_VARIANTS:
        raise ScenarioError(
            f"{len(combinations)} variants are asked for", expected=f"{MOST_VARIANTS} at most"
        )
    variants = [
        Variant(_folder(values), values, tuple(scenario.replace(values) for scenario in scenarios))
        for values in combinations
    ]
    names = [variant.folder for variant in variants]
    if len(set(names)) != len(names):
        raise ScenarioError(f"two variants would have one folder, {max(names, key=names.count)}")
    return variants


def _folder(values: Mapping[str, Any]) -> str:
    """The folder of a variant: the last part of each key, all of it where two keys share that, and its value.

    >>> _folder({"imu.gyro_bias_deg_per_h": 0.01, "dvl.beams_lost": [3, 4]})
    'gyro_bias_deg_per_h=0.01,beams_lost=3_4'
    """
    ends = [key.rsplit(".", 1)[-1] for key in values]
    parts = []
    for (key, value), end in zip(values.items(), ends, strict=True):
        word = f"{value:.10g}" if isinstance(value, float) else toml_value(value)
        plain = re.sub(r"[^A-Za-z0-9.+\-]+", "_", word).strip("_") or "none"
        parts.append(f"{key if ends.count(end) > 1 else end}={plain}")
    return ",".join(parts)


def check_variants(variants: Sequence[Variant], out: Path, *, force: bool = False) -> dict[str, Any]:
    """Rejects what `run_variants` would reject, and changes nothing.

    Returns:
        The values of the variants that the directory holds, by folder.

    Raises:
        As `run_variants`.
    """
    known: dict[str, Any] = {}
    if is_occupied(out):
        record = read_record(out / VARIANTS) if out.is_dir() else None
        if record is None or record.get("kind") != KIND:
            raise OutputError(
                "is not empty and holds no variants", place=out, hint="choose another directory"
            )
        known = dict(record["variants"])
    for variant in variants:
        check_campaign(variant.scenarios, out / variant.folder, force=force)
    return known


def run_variants(
    variants: Sequence[Variant],
    out: str | Path,
    *,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
    **settings: Any,  # noqa: ANN401 - as `run_campaign` takes them
) -> list[Results]:
    """Runs or resumes each variant in its folder under `out`; `variants.json` there names them.

    Every scenario and every folder is checked before the first run. A folder of variants may be added to by other
    values.

    Raises:
        OutputError: for a directory that holds something else.
        As `run_campaign`.
    """
    out = Path(out)
    known = check_variants(variants, out, force=force)
    with locked(out):
        known |= {variant.folder: variant.values for variant in variants}
        write_record(out / VARIANTS, {"kind": KIND, "variants": known}, {})
        return [
            run_campaign(
                variant.scenarios,
                out / variant.folder,
                force=force,
                progress=_numbered(progress, f"{number}/{len(variants)}"),
                **settings,
            )
            for number, variant in enumerate(variants, start=1)
        ]


def _numbered(
    progress: Callable[[CampaignProgress], None], number: str
) -> Callable[[CampaignProgress], None]:
    """The progress of a variant under its number."""
    return lambda state: progress(replace(state, trajectory=f"{number} {state.trajectory}"))
