"""Sentences `$NAME,fields*HH` of a file's lines; HH is a checksum of what stands between `$` and `*`."""

import re
from collections.abc import Callable, Iterator

from bottomlock.io.account import Account
from bottomlock.io.sentences import LONGEST_LINE, lines_of


def pattern(name: bytes, longest: int) -> re.Pattern[bytes]:
    """Pattern of sentences: name, at most so many characters behind it, checksum in two hexadecimal digits."""
    return re.compile(rb"\$(%s(?:,[^*$]{0,%d})?)\*([0-9A-Fa-f]{2})" % (name, longest))


def sentences(
    data: bytes,
    form: re.Pattern[bytes],
    wanted: tuple[bytes, ...],
    fits: Callable[[bytes, int], bool],
    account: Account,
    *,
    trust: bool,
) -> Iterator[tuple[int, bytes]]:
    """Line and text, from `$` to `*`, of the wanted sentences of a file; what else there is goes to the account.

    Args:
        data: the file.
        form: what its sentences look like, as `pattern`.
        wanted: the names that are wanted.
        fits: whether a checksum is that of a text.
        account: for the counts.
        trust: keep sentences whose checksum does not fit, flagged.
    """
    for position, line in lines_of(data):
        account.read += 1
        if len(line) > LONGEST_LINE:
            account.skip("line too long", position, line)
            continue
        at = 0
        for match in form.finditer(line):
            account.read += at > 0
            at = match.end()
            text, digits = match.groups()
            if not fits(text, int(digits, 16)):
                if not trust:
                    account.skip("bad checksum", position, match.group())
                    continue
                account.flag("bad checksum, kept on request", position, match.group())
            name = text.split(b",", 1)[0]
            if name in wanted:
                yield position, text
            else:
                account.pass_by("$" + name.decode("ascii"), position)
        if not at:
            account.skip("truncated" if b"$" in line else "not a sentence", position, line)
        elif line[at:].strip():
            account.read += 1
            account.skip("truncated", position, line[at:])
