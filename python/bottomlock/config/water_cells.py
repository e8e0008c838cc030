"""Cells of a recorded or live water track: which are used, and their noise."""

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from bottomlock.config.section import Section, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import Positive

Cell = Annotated[int, Field(ge=1, le=255)]


class WaterCells(Section):
    """Velocity through the water by beams that the water returned, with the current as states of the filter.

    Of each beam the mean over the chosen cells is used. What leaves a cell out is in docs/howto/water_track.md. A noise
    that the instrument records with each cell comes before `noise_mps`.
    """

    cells: Annotated[tuple[Cell, ...], Field(min_length=1), shown(unit="1")] = (1, 2)
    """numbers of the cells whose mean is used, 1 the nearest; leave out those in the vehicle's own wake"""
    min_correlation: Annotated[float, Field(ge=0, le=255), shown(unit="1", example=64.0)] = 0.0
    """least correlation of a beam in a cell, 0 to 255"""
    max_closure_mps: Annotated[Positive | None, shown(example=0.05)] = None
    """largest closure of the beams of a cell, beyond which none of them is used; none: three times what their noise
    leads to"""
    noise_mps: Annotated[Positive | None, shown(example=0.04)] = None
    """noise of a beam, 1 sigma, where the instrument records none; none: that of the bottom's beams"""

    @model_validator(mode="after")
    def _cells_once(self) -> Self:
        for cell in self.cells:
            if self.cells.count(cell) > 1:
                raise ValueError(f"cell {cell} is named twice in 'cells', expected each cell once")
        return self

    def kernel_models(self) -> dict[str, models.Settings]:
        """Nothing: the noise is that of the cells."""
        return {}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"water_track": True}
