"""The command `bottomlock grades`: the packaged grades of instruments with their errors and sources."""

from bottomlock.cli.console import console
from bottomlock.config.instrument_grades import KINDS, listing


def grades() -> None:
    """List the packaged grades of IMUs and attitude references and the motion of vehicles, with their sources.

    `[imu.errors] grade = "mti"` of a case, or `grade` in `[imu]` of a scenario, gives every key that is not written
    beside it; so does `[filter.water] vehicle = "hovering"`.
    """
    for kind, title in KINDS.items():
        console.print(f"Grades of {title}:\n", highlight=False)
        for line in listing(kind):
            console.print(line, highlight=False, markup=False)
