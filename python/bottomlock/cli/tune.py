"""The command `bottomlock tune`: the noise of a recorded dive from the recording itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, late_bar, narrow_table, say
from bottomlock.cli.parameters import Out, Threads, beside, check_case, check_threads, split

if TYPE_CHECKING:
    from rich.text import Text

    from bottomlock.replay.tune.run import Judged, Term, Tuned, TunedParameter


def tune(
    case: Path,
    *,
    out: Out = None,
    fraction: float = 0.5,
    methods: Annotated[
        str,
        Parameter(
            alias="-m",
            help="Methods whose predictions are scored, separated by commas, of tc, info, sway_current.",
        ),
    ] = "tc",
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
    from bottomlock.replay.tune.result import record_of, require_free, write_tuned
    from bottomlock.replay.tune.run import tune_case

    check_case(case)
    check_threads(threads)
    target = out or beside(case, "tuned.toml")
    require_free(case, target, force=force)
    loaded = load_case(case)
    require_free(case, target, inputs=[Path(loaded.dvl.geometry), *loaded.files().values()], force=force)
    names = tuple(split(methods) or ())
    with late_bar("tuning") as update:

        def report(iteration: int, passes: int) -> None:
            update(description=f"tuning, iteration {iteration}: {passes} passes")

        tuned = tune_case(loaded, fraction=fraction, methods=names, threads=threads, progress=report)
    write_tuned(case, tuned, target, force=force)
    print_tuned(tuned)
    say(f"{tuned.wall_s:.1f} s, {tuned.passes} passes; wrote {target} and {record_of(target)}")


def print_tuned(tuned: Tuned) -> None:
    """What was found, and what the rest of the recording says of it."""
    from bottomlock.replay.tune.passes import LEFT_OUT

    title = f"{tuned.case.name}: estimated on the first {tuned.fraction:.0%}"
    rows = map(_row, tuned.parameters)
    console.print(narrow_table(title, ["setting", "old", "new", "± 1σ", "gain"], rows))
    judged = []
    for old, new in _pairs(tuned):
        term = new or old
        assert term is not None
        after = "a step" if term.horizon_s == 0.0 else f"{term.horizon_s:g} s"
        after = f"up to {after}" if term.sensor == LEFT_OUT else after
        numbers = (_of(its, name) for name in ("error_over_sd", "score") for its in (old, new))
        judged.append([term.sensor, after, str(term.count), *numbers])
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


def _pairs(tuned: Tuned) -> list[tuple[Term | None, Term | None]]:
    by_term = [
        {(term.sensor, term.horizon_s): term for term in _terms(judged)} for judged in (tuned.old, tuned.new)
    ]
    keys = sorted({*by_term[0], *by_term[1]})
    return [(by_term[0].get(key), by_term[1].get(key)) for key in keys]


def _terms(judged: Judged | None) -> tuple[Term, ...]:
    return () if judged is None else judged.terms


def _of(term: Term | None, name: str) -> str:
    if term is None:
        return "–"
    value = getattr(term, name)
    return f"{-value if name == 'score' else value:.2f}"


def sentences(tuned: Tuned) -> list[str]:
    """The verdicts, a sentence a line."""
    from bottomlock.replay.tune.run import SUM_S

    lines = []
    for name, judged in (("old", tuned.old), ("new", tuned.new)):
        if judged is None:
            lines.append(f"{name} values: the filter ends in an error")
            continue
        measures = [
            f"innovations of the beams correlate by {judged.autocorrelation:.2f} with their neighbours (0 if white)",
            f"mean square of their sums over {SUM_S:g} s {judged.sums:.2f} (1 if white)",
        ]
        lines.append(f"{name} values: " + "; ".join(measures))
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
