"""Makes the pages whose numbers a command measures, and writes into each the commit of the code that made it.

    python tools/make_pages.py                            # all of tools/pages.toml
    python tools/make_pages.py docs/audit.md              # some
    python tools/make_pages.py --list

Pages of recordings are left out, and named, where BOTTOMLOCK_RECORDINGS has no folder. Code that is not committed is
refused, since a page could not say which it was.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.files.atomic_write import write_text

ROOT = Path(__file__).resolve().parent.parent
CODE = ("Cargo.lock", "crates", "python", "tools", "benches", "data")
"""What a number depends on."""
STAMP = re.compile(r"\n*<!-- made -->\n.*\Z", re.DOTALL)


@dataclass(frozen=True)
class Page:
    """A page with measured numbers.

    Attributes:
        file: from the root of the project.
        commands: run one after another; {work} is the folder of results.
        copy: what they wrote there that becomes the page; empty where they write it themselves.
        minutes: about what it takes, on two cores.
        recordings: with recordings that may not be republished.
    """

    file: str
    commands: tuple[str, ...]
    minutes: int
    copy: str = ""
    recordings: bool = False


def pages() -> list[Page]:
    """Those of tools/pages.toml."""
    content = tomllib.loads((ROOT / "tools" / "pages.toml").read_text(encoding="utf-8"))
    return [Page(**entry | {"commands": tuple(entry["commands"])}) for entry in content["page"]]


def stamped(text: str, page: Page, commit: str) -> str:
    """The page with the commit of the code and its commands at its end, in place of those before."""
    commands = " and ".join(f"`{command.replace('{work}', 'DIR')}`" for command in page.commands)
    return f"{STAMP.sub('', text).rstrip()}\n\n<!-- made -->\n\nNumbers by the code of commit {commit}: {commands}.\n"


def commit() -> str:
    """The commit that the working tree's code is.

    Raises:
        SystemExit: where some of it is not committed.
    """
    changed = _git("status", "--porcelain", "--", *CODE)
    if changed:
        raise SystemExit(f"make_pages: commit the code first, a page names its commit; changed:\n{changed}")
    return _git("rev-parse", "--short=8", "HEAD")


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(ROOT), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.rstrip()  # noqa: S603 - itself


def make(page: Page, work: Path, made_by: str) -> None:
    """Runs the commands of a page and stamps it.

    Raises:
        SystemExit: where a command fails; the page then stays as it is, or without a new commit.
    """
    paths = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    for command in page.commands:
        print(f"make_pages: {page.file}: {command.format(work=work)}", flush=True)
        words = shlex.split(command.format(work=shlex.quote(str(work))))
        try:
            done = subprocess.run(words, cwd=ROOT, check=False, env=os.environ | {"PATH": paths})  # noqa: S603 - ours
        except FileNotFoundError as error:
            raise SystemExit(f"make_pages: {words[0]}: no such command beside {sys.executable}") from error
        if done.returncode:
            raise SystemExit(f"make_pages: {page.file}: ended with exit code {done.returncode}: {command}")
    source = work / page.copy if page.copy else ROOT / page.file
    write_text(ROOT / page.file, stamped(source.read_text(encoding="utf-8"), page, made_by))


def main(arguments: Sequence[str] | None = None) -> None:
    """Makes the pages that are asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", help="pages, from the root of the project; all by default")
    parser.add_argument("--work", type=Path, default=ROOT / "out" / "pages", help="folder of the results")
    parser.add_argument("--list", action="store_true", help="only say what would be made")
    given = parser.parse_args(arguments)
    known = {page.file: page for page in pages()}
    for name in given.files:
        if name not in known:
            parser.error(f"{name}: no page of tools/pages.toml; there are {', '.join(known)}")
    wanted = [known[name] for name in given.files or known]
    if given.list:
        for page in wanted:
            print(f"{page.file}  {page.minutes} min{'  recordings' if page.recordings else ''}")
        return
    made_by = commit()
    left = sum(page.minutes for page in wanted)
    given.work.mkdir(parents=True, exist_ok=True)
    for page in wanted:
        left -= page.minutes
        if page.recordings and not os.environ.get("BOTTOMLOCK_RECORDINGS"):
            print(f"make_pages: {page.file} left out: BOTTOMLOCK_RECORDINGS names no folder of recordings")
            continue
        started = time.monotonic()
        make(page, given.work.resolve(), made_by)
        print(f"make_pages: {page.file} after {time.monotonic() - started:.0f} s; about {left} min left")


if __name__ == "__main__":
    main()
