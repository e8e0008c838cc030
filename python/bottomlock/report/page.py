"""A finished campaign as one page, with its figures and the verdicts on the paper's claims."""

from dataclasses import dataclass
from pathlib import Path

import polars as pl

from bottomlock.files.atomic_write import parquet_bytes
from bottomlock.files.campaign_tables import read_campaign_tables
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.pages.page import html
from bottomlock.report.advice import advise, choose
from bottomlock.report.drawings import Content
from bottomlock.report.layout import page_of
from bottomlock.statistics.claim_verdicts import claims_table, flown
from bottomlock.statistics.claims import load_paper
from bottomlock.statistics.run_errors import read_run_errors


@dataclass(frozen=True)
class Report:
    """The written page, the count of its figures, and the table of claims."""

    page: Path
    figures: int
    claims: pl.DataFrame


def make_report(folder: str | Path, *, force: bool = False) -> Report:
    """Writes `report.html` and `figures/` from the tables of a finished campaign; each figure has its files.

    Where the paper's scenarios were flown with its settings, its claims on them are tested, and `tables/claims.parquet`
    holds the verdicts. The same tables give the same bytes.

    Args:
        folder: directory of the campaign.
        force: replace a report that has changed since it was written.

    Raises:
        DataError: for a directory that holds no finished campaign of this version, or a damaged one.
        OutputError: for a file of these names that is not of ours, one that has changed since it was written without
            `force`, and where the directory cannot be written.
    """
    folder = Path(folder)
    campaign = read_campaign_tables(folder)
    records = (
        folder / "manifest.json",
        folder / "sweep.record.json",
        *sorted(folder.glob("without_*/manifest.json")),
    )
    result = Result(folder, "report", "report", digests_of(folder, records), beside=True)
    result.check(force=force)
    errors = {name: read_run_errors(campaign, name) for name in campaign.trajectories}
    paper = load_paper()
    theirs = flown(campaign, paper)
    claims = claims_table(campaign, errors, paper).filter(pl.col("trajectory").is_in(theirs))
    advice = advise(campaign, errors)
    content = Content(campaign, errors, paper, theirs, claims, advice, choose(advice))
    page = folder / "report.html"
    text = html(page_of(content))
    tables: Files = {"tables/claims.parquet": parquet_bytes(claims)} if theirs else {}
    result.write(tables | content.pictures.files | {page.name: text}, force=force)
    return Report(page, len(content.pictures.files) // 2, claims)
