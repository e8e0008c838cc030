"""Coverage-guided fuzzing of the readers: `python tools/fuzz_guided.py --seconds 600`; needs `pip install atheris`.

The first byte of an input chooses the format, the second the options and whether checksums are made right; the rest is
the file. It goes where tools/fuzz_readers.py's blind mutations do not: towards branches not yet seen. A finding stops
the run with an input written beside it.
"""

import argparse
import sys
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

# What is to be covered has to be imported under instrumentation, before anything else imports it.
with atheris.instrument_imports(include=["bottomlock.io"]):
    from bottomlock.io.formats import BYTES

from tools import fuzz_readers, reader_seeds

LONGEST = 4096
MEMORY_MB = 2048
TIMEOUT_S = 20


def one_input(data: bytes) -> None:
    """Reads an input as its first two bytes say.

    Raises:
        AssertionError: for a finding.
    """
    if len(data) < 2:
        return
    form = BYTES[data[0] % len(BYTES)]
    body = data[2:]
    if data[1] & 0x80 and form.name in fuzz_readers.RIGHT:
        body = fuzz_readers.RIGHT[form.name](body)
    fault = fuzz_readers.try_one(form, body, fuzz_readers.OPTIONS[data[1] % len(fuzz_readers.OPTIONS)])
    if fault is not None:
        raise AssertionError(f"{form.name}: {fault}")


def main() -> None:
    """Writes the seeds to a corpus and runs for the time given; the library ends the process."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corpus", type=Path, default=Path("out/fuzz-corpus"))
    chosen = parser.parse_args()
    chosen.corpus.mkdir(parents=True, exist_ok=True)
    for k, form in enumerate(BYTES):
        for j, seed in enumerate(reader_seeds.seeds()[form.name]):
            for options in (0x00, 0x81):
                (chosen.corpus / f"{form.name}-{j}-{options:02x}").write_bytes(bytes([k, options]) + seed)
    arguments = [
        sys.argv[0],
        str(chosen.corpus),
        f"-max_total_time={chosen.seconds}",
        f"-seed={chosen.seed}",
        f"-max_len={LONGEST}",
        f"-rss_limit_mb={MEMORY_MB}",
        f"-timeout={TIMEOUT_S}",
        f"-artifact_prefix={chosen.corpus.parent}/",
        "-print_final_stats=1",
    ]
    atheris.Setup(arguments, one_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
