"""How fine the numbers of each encoder's records are, as docs/simulate_dvl.md states it."""

from typing import Literal, NamedTuple


class Steps(NamedTuple):
    """Which of a ping's times a record states, and the steps of its numbers; 0 for a float of a relative error."""

    time_of: Literal["validity", "trigger"]
    time_step_ns: int
    velocity_step_mps: float = 0.0
    range_step_m: float = 0.0
    relative: float = 0.0


_SINGLE = 2.0**-23
STEPS = {
    "waterlinked-json": Steps("validity", 1000),
    "waterlinked-serial": Steps("validity", 1000, 1e-3, 0.01),
    "pd0": Steps("trigger", 10_000_000, 1e-3, 0.01),
    "nortek-dvl": Steps("trigger", 100_000, relative=_SINGLE),
    "nucleus": Steps("trigger", 1000, relative=_SINGLE),
    "cerulean-dvkfc": Steps("trigger", 1000, 1e-6, 1e-6),
}
