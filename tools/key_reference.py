"""Writes docs/keys.md from the models of the files that a user writes.

Usage: python tools/key_reference.py [--check]
"""

import sys
from pathlib import Path
from typing import get_args

from bottomlock.cli.keys import Kind, reference
from bottomlock.config.key_reference import Key, KeySection
from bottomlock.files.atomic_write import write_text

PAGE = Path(__file__).resolve().parents[1] / "docs" / "keys.md"
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
    "case": "`bottomlock replay FILE`; written from logs by `bottomlock replay --init LOG...`; see [replay](replay.md)",
    "geometry": "`geometry` of a case or a live configuration, `--geometry` of audit, fix and score; the packaged ones "
    "are listed by `bottomlock geometries`. `[columns]` is a column map",
    "vehicle": "`trajectory.vehicle` of a scenario, `bottomlock fly --vehicle FILE`; see [the vehicle](plant.md)",
    "hovering_vehicle": "the same keys; a file with `[thrusters]` is one of these",
    "columns": "`bottomlock convert --columns FILE`, and `[columns]` of a geometry; written by `bottomlock convert "
    "--init`",
    "live": "`bottomlock live FILE`; written by `bottomlock live --init`; see [live](live.md)",
}
HEAD = """# Keys

Every key of the files that a user writes. This page is written by `python tools/key_reference.py` from the models that
check the files; `bottomlock keys case start` prints the same in a terminal, with an example of each key, and
`bottomlock keys scenario --json` for programs.

A key has its unit in its name, or the table says it; 1 is a number without dimension. A key without a default is
required. "none" is a default that stands for no value: TOML has no word for it, leave the key out. Standard deviations
are 1 sigma. What is wrong or missing in a file is named in one go, with what was expected and the nearest known key.
"""


def page() -> str:
    """The whole page."""
    shown: dict[tuple[object, ...], str] = {}
    parts = [HEAD]
    for kind in get_args(Kind):
        parts.append(f"## {TITLES[kind]}\n\nRead by {COMMANDS[kind]}.\n")
        parts += [_section(section, TITLES[kind], shown) for section in reference(kind)]
    return "\n".join(parts)


def _section(section: KeySection, title: str, shown: dict[tuple[object, ...], str]) -> str:
    """A section's heading, and its table or the place of an equal one."""
    name = f"`{section.title}`" if section.path else "The top of the file"
    lines = [f"### {title}: {name}", "", f"{_sentence(section.left_out)}{section.meaning}", ""]
    same = shown.get((section.model, section.keys))
    if same is not None:
        return "\n".join([*lines, f"Its keys are those of {same}.", ""])
    if not section.keys:
        return "\n".join(lines)
    shown[section.model, section.keys] = f"{name} of the {title.lower()}"
    lines += ["| Key | Type | Unit | Default | Range | Meaning | Example |", "|---|---|---|---|---|---|---|"]
    lines += [_row(key) for key in section.keys]
    return "\n".join([*lines, ""])


def _sentence(left_out: str) -> str:
    return "" if not left_out else f"{left_out[0].upper()}{left_out[1:]}. "


def _row(key: Key) -> str:
    default = key.default if key.default in {"required", "none"} else f"`{key.default}`"
    words = (f"`{key.name}`", key.type, key.unit, default, key.range, key.meaning, f"`{key.example}`")
    cells = (word or "–" for word in words)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def main() -> int:
    """Writes the page, or with `--check` says whether it is current."""
    text = page()
    if "--check" in sys.argv[1:]:
        current = PAGE.is_file() and PAGE.read_text(encoding="utf-8") == text
        print(
            "docs/keys.md is current"
            if current
            else "docs/keys.md is not current: python tools/key_reference.py"
        )
        return 0 if current else 1
    write_text(PAGE, text)
    print(f"wrote {PAGE.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
