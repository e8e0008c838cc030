"""The part of `bottomlock run` that exports the tracks of a run."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

from cyclopts import Parameter

from bottomlock.cli.console import console
from bottomlock.cli.parameters import check_beside, check_threads, split
from bottomlock.config.scenario import Scenario, packaged_scenarios
from bottomlock.errors import ScenarioError
from bottomlock.export.campaign import export_campaign, places_of
from bottomlock.export.formats import FORMATS, check_formats

ExportRun = Annotated[
    str | None,
    Parameter(
        help="Formats of the tracks of one run, truth and estimates, written to the folder `export` in DIR, separated "
        f"by commas: {', '.join(FORMATS)}. With the folder of a campaign as SCENARIO nothing else is done."
    ),
]
RunNumber = Annotated[
    int | None, Parameter(name="--run", help="With --export: number of that run, from 0; 0 by default.")
]


@dataclass(frozen=True)
class RunExport:
    """What is exported of a campaign: the formats, None for nothing, and the number of the run."""

    formats: Sequence[str] | None
    run: int

    @classmethod
    def parse(cls, export: str | None, run: int | None) -> Self:
        """From the two options.

        Raises:
            ScenarioError: for a run without formats, and a number below 0.
        """
        if run is not None and export is None:
            raise ScenarioError(
                f"--run is {run} without --export, expected the formats of the run's tracks, too"
            )
        if run is not None and run < 0:
            raise ScenarioError(f"--run is {run}, expected a run number, 0 or more")
        return cls(split(export), run or 0)

    def check(self, scenarios: Sequence[Scenario], *, parted_by: str) -> None:
        """Checks, before anything runs, the formats, and that every scenario has a run of this number.

        Args:
            scenarios: of the campaign.
            parted_by: the option that leaves no whole campaign in one folder; "" for none.

        Raises:
            ScenarioError, DataError: as `check_formats`, and for a number that is too large.
        """
        if self.formats is None:
            return
        if parted_by:
            raise ScenarioError(
                f"--export and {parted_by} are both given; export from the finished folder: "
                "bottomlock run DIR --export FORMATS"
            )
        check_formats(self.formats)
        for one in scenarios:
            if self.run >= one.campaign.runs:
                raise ScenarioError(
                    f"--run is {self.run}, and {one.name} has {one.campaign.runs} runs, expected 0 to "
                    f"{one.campaign.runs - 1}"
                )

    def write(
        self, folder: Path, methods: Sequence[str] | None, *, threads: int, force: bool, quiet: bool = False
    ) -> None:
        """Exports the run of a campaign, names the files, and says where and when its tracks are."""
        if self.formats is None:
            return
        written = export_campaign(
            folder, self.formats, run=self.run, methods=methods, threads=threads, force=force
        )
        for line in [] if quiet else [*(f"wrote {path}" for path in written), *places_of(folder)]:
            console.print(line, highlight=False, soft_wrap=True)


def finished_folder(scenario: Sequence[str]) -> Path | None:
    """The folder that is named in place of scenarios; a packaged scenario of that name goes before it.

    Raises:
        ScenarioError: for a folder among other scenarios.
    """
    folders = [Path(name) for name in scenario if name not in packaged_scenarios() and Path(name).is_dir()]
    if folders and len(scenario) > 1:
        raise ScenarioError(
            f"{folders[0]}: is a folder, expected a scenario, or one folder alone with --export"
        )
    return folders[0] if folders else None


def export_finished(
    folder: Path, export: RunExport, *, out: Path | None, methods: str | None, threads: int, force: bool
) -> None:
    """Exports from a campaign that is there.

    Raises:
        ScenarioError: without formats, and for an --out beside it.
    """
    if export.formats is None:
        raise ScenarioError(
            f"{folder}: is a folder, expected a scenario; of a campaign's folder --export takes the tracks along"
        )
    check_beside(out, folder)
    check_threads(threads)
    export.write(folder, split(methods), threads=threads, force=force)
