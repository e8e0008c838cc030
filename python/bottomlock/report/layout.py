"""A campaign laid out: which method to use, each trajectory, virtual beam, sweep, the paper's claims, settings."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from bottomlock.pages.page import Block, Coloured, Folded, Page, Part, Picture, Table, Terms, listed
from bottomlock.pages.pieces import featured, glossaries, interval, json_part, number, title_of
from bottomlock.paper.claims import Claim, ImprovementClaim, Paper, ValueClaim
from bottomlock.paper.verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED
from bottomlock.report.advice import REFERENCES, Advice, Choice, swept_current, untested_in_current
from bottomlock.report.drawings import Drawing, virtual_beams
from bottomlock.statistics.campaign import runs_mostly_rejected, summary_table
from bottomlock.tables.results import CampaignTables
from bottomlock.tables.studies import VIRTUAL_BEAM_FACTOR

_FIRST_CALIBRATION = """\
The horizontal axis is the σ that the filter claims for its velocity, the vertical axis the error that it makes. A
method moves along its curve with time, and the ring is where it ends.

**On the diagonal** the error is as large as claimed: the σ can be used, by a gate or by the next system. **In the grey
half** the error is larger than claimed: the filter is overconfident, rejects good beams and is trusted where it should
not be. **Below the diagonal** the error is smaller than claimed: the filter is merely cautious.

A curve that runs to the upper right along the diagonal drifts and says so. A curve that climbs straight up drifts and
does not know it: a small error at the end does not make up for that."""
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


@dataclass(frozen=True)
class Content:
    """What the page of a campaign is made from.

    Attributes:
        campaign: its tables.
        paper: its claims.
        claims: their verdicts, of the trajectories that were run as in the paper.
        advice: recommendations for each trajectory.
        choice: the method for all of them, None where there is none.
        figures: drawn, each with its picture.
    """

    campaign: CampaignTables
    paper: Paper
    claims: pl.DataFrame
    advice: Sequence[Advice]
    choice: Choice | None
    figures: Sequence[tuple[Drawing, Picture]]

    def pictures(
        self, place: str, trajectory: str | None = None, parameter: str | None = None
    ) -> list[Picture]:
        """The figures of a place of the page, of a trajectory or a swept setting alone where one is named."""
        return [
            picture
            for drawing, picture in self.figures
            if drawing.place == place
            and trajectory in (None, drawing.trajectory)
            and parameter in (None, drawing.parameter)
        ]


def page_of(content: Content) -> Page:
    """A campaign as a page."""
    campaign, names = content.campaign, content.campaign.trajectories
    beams = virtual_beams(campaign.sweep, names)
    paths: list[Block] = [*content.pictures("overview")]
    if campaign.paths is None:
        paths.append("They are not drawn: the directory has no truth.parquet.")
    parts = [
        _summary(content),
        Part("trajectories", "The trajectories", paths),
        *(_trajectory(content, name, first=name == names[0]) for name in names),
        *([_virtual_beam(content)] if beams else []),
        *([_sweep(content, campaign.sweep, drawn_above=bool(beams))] if campaign.sweep is not None else []),
        *([_claims(content)] if content.claims.height else []),
        _configuration(campaign),
        json_part("manifest", "Manifest", "manifest.json", campaign.manifest),
    ]
    runs = ", ".join(
        f"{campaign.manifest['scenarios'][name]['runs']} runs of {_words(name)}" for name in names
    )
    version = f"bottomlock {campaign.manifest['version']}"
    return Page(
        "Aided navigation with the beams that return", [], parts, version,
        about=f"{runs}; {version}, configuration `{campaign.manifest['configuration_hash'][:12]}`",
        headline=_headline(content.choice),
    )  # fmt: skip


def _words(name: str) -> str:
    return name.replace("_", " ")


def _code(methods: Iterable[str], last: str = ", ") -> str:
    *others, end = [f"`{method}`" for method in methods]
    return f"{', '.join(others)}{last}{end}" if others else end


def _share(part: float | None) -> str:
    return "–" if part is None or not math.isfinite(part) else f"{number(100.0 * part, 2)} %"


def _headline(choice: Choice | None) -> list[str]:
    if choice is None:
        return ["No method of this campaign is consistent on every trajectory and in the published studies."]
    return [f"Use {_code(choice.best, ' or ')}."]


def _why(choice: Choice, *, several: bool) -> str:
    """Why the methods of the headline are to be used."""
    count = len(choice.recommended)
    which = f"Of the {count} methods that are" if count > 1 else "The only method that is"
    where = "every trajectory" if several else "this trajectory"
    words = f"{which} consistent on {where} and in the published studies"
    if count == 1:
        return f"{words}."
    these = "these have" if len(choice.best) > 1 else "this one has"
    if choice.worst_ratio < 1.005:
        return f"{words}, {these} the least velocity error everywhere."
    these = "these are" if len(choice.best) > 1 else "this one is"
    return (
        f"{words}, {these} nowhere far from the best: at most {number(choice.worst_ratio)} times the least velocity "
        f"error ({_words(choice.worst_trajectory)})."
    )


def _summary(content: Content) -> Part:
    """Which method to use, its first figures, the methods, and what each trajectory says."""
    campaign, choice = content.campaign, content.choice
    several = len(campaign.trajectories) > 1
    blocks: list[Block] = []
    if choice is not None:
        blocks.append(_why(choice, several=several))
        if "sway_current" in choice.best:
            blocks.append(
                "`sway_current` assumes a slender vehicle unless `vehicle` in `[filter.water]` names "
                'another, as "hovering" (docs/hovering.md).'
            )
    blocks += content.pictures("first")
    best = choice.best if choice is not None else ()
    shown = [
        method for name in campaign.trajectories for method in featured(campaign.methods(name), best[:1])
    ]
    first = list(dict.fromkeys([*shown, *best]))
    known = (method for name in campaign.trajectories for method in campaign.methods(name))
    blocks += [
        *glossaries(known, first),
        _advice_table(content.advice),
        *(_not_recommended(content, part) for part in content.advice if _failing(part)),
    ]
    untested = untested_in_current(campaign)
    if untested:
        blocks.append(_STILL.format(_code(untested)))
    if content.claims.height:
        blocks.append(
            f"Of [{content.claims.height} claims of the paper](#claims) {_verdicts(content.claims)}."
        )
    anywhere = any(part.beams is None for part in content.advice)
    meant = _RECOMMENDED.format(
        "; with any beams where those of the campaign change or were not flown there" if anywhere else ""
    )
    recommended = [] if choice is None else [f"Recommended here: {_code(choice.recommended)}."]
    blocks.append(Folded("What “recommended” means", [*recommended, meant]))
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


def _failing(part: Advice) -> list[str]:
    """Methods that are not recommended on a trajectory."""
    return list(dict.fromkeys([*part.consistent_here_only, *part.overconfident, *part.mostly_rejected]))


def _not_recommended(content: Content, part: Advice) -> Folded:
    """The methods that are not recommended on a trajectory, and why."""
    runs = content.campaign.manifest["scenarios"][part.trajectory]["runs"]
    in_current = swept_current(content.campaign.sweep, part.trajectory)
    velocity, blocks = part.velocity_rms_mps, []
    lines = []
    for name, why in part.consistent_here_only.items():
        line = f"`{name}` {number(velocity[name])} m/s: {why}"
        if name in in_current:
            speed, error, nees = in_current[name]
            line += f"; {number(error)} m/s and NEES {number(nees)} in a current of {speed:g} m/s ([sweep](#sweep))"
        lines.append(line)
    if lines:
        blocks += ["Consistent on this trajectory, but not recommended:", listed(lines)]
    if part.overconfident:
        errors = ", ".join(f"`{name}` {number(velocity[name])}" for name in part.overconfident)
        blocks.append(f"Overconfident, and so not recommended at any error: {errors} m/s.")
    if part.mostly_rejected:
        counts = ", ".join(
            f"`{name}` in {count} {'run' if count == 1 else 'runs'}"
            for name, count in part.mostly_rejected.items()
        )
        blocks.append(f"The gate rejects more than half of the fixes of {counts} of {runs}.")
    return Folded(f"Not recommended on {_words(part.trajectory)}: {', '.join(_failing(part))}", blocks)


def _trajectory(content: Content, name: str, *, first: bool) -> Part:
    """One trajectory: error against claim, errors at the end, every method, consistency."""
    final = _final_rows(content.campaign, name)
    again = (
        "Right: the σ that the filter claims. Up: the error. In the grey half the filter is overconfident; along the "
        f"diagonal it drifts and says so ([more](#on-{content.campaign.trajectories[0]}))."
    )
    every = content.pictures("every method", name)
    chosen = any(drawing.name == f"choices_{name}" for drawing, _ in content.figures)
    words = f"All {len(final)} methods on {_words(name)}: a panel each, error over σ by component"
    blocks: list[Block] = [
        "### Does the filter know how wrong it is?",
        *content.pictures("calibration", name),
        _FIRST_CALIBRATION if first else again,
        *content.pictures("trajectory", name),
        "### Errors at the end",
        _final_table(content.campaign, name, final),
        Folded(f"{words}{', selections' if chosen else ''}", every),
        Folded("Consistency in numbers", [_consistency_table(content.campaign, name)]),
    ]
    return Part(f"on-{name}", title_of(name), blocks)


def _final_rows(campaign: CampaignTables, name: str) -> list[dict[str, Any]]:
    """A row per method: errors at the end with intervals, NEES, gate, verdict."""
    table = summary_table(campaign.ensemble, campaign.runs).filter(pl.col("trajectory") == name)
    verdicts = campaign.consistency.filter(
        (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
    ).select("method", "verdict", pl.col("mean").alias("nees_velocity_attitude"))
    return table.join(verdicts, on="method", how="left", maintain_order="left").to_dicts()


def _final_table(campaign: CampaignTables, name: str, rows: Iterable[Mapping[str, Any]]) -> Table:
    runs = campaign.runs.filter(pl.col("trajectory") == name)
    cells = []
    for row in rows:
        mostly = runs_mostly_rejected(runs.filter(pl.col("method") == row["method"]))
        rejected = f"<br>most in {mostly} {'run' if mostly == 1 else 'runs'}" if mostly else ""
        cells.append(
            [
                f"`{row['method']}`",
                row["verdict"] or "–",
                *(
                    _interval(row, quantity, unit)
                    for quantity, unit in (("velocity", "mps"), ("attitude", "deg"))
                ),
                number(row["position_rms_over_runs_m"]),
                number(row["nees_velocity_attitude"]),
                number(row["nees_mean_over_runs_and_time"]),
                number(row["nis_mean_over_runs_and_fixes"]),
                f"{_share(row['rejected_fraction'])}{rejected}",
            ]
        )
    states = campaign.manifest.get("nees_degrees", {}).get(name, "all")
    columns = [
        "Method", "Verdict", "Velocity, m/s", "Attitude, °", "Position, m", "NEES, 6 states", f"NEES, {states} states",
        "NIS", "Rejected",
    ]  # fmt: skip
    return Table(columns, cells, _FINAL, left=2)


def _interval(row: Mapping[str, Any], quantity: str, unit: str) -> str:
    value, low, high = (row[f"{quantity}_rms_over_runs{end}_{unit}"] for end in ("", "_lo", "_hi"))
    return interval(value, low, high, number)


def _consistency_table(campaign: CampaignTables, name: str) -> Table:
    """A row per method: both kinds of NEES with their verdicts."""
    rows: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in campaign.consistency.filter(pl.col("trajectory") == name).iter_rows(named=True):
        rows.setdefault(row["method"], {})[row["quantity"]] = row
    kinds = ("nees_velocity_attitude", "nees")
    cells = [
        [
            f"`{method}`",
            *(of[kind]["verdict"] or "–" for kind in kinds),
            *(number(of[kind][which]) for kind in kinds for which in ("mean", "least", "greatest")),
        ]
        for method, of in rows.items()
    ]
    columns = [
        "Method", "Velocity, attitude", "Whole state",
        "NEES, velocity, attitude", "Least", "Greatest", "NEES, whole state", "Least", "Greatest",
    ]  # fmt: skip
    some = next(iter(rows.values()))
    bands = [
        f"{some[kind]['degrees']} ({number(some[kind]['band_lo'])} … {number(some[kind]['band_hi'])})"
        for kind in kinds
    ]
    caption = (
        "Mean NEES over runs and time, and the least and the greatest mean over runs at "
        f"{some['nees']['times']} times, on which the verdict is: above the band at "
        "any of them is overconfident. A consistent filter has "
        f"{bands[0]} for velocity and attitude and {bands[1]} for the whole state, {some['nees']['runs']} runs; the "
        "bands of the whole campaign have a false-alarm rate of 1 %."
    )
    return Table(columns, cells, caption, left=3)


def _virtual_beam(content: Content) -> Part:
    """`vb` as the paper prints it, and with the factor of least velocity error."""
    rows = []
    for one in virtual_beams(content.campaign.sweep, content.campaign.trajectories):
        pairs = [
            [number(row[key]) if row is not None else "–" for key in _ERROR_AND_NEES]
            for row in (one.printed, one.best, one.tc)
        ]
        rows.append([title_of(one.trajectory), *pairs[0], one.best["value"], *pairs[1], *pairs[2]])
    columns = [
        "Trajectory", "vb, n_f = 1: m/s", "NEES, n_f = 1", "Best n_f swept", "vb at it: m/s", "NEES at it", "tc: m/s",
        "NEES of tc",
    ]  # fmt: skip
    caption = "Velocity error at the end, RMS over runs, and mean NEES of the whole state, in the runs of the sweep."
    figures = content.pictures("sweep", parameter=VIRTUAL_BEAM_FACTOR)
    return Part(
        "virtual-beam",
        "vb, as printed and at its best",
        [_VIRTUAL_BEAM, *figures, Table(columns, rows, caption)],
    )


_ERROR_AND_NEES = ("velocity_rms_over_runs_mps", "nees_mean_over_runs_and_time")


def _sweep(content: Content, sweep: pl.DataFrame, *, drawn_above: bool) -> Part:
    """Every swept setting: its figures, and its rows."""
    blocks: list[Block] = [_SWEEP]
    for (parameter,), rows in sweep.sort("parameter", maintain_order=True).group_by(
        "parameter", maintain_order=True
    ):
        blocks.append(f"### `{parameter}`")
        above = drawn_above and parameter == VIRTUAL_BEAM_FACTOR
        blocks += (
            ["Drawn [above](#virtual-beam)."]
            if above
            else content.pictures("sweep", parameter=str(parameter))
        )
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
            Folded(f"{rows.height} rows in numbers", [Table(columns, cells, caption, left=3)], printed=False)
        )
    return Part("sweep", "Sweep", blocks)


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
        Folded("When a claim counts as reproduced", [Terms(list(paper.rules.items())), _ORDERINGS]),
    ]
    by_id: dict[str, Claim] = {claim.id: claim for claim in paper.claim}
    for (name,), rows in claims.group_by("trajectory", maintain_order=True):
        words = _words(str(name))
        table = Table(
            ["Claim", "Verdict", "Measured", "Paper", "Ours", "95 %"],
            [_claim_cells(by_id[row["claim"]], row) for row in rows.iter_rows(named=True)],
            f"Claims of the paper on {words}: what it prints, what this campaign has, and how far the two agree.",
            left=3,
            ids=rows["claim"].to_list(),
        )
        blocks.append(Folded(f"{rows.height} claims on {words}: {_verdicts(rows)}", [table]))
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
    flat = [_flatten(campaign.configuration(name)) for name in campaign.trajectories]
    rows = []
    for key in dict.fromkeys(key for part in flat for key in part):
        values = [part.get(key, "–") for part in flat]
        rows.append([f"`{key}`", " | ".join(values[:1] if len(set(values)) == 1 else values)])
    caption = (
        "Every setting by its name in the scenario file; one value where the trajectories agree, otherwise one each "
        f"in the order {', '.join(map(_words, campaign.trajectories))}."
    )
    table = Table(["Setting", "Value"], rows, caption, left=2)
    return Part("configuration", "Configuration", [Folded(f"{len(rows)} settings", [table], printed=False)])


def _flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    flat: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= _flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = json.dumps(value, ensure_ascii=False).strip('"')
    return flat
