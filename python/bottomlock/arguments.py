"""A DVL and aiding methods as users name them, where a function of the kernel takes them.

A DVL is given as its beams, as what `read_geometry` returns, or by packaged name or file; a method by name or as a
class of one's own.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from bottomlock import own_method
from bottomlock.kernel import BeamGeometry, KernelError
from bottomlock.own_method import AnyMethod

if TYPE_CHECKING:
    from bottomlock.io.beams import Instrument

AnyGeometry: TypeAlias = "BeamGeometry | Instrument | str | Path"
"""A DVL as users name it."""


def beam_geometry(given: AnyGeometry) -> BeamGeometry:
    """The beams of a DVL: of themselves, of what `read_geometry` returns, or by packaged name or TOML file.

    Raises:
        TypeError: for anything else.
        ScenarioError: as `read_geometry`.
    """
    if isinstance(given, BeamGeometry):
        return given
    # A vehicle's computer that has its beams as numbers needs numpy alone.
    from bottomlock.io.beams import Instrument, read_geometry  # noqa: PLC0415

    if isinstance(given, Instrument):
        return given.geometry
    if isinstance(given, str | Path):
        return read_geometry(given).geometry
    raise TypeError(
        f"geometry is of type {type(given).__name__}, expected a BeamGeometry, or the name or file of a DVL"
    )


def method_names(methods: Sequence[AnyMethod]) -> list[str]:
    """The kernel's names of methods.

    Raises:
        KernelError: as `own_method.name_of`; for one method in place of a list.
    """
    if isinstance(methods, str | type | set | frozenset):
        raise KernelError(f"methods is {methods!r:.60}, expected a list of methods")
    return [own_method.name_of(method) for method in methods]
