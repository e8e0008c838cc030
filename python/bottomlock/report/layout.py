"""A campaign laid out: which method to use, each trajectory, virtual beam, sweep, the paper's claims, settings."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from bottomlock.files.campaign_tables import CampaignTables
from bottomlock.files.columns import VIRTUAL_BEAM_FACTOR
from bottomlock.pages.page import Block, Coloured, Detail, Page, Part, Table, Terms
from bottomlock.pages.pieces import glossaries, interval, json_part, title_of
from bottomlock.report.advice import REFERENCES, Advice, Choice, swept_current, untested_in_current
from bottomlock.report.drawings import (
    Content,
    consistency,
    errors_over_time,
    every_method,
    paths,
    sweeps,
    virtual_beam,
)
from bottomlock.statistics.campaign import runs_mostly_rejected, summary_table
from bottomlock.statistics.claim_verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED
from bottomlock.statistics.claims import Claim, ImprovementClaim, ValueClaim
from bottomlock.statistics.compare import flat_settings
from bottomlock.text import number

_CALIBRATION = """\
Left figure: a method moves along its curve with time. **On the diagonal** the error is as large as the filter claims.
**In the grey half** it is larger: the filter is overconfident, and rejects good beams. **Below the diagonal** it is
smaller: the filter is merely cautious. A curve along the diagonal drifts and says so; one that climbs straight up
drifts and does not know it, however small its error is at the end."""
_PAPER = "Tal, Klein & Katz 2017, reproduced"
_NO_TRUTH = "They are not drawn: the directory has no truth.parquet."
_SLENDER = (
    '`sway_current` assumes a slender vehicle unless `vehicle` in `[filter.water]` names another, as "hovering" '
    "(docs/hovering.md)."
)
_RECOMMENDED = (
    "Consistent on a trajectory: the mean NEES of velocity and attitude over runs is at none of the judged times above "
    "its chi-squared band, and the gate rejects more than half of the fixes in no run. Recommended: consistent on "
    "every trajectory of this campaign, and overconfident in no cell of the published studies "
    "(docs/evidence.md) with the same returning beams{}. Least error: RMS over runs of the velocity error at the "
    "end; methods within 5 % of it are named with it. The configuration below states which beams are lost; `lc` "
    "loses none."
)
_VIRTUAL_BEAM = (
    "The paper scales the variance of the virtual beam by a factor n_f and prints no value for it. The figures and "
    "claims of this page take n_f = 1, which is its equation with nothing added. The virtual beam is made from the "
    "filter's own velocity and counted as if it were a measurement; a larger n_f counts it for less, and with n_f "
    "large enough `vb` becomes `tc`."
)
_SWEEP = (
    "What the paper leaves open, one setting at a time; everything else is as in the configuration below. Velocity "
    "error at the end, RMS over runs."
)
_FINAL = (
    "RMS over runs at the last second, with 95 % bootstrap intervals. NEES: mean over runs and time; the verdict is "
    "about the one of the six states of velocity and attitude. NIS: mean over fixes. Rejected: fraction of the fixes "
    "that the gate rejects, and the runs in which it rejects more than half."
)
_CONSISTENCY = (
    "Mean NEES over runs and time, and the least and the greatest mean over runs at {} times, on which the verdict is: "
    "above the band at any of them is overconfident. Expected: of a consistent filter in {} runs; the bands of the "
    "whole campaign have a false-alarm rate of 1 %."
)
_STILL = (
    "The water of this campaign is still, so it does not test the assumption of {} that the sway over ground is "
    "zero. Such a method has the least error in still water, because the vehicle slips little; a current across its "
    "course appears in full as an error."
)
_INTERVALS = (
    "Section and figure numbers are the paper's; intervals are 95 % bootstrap intervals over whole runs, paired "
    "between methods."
)
_ORDERINGS = (
    "An ordering is the ratio of the errors of two methods; it holds where the ratio is below 1 ×. A drift is the "
    "ratio of the error at the end of the window to that at its start."
)


def page_of(content: Content) -> Page:
    """A campaign as a page; its figures are drawn into `content.pictures`."""
    campaign, names = content.campaign, content.campaign.trajectories
    parts = [
        _summary(content),
        Part("trajectories", "The trajectories", [*paths(content)] or [_NO_TRUTH]),
        *(_trajectory(content, name, first=name == names[0]) for name in names),
        *([_sweep(content, campaign.sweep)] if campaign.sweep is not None else []),
        *([_claims(content)] if content.claims.height else []),
        _configuration(campaign),
        json_part("manifest", "Manifest", "manifest.json", campaign.manifest),
    ]
    runs = ", ".join(
        f"{campaign.manifest['scenarios'][name]['runs']} runs of {_words(name)}" for name in names
    )
    version = f"bottomlock {campaign.manifest['version']}"
    return Page(
        _PAPER if content.claims.height else "Aided navigation with the beams that return",
        parts, version,
        about=f"{runs}; {version}, configuration `{campaign.manifest['configuration_hash'][:12]}`",
        headline=_headline(content),
    )  # fmt: skip


def _words(name: str) -> str:
    return name.replace("_", " ")


def _code(methods: Iterable[str], last: str = ", ") -> str:
    *others, end = [f"`{method}`" for method in methods]
    return f"{', '.join(others)}{last}{end}" if others else end


def _share(part: float | None) -> str:
    return "–" if part is None or not math.isfinite(part) else f"{number(100.0 * part, 2)} %"


def _headline(content: Content) -> list[str]:
    claims = content.claims
    counts = [f"Of [{claims.height} claims](#claims) {_verdicts(claims)}."] if claims.height else []
    if content.choice is None:
        return [
            *counts,
            "No method of this campaign is consistent on every trajectory and in the published studies.",
        ]
    return [*counts, f"Use {_code(content.choice.best, ' or ')}."]


def _why(choice: Choice) -> str:
    """Why the methods of the headline are to be used."""
    trajectory = _words(choice.worst_trajectory)
    most = f"nowhere more than {number(choice.worst_ratio)} times the least of these ({trajectory})"
    is_least = choice.worst_ratio < 1.005
    return (
        f"Consistent on every trajectory and in the published studies: {_code(choice.recommended)}. The velocity error "
        f"of {_code(choice.best)} is {'the least of these everywhere' if is_least else most}."
    )


def _summary(content: Content) -> Part:
    """Which method to use, its first figures, the methods, and what each trajectory says."""
    campaign, choice, names = content.campaign, content.choice, content.campaign.trajectories
    blocks: list[Block] = [] if choice is None else [_why(choice)]
    if "sway_current" in content.best:
        blocks.append(_SLENDER)
    first = dict.fromkeys([*(method for name in names for method in content.shown(name)), *content.best])
    blocks += [
        *(errors_over_time(content, name, "velocity") for name in names),
        _advice_table(content.advice),
        *glossaries((method for name in names for method in campaign.methods(name)), first),
    ]
    rows = [row for part in content.advice for row in _not_recommended(content, part)]
    if rows:
        columns = ["Trajectory", "Method", "Why it is not recommended", "Velocity, m/s"]
        methods = ", ".join(dict.fromkeys(row[1] for row in rows))
        blocks.append(
            Detail(
                f"Not recommended: {methods}",
                [Table(columns, rows, "Velocity error at the end, RMS over runs.", left=3)],
            )
        )
    untested = untested_in_current(campaign)
    if untested:
        blocks.append(_STILL.format(_code(untested)))
    anywhere = any(part.beams is None for part in content.advice)
    meant = _RECOMMENDED.format(
        "; with any beams where those of the campaign change or were not flown there" if anywhere else ""
    )
    blocks.append(Detail("What “recommended” means", [meant]))
    return Part("summary", "Which method to use", blocks)


def _advice_table(advice: Sequence[Advice]) -> Table:
    """The recommended methods of each trajectory beside the references."""
    references = [name for name in REFERENCES if any(name in part.velocity_rms_mps for part in advice)]
    rows = []
    for part in advice:
        velocity = part.velocity_rms_mps
        known = [number(velocity[name]) if name in velocity else "–" for name in references]
        ins = number(part.attitude_rms_deg["ins"]) if "ins" in part.attitude_rms_deg else "–"
        if part.best:
            attitude = " to ".join(dict.fromkeys(number(value) for value in part.attitude_range_deg))
            cells = [_code(part.best), number(velocity[part.best[0]]), *known, attitude, ins]
        else:
            cells = ["no method to recommend", "–", *known, "–", ins]
        rows.append([title_of(part.trajectory), *cells])
    columns = [
        "Trajectory", "Recommended", "Velocity, m/s", *(f"{name} ({REFERENCES[name]})" for name in references),
        "Misalignment of the consistent, °", "of ins, °",
    ]  # fmt: skip
    caption = "The least velocity error of the recommended methods at the end, RMS over runs, beside the references."
    return Table(columns, rows, caption, left=2)


def _not_recommended(content: Content, part: Advice) -> Iterator[list[str]]:
    """A row for each method that is not recommended on a trajectory: its error, and why."""
    runs = content.campaign.manifest["scenarios"][part.trajectory]["runs"]
    in_current = swept_current(content.campaign.sweep, part.trajectory)
    for name in dict.fromkeys([*part.consistent_here_only, *part.overconfident, *part.mostly_rejected]):
        why = [part.consistent_here_only[name]] if name in part.consistent_here_only else []
        if why and name in in_current:
            speed, error, nees = in_current[name]
            why.append(
                f"{number(error)} m/s and NEES {number(nees)} in a current of {speed:g} m/s ([sweep](#sweep))"
            )
        why += ["overconfident"] if name in part.overconfident else []
        if name in part.mostly_rejected:
            why.append(f"the gate rejects most fixes in {part.mostly_rejected[name]} of {runs} runs")
        yield [title_of(part.trajectory), f"`{name}`", "; ".join(why), number(part.velocity_rms_mps[name])]


def _trajectory(content: Content, name: str, *, first: bool) -> Part:
    """One trajectory: error against claim, errors at the end, every method, consistency."""
    count = len(content.campaign.methods(name))
    blocks: list[Block] = [
        "### Does the filter know how wrong it is?",
        *consistency(content, name),
        *([_CALIBRATION] if first else []),
        "### Errors at the end",
        _final_table(content.campaign, name),
        Detail(f"All {count} methods on {_words(name)}, and error over σ", [*every_method(content, name)]),
        Detail("Consistency in numbers", [_consistency_table(content.campaign, name)]),
    ]
    return Part(f"on-{name}", title_of(name), blocks)


def _final_table(campaign: CampaignTables, name: str) -> Table:
    """A row per method: errors at the end with intervals, NEES, gate, verdict."""
    runs = campaign.runs.filter(trajectory=name)
    six = campaign.consistency.filter(trajectory=name, quantity="nees_velocity_attitude")
    rows = summary_table(campaign.ensemble, campaign.runs).filter(trajectory=name)
    cells = []
    for row in rows.join(six, on="method", how="left", maintain_order="left").iter_rows(named=True):
        mostly = runs_mostly_rejected(runs.filter(method=row["method"]))
        rejected = f"<br>most in {mostly} {'run' if mostly == 1 else 'runs'}" if mostly else ""
        intervals = (
            interval(*[row[f"{quantity}_rms_over_runs{end}_{unit}"] for end in ("", "_lo", "_hi")])
            for quantity, unit in (("velocity", "mps"), ("attitude", "deg"))
        )
        numbers = (
            "position_rms_over_runs_m", "mean", "nees_mean_over_runs_and_time", "nis_mean_over_runs_and_fixes"
        )  # fmt: skip
        cells.append(
            [
                f"`{row['method']}`", row["verdict"] or "–", *intervals, *(number(row[key]) for key in numbers),
                f"{_share(row['rejected_fraction'])}{rejected}",
            ]
        )  # fmt: skip
    states = campaign.manifest.get("nees_degrees", {}).get(name, "all")
    columns = [
        "Method", "Verdict", "Velocity, m/s", "Attitude, °", "Position, m", "NEES, 6 states", f"NEES, {states} states",
        "NIS", "Rejected",
    ]  # fmt: skip
    return Table(columns, cells, _FINAL, left=2)


def _consistency_table(campaign: CampaignTables, name: str) -> Table:
    """A row per method and kind of NEES, with the verdict."""
    rows = campaign.consistency.filter(trajectory=name).sort("quantity", maintain_order=True)
    kinds = {"nees": "whole state", "nees_velocity_attitude": "velocity, attitude"}
    cells = [
        [
            f"`{row['method']}`", kinds[row["quantity"]], row["verdict"] or "–",
            *(number(row[which]) for which in ("mean", "least", "greatest")),
            f"{row['degrees']} ({number(row['band_lo'])} … {number(row['band_hi'])})",
        ]
        for row in rows.iter_rows(named=True)
    ]  # fmt: skip
    columns = ["Method", "NEES of", "Verdict", "Mean", "Least", "Greatest", "Expected"]
    return Table(columns, cells, _CONSISTENCY.format(rows["times"][0], rows["runs"][0]), left=3)


def _sweep(content: Content, sweep: pl.DataFrame) -> Part:
    """Every swept setting: its figures, and its rows."""
    blocks: list[Block] = [_SWEEP]
    numbers = {
        parameter: k for k, parameter in enumerate(sweep["parameter"].unique(maintain_order=True), start=1)
    }
    for (parameter,), rows in sweep.sort("parameter", maintain_order=True).group_by(
        "parameter", maintain_order=True
    ):
        blocks += [f"### `{parameter}`", *sweeps(content, numbers[parameter], str(parameter), rows)]
        if parameter == VIRTUAL_BEAM_FACTOR:
            blocks += [_VIRTUAL_BEAM, *_virtual_beam(content)]
        cells = [
            [
                row["value"], _words(row["trajectory"]), f"`{row['method']}`",
                number(row["velocity_rms_over_runs_mps"]),
                number(row["attitude_rms_over_runs_deg"]), number(row["nees_mean_over_runs_and_time"]),
                _share(row["rejected_fraction"]),
            ]
            for row in rows.iter_rows(named=True)
        ]  # fmt: skip
        columns = ["Value", "Trajectory", "Method", "Velocity, m/s", "Attitude, °", "NEES", "Rejected"]
        caption = "RMS over runs at the end; mean NEES of the whole state over runs and time."
        blocks.append(
            Detail(f"{rows.height} rows in numbers", [Table(columns, cells, caption, left=3)], printed=False)
        )
    return Part("sweep", "Sweep", blocks)


def _virtual_beam(content: Content) -> Iterator[Table]:
    """`vb` as the paper prints it and with the factor of least velocity error, beside `tc`."""
    rows = []
    for name in content.campaign.trajectories:
        known = virtual_beam(content.campaign.sweep, name)
        if known:
            printed, best, tc = (
                [number(known[key][of]) if key in known else "–" for of in _ERROR_AND_NEES]
                for key in ("printed", "best", "tc")
            )
            rows.append([title_of(name), *printed, known["best"]["value"], *best, *tc])
    columns = [
        "Trajectory", "vb, n_f = 1: m/s", "NEES, n_f = 1", "Best n_f swept", "vb at it: m/s", "NEES at it", "tc: m/s",
        "NEES of tc",
    ]  # fmt: skip
    caption = "Velocity error at the end, RMS over runs, and mean NEES of the whole state, in the runs of the sweep."
    if rows:
        yield Table(columns, rows, caption)


_ERROR_AND_NEES = ("velocity_rms_over_runs_mps", "nees_mean_over_runs_and_time")


def _verdicts(claims: pl.DataFrame) -> str:
    """How many claims have each verdict."""
    counts = [
        (word, int((claims["verdict"] == word).sum())) for word in (REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE)
    ]
    return ", ".join(f"{count} {'is' if count == 1 else 'are'} {word}" for word, count in counts)


def _claims(content: Content) -> Part:
    """Every claim of the paper on the trajectories that were run as in it, with its verdict."""
    claims, paper = content.claims, content.paper
    blocks: list[Block] = [
        f"Of {claims.height} claims {_verdicts(claims)}. {paper.source}. {_INTERVALS}",
        Detail("When a claim counts as reproduced", [Terms(list(paper.rules.items())), _ORDERINGS]),
    ]
    by_id: dict[str, Claim] = {claim.id: claim for claim in paper.claim}
    for (name,), rows in claims.group_by("trajectory", maintain_order=True):
        trajectory = _words(str(name))
        table = Table(
            ["Claim", "Verdict", "Measured", "Paper", "Ours", "95 %"],
            [_claim_cells(by_id[row["claim"]], row) for row in rows.iter_rows(named=True)],
            f"Claims of the paper on {trajectory}: what it prints, what this campaign has, and how far the two agree.",
            left=3,
            ids=rows["claim"].to_list(),
        )
        blocks.append(Detail(f"{rows.height} claims on {trajectory}: {_verdicts(rows)}", [table]))
    return Part("claims", "The paper's claims", blocks)


def _claim_cells(claim: Claim, row: Mapping[str, Any]) -> list[str]:
    unit = " ×"
    if isinstance(claim, ImprovementClaim):
        unit = " %"
    elif isinstance(claim, ValueClaim):
        unit = " m/s" if claim.quantity == "velocity" else "°"
    reading = f"{claim.reading[:1].upper()}{claim.reading[1:]}"
    quantity = row["quantity"].split("_")[0].capitalize()
    says = f"{quantity}: {claim.says}<br>Section {claim.place}. {reading}. Rule: {claim.rule}."
    printed = "" if row["paper"] is None else f"{row['paper']:g}{unit}"
    ours = "" if row["ours"] is None else f"{number(row['ours'])}{unit}"
    interval = "" if row["ours"] is None else f"{number(row['lo'])} … {number(row['hi'])}"
    verdict = Coloured(row["verdict"], row["verdict"].replace(" ", "-"))
    return [says, verdict, row["note"], printed, ours, interval]


def _configuration(campaign: CampaignTables) -> Part:
    """Every setting by its dotted name, with its value on each trajectory; one value where all agree."""
    flat = [flat_settings(campaign.configuration(name)) for name in campaign.trajectories]
    rows = []
    for key in dict.fromkeys(key for part in flat for key in part):
        values = [part.get(key, "–") for part in flat]
        rows.append([f"`{key}`", " | ".join(values[:1] if len(set(values)) == 1 else values)])
    caption = (
        "Every setting by its name in the scenario file; one value where the trajectories agree, otherwise one each "
        f"in the order {', '.join(map(_words, campaign.trajectories))}."
    )
    table = Table(["Setting", "Value"], rows, caption, left=2)
    return Part("configuration", "Configuration", [Detail(f"{len(rows)} settings", [table], printed=False)])
