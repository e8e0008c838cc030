"""Cells of a recorded or live water track: which are used, and their noise."""

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from bottomlock.config.scenario_sections import Positive, Section
from bottomlock.kernel import models

Cell = Annotated[int, Field(ge=1, le=255)]


class WaterCells(Section):
    """Velocity through the water by beams that the water returned, with the current as states of the filter.

    Of each beam the mean over the chosen cells is used. What leaves a cell out is in docs/howto/water_track.md. A noise
    that the instrument records with each cell comes before `noise_mps`.
    """

    cells: Annotated[tuple[Cell, ...], Field(min_length=1)] = (1, 2)
    min_correlation: Annotated[float, Field(ge=0, le=255)] = 0.0
    max_closure_mps: Positive | None = None
    noise_mps: Positive | None = None

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
