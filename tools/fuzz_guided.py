"""Coverage-guided fuzzing of the readers, `python tools/fuzz_guided.py --seconds 600`; `make fuzz` runs it for each.

The first byte of an input chooses the format, the second the options and whether checksums are made right; the rest is
the file. It goes where tools/fuzz_readers.py's blind mutations do not: towards branches not yet seen. A finding stops
the run with an input written beside it. Needs `pip install atheris`.

The corpus starts from the records of tools/reader_seeds.py, which are made by code and hold nothing of a recording. It
grows in out/fuzz-corpus from run to run.
"""

import argparse
import functools
import subprocess
import sys
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

# What is to be covered has to be imported under instrumentation, before anything else imports it.
with atheris.instrument_imports(include=["bottomlock.io"]):
    from bottomlock.io.decoder import Format
from bottomlock.io.formats import BYTES
from tools import fuzz_readers, reader_seeds

LONGEST = 4096
MEMORY_MB = 2048
TIMEOUT_S = 20


def one_input(data: bytes, only: str | None = None) -> None:
    """Reads an input as its first two bytes say, or by the format `only`.

    Raises:
        AssertionError: for a finding.
    """
    if len(data) < 2:
        return
    form = BYTES[data[0] % len(BYTES)] if only is None else _form(only)
    body = data[2:]
    if data[1] & 0x80 and form.name in fuzz_readers.RIGHT:
        body = fuzz_readers.RIGHT[form.name](body)
    fault = fuzz_readers.try_one(form, body, fuzz_readers.OPTIONS[data[1] % len(fuzz_readers.OPTIONS)])
    if fault is not None:
        raise AssertionError(f"{form.name}: {fault}")


def _form(name: str) -> Format:
    return next(form for form in BYTES if form.name == name)


def each(seconds: int, seed: int) -> int:
    """Fuzzes every format in a process of its own; the number of formats with a finding."""
    failed = []
    for form in BYTES:
        command = [sys.executable, __file__, "--format", form.name, f"--seconds={seconds}", f"--seed={seed}"]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - itself
        words = ended.stderr.splitlines()
        runs = next((line.split()[-1] for line in words if "number_of_executed_units" in line), "?")
        print(
            f"{form.name:<24}{runs:>12} inputs  {'sound' if ended.returncode == 0 else 'FINDING'}", flush=True
        )
        if ended.returncode:
            failed.append(form.name)
            print("\n".join(words[-30:]))
    return len(failed)


def main() -> None:
    """Writes the seeds to a corpus and runs for the time given; the library ends the process."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corpus", type=Path, default=Path("out/fuzz-corpus"))
    parser.add_argument("--format", choices=[form.name for form in BYTES], help="this reader alone")
    parser.add_argument(
        "--each", action="store_true", help="every reader for so many seconds, one after another"
    )
    chosen = parser.parse_args()
    if chosen.each:
        sys.exit(1 if each(chosen.seconds, chosen.seed) else 0)
    if chosen.format:
        chosen.corpus /= chosen.format
    chosen.corpus.mkdir(parents=True, exist_ok=True)
    for k, form in enumerate(BYTES):
        if chosen.format not in {None, form.name}:
            continue
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
        f"-artifact_prefix={chosen.corpus.parent}/finding-",
        "-print_final_stats=1",
    ]
    atheris.Setup(arguments, functools.partial(one_input, only=chosen.format))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
