"""Writes docs/keys.md and the pages of docs/keys/, one a kind of file, from the models of the files that a user writes.

Usage: python tools/key_reference.py [--check]
"""

import re
import sys
from pathlib import Path
from typing import get_args

from bottomlock.cli.keys import Kind, reference
from bottomlock.config.key_reference import REQUIRED, Key, KeySection
from bottomlock.files.atomic_write import write_text

DOCS = Path(__file__).resolve().parents[1] / "docs"
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
    "scenario": "`bottomlock run FILE`; packaged ones are copied by `bottomlock scenarios --copy NAME`",
    "case": "`bottomlock replay FILE`; written from logs by `bottomlock replay --init LOG...`; see "
    "[replay](../replay.md)",
    "geometry": "`geometry` of a case or a live configuration, `--geometry` of audit, fix and score; the packaged ones "
    "are listed by `bottomlock geometries`. `[columns]` is a column map",
    "vehicle": "`trajectory.vehicle` of a scenario, `bottomlock fly --vehicle FILE`; see [the vehicle](../plant.md)",
    "hovering_vehicle": "the same keys; a file with `[thrusters]` is one of these",
    "columns": "`bottomlock convert --columns FILE`, and `[columns]` of a geometry; written by `bottomlock convert "
    "--init`",
    "live": "`bottomlock live FILE`; written by `bottomlock live --init`; see [live](../live.md)",
}
HEAD = """# Keys

Every key of the files that a user writes, a page a kind of file. The pages are written by `python
tools/key_reference.py` from the models that check the files; `bottomlock keys case start` prints the same in a
terminal, with an example of each key, and `bottomlock keys scenario --json` for programs.

A key has its unit in its name, or beside its type. A key without a default is required or optional; there is no such
value where an optional one is left out. Standard deviations are 1 sigma. What is wrong or missing in a file is named
in one go, with what was expected and the nearest known key.
"""


def pages() -> dict[str, str]:
    """The overview and the page of every kind of file, by their places in docs/."""
    kinds = get_args(Kind)
    overview = [HEAD, *(_summary(kind) for kind in kinds)]
    tree = ["```{toctree}", ":hidden:", "", *(f"keys/{kind}" for kind in kinds), "```", ""]
    written = {"keys.md": "\n".join([*overview, *tree])}
    return written | {f"keys/{kind}.md": _page(kind) for kind in kinds}


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
    return f"{_name(section)} {section.left_out}" if section.left_out.startswith("for ") else _name(section)


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


def _name(section: KeySection) -> str:
    return f"`{section.title}`" if section.path else "The top of the file"


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


def main() -> int:
    """Writes the pages, or with `--check` says whether they are current."""
    written = pages()
    there = {path.relative_to(DOCS).as_posix() for path in (DOCS / "keys").glob("*.md")}
    left = sorted(there - set(written))
    if "--check" in sys.argv[1:]:
        old = [name for name, text in written.items() if _text(name) != text] + left
        print(
            f"not current: {', '.join(old)}: python tools/key_reference.py" if old else "the keys are current"
        )
        return 1 if old else 0
    (DOCS / "keys").mkdir(exist_ok=True)
    for name, text in written.items():
        write_text(DOCS / name, text)
    for name in left:
        (DOCS / name).unlink()
    print(f"wrote {', '.join(written)}")
    return 0


def _text(name: str) -> str:
    path = DOCS / name
    return path.read_text(encoding="utf-8") if path.is_file() else ""


if __name__ == "__main__":
    sys.exit(main())
