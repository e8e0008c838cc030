"""The only importer of the compiled kernel: arrays in, arrays out.

Examples:
    A vehicle at rest, aided by two beams at 1 Hz:

    >>> import numpy as np
    >>> from bottomlock.config.scenario import load_scenario
    >>> from bottomlock.kernel.models import InitialState
    >>> scenario, gravity = load_scenario("straight"), normal_gravity_mps2(0.57)
    >>> initial = InitialState(
    ...     time_ns=0, position_t_m=[0, 0, 0], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[0, 0, 0]
    ... )
    >>> janus = BeamGeometry.janus(np.deg2rad(20.0))
    >>> navigator = Navigator(janus, scenario.kernel_model(gravity), scenario.kernel_options(), initial, method="tc")
    >>> for k in range(151):
    ...     _ = navigator.push_imu(
    ...         k * 6_666_667, omega_p_radps=[0.0, 0.0, 0.0], force_p_mps2=[0.0, 0.0, -gravity]
    ...     )
    >>> reports = navigator.push_beams(
    ...     150 * 6_666_667, np.zeros(4), np.array([True, True, False, False]), sd_mps=np.full(4, 0.042)
    ... )
    >>> reports[0].verdict, bool(np.linalg.norm(navigator.state()["velocity_p_mps"]) < 0.01)
    ('accepted', True)
"""

# ruff: noqa: I001 - what is handed on from the compiled kernel is one list
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NewType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock import _kernel
from bottomlock._kernel import (
    DEFAULT_OPTIONS as DEFAULT_OPTIONS,
    EARTH_RATE_RADPS as EARTH_RATE_RADPS,
    FIX_STATUS as FIX_STATUS,
    INERTIAL_STATES as INERTIAL_STATES,
    METHODS as METHODS,
    RECOMMENDED_METHOD as RECOMMENDED_METHOD,
    SENSORS as SENSORS,
    STATES as STATES,
    BeamGeometry as BeamGeometry,
    ClosedLoop as ClosedLoop,
    Navigator as Navigator,
    Report as Report,
    check_settings as check_settings,
    covariance_history as covariance_history,
    error_model as error_model,
    integrate_segments as integrate_segments,
    local_earth as local_earth,
    normal_gravity_mps2 as normal_gravity_mps2,
    observe as observe,
    register_method as register_method,
    rejected_imu as rejected_imu,
    replay_log as replay_log,
    run_batch as run_batch,
    simulate_sensors as simulate_sensors,
)
from bottomlock.errors import KernelError as KernelError
from bottomlock.kernel.words import geometry_line, geometry_table, navigator_line, navigator_table
from bottomlock.text import did_you_mean

if TYPE_CHECKING:
    import polars as pl

    from bottomlock._kernel import (
        BatchDict as BatchDict,
        LogDict as LogDict,
        ReplayDict as ReplayDict,
        ScheduleDict as ScheduleDict,
        StateDict as StateDict,
        TruthDict as TruthDict,
    )
    from bottomlock.arguments import AnyGeometry

Method = Literal["ins", "lc", "tc", "vb", "nsv", "plcf", "vhv", "elc", "info", "weak_sway", "sway_current"]
"""Name of an aiding method, one of `METHODS`."""

OwnName = NewType("OwnName", str)
"""Name of a method of one's own, which `own_method.register` returns."""

FixMethod = Literal[
    "lc", "vb", "nsv", "plcf", "vhv", "elc", "info", "weak_sway",
    "least_squares", "virtual_beam", "nullified_sway", "partial_loose", "virtual_heave", "selector", "information",
]  # fmt: skip
"""Name of a method that solves single pings, short or long: `FIX_METHODS`."""

JanusConfiguration = Literal["x", "+"]
Configuration = Literal["x", "+", "angles", "directions"]
"""How the beams of an instrument are described."""

FIX_METHODS: dict[FixMethod, FixMethod] = {
    "lc": "least_squares", "vb": "virtual_beam", "nsv": "nullified_sway", "plcf": "partial_loose",
    "vhv": "virtual_heave", "elc": "selector", "info": "information", "weak_sway": "weak_sway",
}  # fmt: skip
"""Short method names and the kernel's."""

STATUS = ("fix", "partial", "unobservable", "too_few_beams", "prior_required")
"""Outcome of a ping, by the kernel's code."""

COMPONENT_STATUS: tuple[str, ...] = (
    "solved", "no_beams", "outside_row_space", "constraint_singular", "prior_required", "prior_only",
)  # fmt: skip
"""Status of a component, by the kernel's code."""

SOURCES = ("none", "lc", "vb", "nsv", "plcf", "vhv", "info", "weak_sway")
"""Which method a component comes from, by the kernel's code."""

NO_CHOICE = 255
"""The kernel's code where a method does not choose."""


def kernel_version() -> str:
    """Version of the compiled kernel."""
    return _kernel.__version__


@dataclass(frozen=True, eq=False)
class VelocityFixes:
    """Velocities solved from pings, one row per ping.

    Attributes:
        velocity_p_mps: (n, 3) surge, sway, heave in the platform frame; NaN where a component is not solved.
        cov_m2ps2: (n, 3, 3) covariance of the solved components; NaN elsewhere.
        observed_velocity_p_mps: (n, 3) minimum-norm velocity along what the rows see.
        information_s2pm2: (n, 3, 3) information matrix of the rows, of rank `rank`.
        component: (n, 3) codes of `COMPONENT_STATUS`.
        status: (n,) codes of `STATUS`.
        beams_used: (n, beams).
        rank: (n,) number of observed axes.
        source: (n, 3) codes of `SOURCES`.
    """

    velocity_p_mps: NDArray[np.float64]
    cov_m2ps2: NDArray[np.float64]
    observed_velocity_p_mps: NDArray[np.float64]
    information_s2pm2: NDArray[np.float64]
    component: NDArray[np.uint8]
    status: NDArray[np.uint8]
    beams_used: NDArray[np.bool_]
    rank: NDArray[np.uint8]
    source: NDArray[np.uint8]

    def to_frame(self, time_ns: NDArray[np.int64] | None = None) -> "pl.DataFrame":
        """A row per ping: time, status, rank, and of each axis velocity, status and source; unsolved values are null.

        `*_status` and `*_source` are names of `COMPONENT_STATUS` and `SOURCES`, `cov_*` covariances of the velocities,
        `beam*_used` whether a beam was used.
        """
        import polars as pl  # noqa: PLC0415 - `import bottomlock` stays light

        axes = ("surge", "sway", "heave")
        columns: dict[str, Any] = {
            "time_ns": np.arange(len(self.status), dtype=np.int64) if time_ns is None else time_ns,
            "status": np.array(STATUS)[self.status],
            "rank": self.rank,
        }
        for ending, values in (
            ("mps", self.velocity_p_mps),
            ("status", np.array(COMPONENT_STATUS)[self.component]),
            ("source", np.array(SOURCES)[self.source]),
        ):
            columns |= {f"{axis}_{ending}": values[:, k] for k, axis in enumerate(axes)}
        for k, other in zip(*np.triu_indices(3), strict=True):
            columns[f"cov_{axes[k]}_{axes[other]}_m2ps2"] = self.cov_m2ps2[:, k, other]
        columns |= {f"beam{k + 1}_used": used for k, used in enumerate(self.beams_used.T)}
        return pl.DataFrame(columns).with_columns(pl.selectors.float().fill_nan(None))


def fix_method(name: str) -> FixMethod:
    """The long name of a method of single pings, which is the kernel's, from its short or long name.

    Raises:
        KernelError: for a name that is neither.

    Examples:
        >>> fix_method("nsv")
        'nullified_sway'
    """
    for short, long in FIX_METHODS.items():
        if name in (short, long):
            return long
    if name in METHODS:
        raise KernelError(
            f"method '{name}' needs a filter that runs from ping to ping (bottomlock replay, Navigator)",
            hint=f"of single pings there are {', '.join(FIX_METHODS)}",
        )
    hint = did_you_mean(name, [*FIX_METHODS, *FIX_METHODS.values()])
    raise KernelError(f"unknown method '{name}'{hint} (known: {', '.join(FIX_METHODS)})")


def solve_velocity(
    geometry: "AnyGeometry",
    velocity_mps: ArrayLike,
    valid: ArrayLike,
    *,
    method: FixMethod,
    beam_sd_mps: ArrayLike,
    prior_velocity_p_mps: ArrayLike | None = None,
    prior_cov_m2ps2: ArrayLike | None = None,
    omega_tp_p_radps: ArrayLike | None = None,
    virtual_beam_factor: float = DEFAULT_OPTIONS["assumptions"]["virtual_beam_factor"],
    nullified_sway_var_m2ps2: float = DEFAULT_OPTIONS["assumptions"]["nullified_sway_var_m2ps2"],
    weak_sway_var_m2ps2: float = DEFAULT_OPTIONS["assumptions"]["weak_sway_var_m2ps2"],
) -> VelocityFixes:
    """Solves pings for the platform velocity from any set of valid beams (Tal et al. 2017, Eqs 17-49).

    Args:
        geometry: the beams, or the name or file of a DVL.
        velocity_mps: (n, beams) beam velocities; entries of invalid beams are ignored and may be NaN.
        valid: (n, beams) bool.
        method: a key of `FIX_METHODS`, or the long name that it stands for.
        beam_sd_mps: (beams,) noise of the beams, 1 sigma, or one number for all.
        prior_velocity_p_mps: (n, 3) velocity that the INS expects, for vb, vhv and elc.
        prior_cov_m2ps2: (n, 3, 3) its covariance.
        omega_tp_p_radps: (n, 3) angular rate against the tangent frame, for lever arms.
        virtual_beam_factor: n_f of Eq. 28.
        nullified_sway_var_m2ps2: epsilon of Eq. 36.
        weak_sway_var_m2ps2: variance of the weak sway row.

    Returns:
        One row per ping. Lost beams and unobservable components are values, not errors.

    Raises:
        TypeError: for a geometry that is none.
        ScenarioError: for a name or a file that `read_geometry` rejects.
        KernelError: for a wrong shape or type, an unknown method, or a valid beam without a finite velocity; the
            message names row and beam.

    Examples:
        >>> import numpy as np
        >>> janus = BeamGeometry.janus(np.deg2rad(20.0))
        >>> beams = janus.beam_velocities([[2.0, 0.1, 0.0]])
        >>> fixes = solve_velocity(janus, beams, [[True, True, False, False]], method="plcf", beam_sd_mps=0.042)
        >>> float(fixes.velocity_p_mps[0, 0].round(6)), COMPONENT_STATUS[fixes.component[0, 1]]
        (2.0, 'outside_row_space')
        >>> same = solve_velocity("x_janus_20", beams, [[True, True, False, False]], method="plcf", beam_sd_mps=0.042)
        >>> bool((same.velocity_p_mps[0, 0] == fixes.velocity_p_mps[0, 0]).all())
        True
    """
    solution = _kernel.solve_velocity(
        geometry,
        velocity_mps,
        valid,
        method=fix_method(method),
        beam_sd_mps=beam_sd_mps,
        prior_velocity_p_mps=prior_velocity_p_mps,
        prior_cov_m2ps2=prior_cov_m2ps2,
        omega_tp_p_radps=omega_tp_p_radps,
        virtual_beam_factor=virtual_beam_factor,
        nullified_sway_var_m2ps2=nullified_sway_var_m2ps2,
        weak_sway_var_m2ps2=weak_sway_var_m2ps2,
    )
    return VelocityFixes(**solution)


# What a terminal and a notebook show of the compiled classes: words are no part of the kernel.
for _name, _navigator, _geometry in (
    ("__repr__", navigator_line, geometry_line), ("_repr_html_", navigator_table, geometry_table),
):  # fmt: skip
    setattr(Navigator, _name, _navigator)
    setattr(BeamGeometry, _name, _geometry)
