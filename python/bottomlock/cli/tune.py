"""The command `bottomlock tune`: the noise of a recorded dive from the recording itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, late_bar, narrow_table, say
from bottomlock.cli.parameters import Out, Threads, beside, check_case, check_threads

if TYPE_CHECKING:
    from rich.text import Text

    from bottomlock.replay.tune.run import Tuned, TunedParameter


def tune(
    case: Path,
    *,
    out: Out = None,
    fraction: float = 0.5,
    threads: Threads = 0,
    force: Force = False,
) -> None:
    """Find the noise of a recorded dive from the recording itself, without a reference.

    Args:
        case: The case of a replay: a TOML file.
        out: The tuned case, beside the case; CASE_tuned.toml by default.
        fraction: Part of the recording, from its start, to estimate on; the rest judges.
    """
    from bottomlock.replay.case import load_case
    from bottomlock.replay.tune.run import record_of, require_free, tune_case, write_tuned

    check_case(case)
    check_threads(threads)
    target = out or beside(case, "tuned.toml")
    require_free(case, target, force=force)
    loaded = load_case(case)
    require_free(case, target, inputs=[Path(loaded.dvl.geometry), *loaded.files().values()], force=force)
    with late_bar("tuning") as update:

        def report(done: float, passes: int) -> None:
            update(completed=done, total=1.0, description=f"tuning, {passes} passes")

        tuned = tune_case(loaded, fraction=fraction, threads=threads, progress=report)
    write_tuned(case, tuned, target, force=force)
    print_tuned(tuned)
    say(f"{tuned.wall_s:.1f} s, {tuned.passes} passes; wrote {target} and {record_of(target)}")


def print_tuned(tuned: Tuned) -> None:
    """What was found, and what the rest of the recording says of it."""
    title = f"{tuned.case.name}: estimated on the first {tuned.fraction:.0%}"
    console.print(narrow_table(title, ["setting", "old", "new", "± 1σ", "gain"], map(_row, tuned.parameters)))
    judged = []
    by_term: dict[tuple[str, float], dict[str, dict[str, float]]] = {}
    for term in tuned.terms:
        by_term.setdefault((term["sensor"], term["horizon_s"]), {})[term["values"]] = term
    for (sensor, horizon_s), of in sorted(by_term.items()):
        after = "a step" if horizon_s == 0.0 else f"{horizon_s:g} s"
        numbers = [
            f"{sign * of[name][column]:.2f}" if name in of else "–"
            for column, sign in (("error_over_sd", 1.0), ("score", -1.0))
            for name in ("old", "new")
        ]
        count = max(term["count"] for term in of.values())
        judged.append([sensor, after, str(count), *numbers])
    title = "on the rest: error/σ and mean log-likelihood a row"
    columns = ["measurement", "after", "number", "error/σ old", "new", "log-lik. old", "new"]
    console.print(narrow_table(title, columns, judged))
    for sentence in sentences(tuned):
        say(sentence)


def _row(parameter: TunedParameter) -> tuple[str | Text, ...]:
    from rich.text import Text

    old = f"{parameter.old:.3g}" if parameter.old != 0.0 else "–"
    if not parameter.is_determined:
        return parameter.words, old, Text("not determined", style="dim"), "–", "–"
    return parameter.words, old, f"{parameter.value:.3g}", f"{parameter.sd:.2g}", f"{parameter.gain:.3g}"


def sentences(tuned: Tuned) -> list[str]:
    """The verdicts, a sentence a line."""
    failed = [name for name in ("old", "new") if not any(term["values"] == name for term in tuned.terms)]
    lines = [f"{name} values: the filter ends in an error" for name in failed]
    outliers, beams = tuned.outliers
    lines.append(f"{outliers} of {beams} beam readings left out as outliers, of old and new alike")
    if not tuned.has_settled:
        lines.append("the search did not come to an end: tune the tuned case again")
    lines.append(_verdict(tuned))
    return lines


def _verdict(tuned: Tuned) -> str:
    gain = f"log-likelihood gain on the rest {tuned.gain:.1f} ± {tuned.gain_sd:.1f}"
    if not any(parameter.is_determined for parameter in tuned.parameters):
        return "the recording determines none of the settings: the old values are kept"
    if tuned.is_better:
        return f"{gain}: the new values are better and were written"
    return f"{gain}: the new values are not better there by more than chance; the old ones are kept"
