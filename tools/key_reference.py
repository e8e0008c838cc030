"""Makes the site's pages of keys, one a kind of file, from the models of the files that a user writes."""

import re
from typing import get_args

from bottomlock.cli.keys import Kind, reference
from bottomlock.config.key_reference import REQUIRED, Key, KeySection

TITLES: dict[Kind, str] = {
    "scenario": "Scenario",
    "case": "Replay case",
    "geometry": "DVL geometry",
    "vehicle": "Vehicle with fins",
    "hovering_vehicle": "Vehicle with thrusters",
    "columns": "Column map",
    "live": "Live configuration",
}
COMMANDS: dict[Kind, str] = {
    "scenario": "`bottomlock run FILE`; packaged ones are copied by `bottomlock list scenarios --copy NAME`",
    "case": "`bottomlock replay FILE`; written from logs by `bottomlock replay --init LOG...`; see "
    "[replay](../replay.md)",
    "geometry": "`geometry` of a case or a live configuration, `--geometry` of audit, fix and score; the packaged ones "
    "are listed by `bottomlock list geometries`. `[columns]` is a column map",
    "vehicle": "`trajectory.vehicle` of a scenario, `bottomlock fly --vehicle FILE`; see [the vehicle](../plant.md)",
    "hovering_vehicle": "the same keys; a file with `[thrusters]` is one of these",
    "columns": "`bottomlock convert --columns FILE`, and `[columns]` of a geometry; written by `bottomlock convert "
    "--init`",
    "live": "`bottomlock live FILE`; written by `bottomlock live --init`; see [live](../live.md)",
}


def overview() -> str:
    """What the site adds to docs/keys.md: the sections of every kind of file."""
    kinds = get_args(Kind)
    tree = ["```{toctree}", ":hidden:", "", *(f"keys/{kind}" for kind in kinds), "```", ""]
    return "\n".join([*(_summary(kind) for kind in kinds), *tree])


def pages() -> dict[str, str]:
    """The page of every kind of file, by its place in the site."""
    return {f"keys/{kind}.md": _page(kind) for kind in get_args(Kind)}


def _summary(kind: Kind) -> str:
    """What the overview says of a kind: how many keys there are, and its sections."""
    sections = reference(kind)
    count = sum(len(section.keys) for section in sections)
    places = anchors(sections)
    links: dict[str, str] = {}
    for section, place in zip(sections, places, strict=True):
        links.setdefault(heading(section), f"[{heading(section)}](keys/{kind}.md#{place})")
    return f"## {TITLES[kind]}\n\n[{count} keys](keys/{kind}.md): {', '.join(links.values())}.\n"


def _page(kind: Kind) -> str:
    """A page: a heading a section, a definition list of its keys or the place of an equal one."""
    sections = reference(kind)
    shown: dict[tuple[object, ...], str] = {}
    parts = [f"# Keys: {TITLES[kind].lower().replace('dvl', 'DVL')}\n\nRead by {COMMANDS[kind]}.\n"]
    for section, place in zip(sections, anchors(sections), strict=True):
        parts.append(f"## {heading(section)}\n\n{_sentence(section)}\n")
        same = shown.get((section.model, section.keys))
        if same is not None:
            parts.append(f"Its keys are those of {same}.\n")
        elif section.keys:
            shown[section.model, section.keys] = f"[{heading(section)}](#{place})"
            parts += [_entry(key) for key in section.keys]
    return "\n".join(parts)


def heading(section: KeySection) -> str:
    """The heading of a section, which names the kind where the keys depend on it."""
    name = f"`{section.title}`" if section.path else "The top of the file"
    return f"{name} {section.left_out}" if section.left_out.startswith("for ") else name


def anchors(sections: list[KeySection]) -> list[str]:
    """The anchors that a forge and the site give the headings: letters, digits, - and _; a repeated one is counted."""
    counts: dict[str, int] = {}
    found = []
    for section in sections:
        plain = re.sub(r"[^\w\- ]", "", heading(section).lower()).replace(" ", "-")
        number = counts.get(plain, 0)
        counts[plain] = number + 1
        found.append(f"{plain}-{number}" if number else plain)
    return found


def _sentence(section: KeySection) -> str:
    words = section.left_out
    return f"{words[0].upper()}{words[1:]}. {section.meaning}" if words else section.meaning


def _entry(key: Key) -> str:
    """A key with its meaning, and below it type, unit, default, range, and an example that is not the default."""
    unit = {"": "", "1": ", dimensionless"}.get(key.unit, f", {key.unit}")
    default = {REQUIRED: f"**{REQUIRED}**", "none": "optional"}.get(key.default, f"default `{key.default}`")
    span = "" if key.range == "any" else re.sub(r"(?<=^matches )(.+)", r"`\1`", key.range)
    facts = [f"{key.type}{unit}", default, span]
    if key.example and key.example != f"{key.name} = {key.default}":
        facts.append(f"`{key.example}`")
    return f"`{key.name}`\n: {key.meaning}\n: {'; '.join(fact for fact in facts if fact)}\n"
