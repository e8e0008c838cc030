"""The kernel's functions on arrays, with the DVL and the methods as users name them.

A DVL is given as its beams, as what `read_geometry` returns, or by packaged name or file; a method by name or as a
class of one's own.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

from numpy.typing import ArrayLike

from bottomlock import kernel, own_method
from bottomlock.kernel import DEFAULT_OPTIONS, BeamGeometry, FixMethod, VelocityFixes
from bottomlock.kernel.models import InitialState, Model, Options
from bottomlock.own_method import AnyMethod

if TYPE_CHECKING:
    from bottomlock.io.beams import Instrument
    from bottomlock.kernel import BatchDict, LogDict, ReplayDict, ScheduleDict, StateDict, TruthDict

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
        raise kernel.KernelError(f"methods is {methods!r:.60}, expected a list of methods")
    return [own_method.name_of(method) for method in methods]


_F = TypeVar("_F", bound=Callable[..., Any])


def _documented_by(original: Callable[..., Any]) -> Callable[[_F], _F]:
    """Gives a function the docstring of the kernel's, which says all but how DVL and methods may be named."""

    def document(function: _F) -> _F:
        function.__doc__ = original.__doc__
        return function

    return document


def solve_velocity(
    geometry: AnyGeometry,
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
        >>> float(fixes.velocity_p_mps[0, 0].round(6)), kernel.COMPONENT_STATUS[fixes.component[0, 1]]
        (2.0, 'outside_row_space')
        >>> same = solve_velocity("x_janus_20", beams, [[True, True, False, False]], method="plcf", beam_sd_mps=0.042)
        >>> bool((same.velocity_p_mps[0, 0] == fixes.velocity_p_mps[0, 0]).all())
        True
    """
    return kernel.solve_velocity(
        beam_geometry(geometry),
        velocity_mps,
        valid,
        method=method,
        beam_sd_mps=beam_sd_mps,
        prior_velocity_p_mps=prior_velocity_p_mps,
        prior_cov_m2ps2=prior_cov_m2ps2,
        omega_tp_p_radps=omega_tp_p_radps,
        virtual_beam_factor=virtual_beam_factor,
        nullified_sway_var_m2ps2=nullified_sway_var_m2ps2,
        weak_sway_var_m2ps2=weak_sway_var_m2ps2,
    )


@_documented_by(kernel.simulate_sensors)
def simulate_sensors(
    geometry: AnyGeometry,
    truth: "TruthDict",
    model: Model,
    schedule: "ScheduleDict",
    *,
    seed: int,
    trajectory_key: int,
    run: int,
    imu_sampling: Literal["instantaneous", "averaged"] = "instantaneous",
    options: Options | None = None,
) -> dict[str, Any]:
    """`kernel.simulate_sensors`."""
    return kernel.simulate_sensors(
        beam_geometry(geometry),
        truth,
        model,
        schedule,
        seed=seed,
        trajectory_key=trajectory_key,
        run=run,
        imu_sampling=imu_sampling,
        options=options,
    )


@_documented_by(kernel.run_batch)
def run_batch(
    geometry: AnyGeometry,
    truth: "TruthDict",
    simulated: Model,
    assumed: Model,
    options: Options,
    schedule: "ScheduleDict",
    methods: Sequence[AnyMethod],
    *,
    seed: int,
    trajectory_key: int,
    first_run: int,
    runs: int,
    threads: int,
    stop: Event | None = None,
) -> "BatchDict":
    """`kernel.run_batch`."""
    return kernel.run_batch(
        beam_geometry(geometry),
        truth,
        simulated,
        assumed,
        options,
        schedule,
        method_names(methods),
        seed=seed,
        trajectory_key=trajectory_key,
        first_run=first_run,
        runs=runs,
        threads=threads,
        stop=stop,
    )


@_documented_by(kernel.replay_log)
def replay_log(
    geometry: AnyGeometry,
    model: Model,
    options: Options,
    methods: Sequence[AnyMethod],
    log: "LogDict",
    start: "InitialState | StateDict",
    *,
    sample_time_ns: ArrayLike,
    covariance: ArrayLike | None = None,
    smooth: bool = False,
    covariances: bool = False,
    innovations: bool = False,
    threads: int = 1,
) -> "ReplayDict":
    """`kernel.replay_log`."""
    return kernel.replay_log(
        beam_geometry(geometry),
        model,
        options,
        method_names(methods),
        log,
        start,
        sample_time_ns=sample_time_ns,
        covariance=covariance,
        smooth=smooth,
        covariances=covariances,
        innovations=innovations,
        threads=threads,
    )
