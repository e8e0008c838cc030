"""What a port is given: one estimate of the velocity, with what is known of it and what is not.

There are two sources. In mode "velocity" the beams of one ping alone give it, and a component that they do not
determine is absent: NaN, never a large variance. In mode "navigation" a `Navigator` gives it, and every component is
there, because the inertial solution carries the ones that the beams do not determine.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.errors import DataError
from bottomlock.kernel import COMPONENT_STATUS, SOURCES, Navigator, VelocityFixes
from bottomlock.recordings.readings import Ping

Mode = Literal["velocity", "navigation"]
"""Whether an estimate is made of one ping alone or by a navigator."""

State = Literal["INITIALISING", "OK", "PARTIAL", "WATER", "COASTING", "UNSAFE"]
"""State of the process that makes the estimates; in INITIALISING and UNSAFE every port is silent."""

SILENT: tuple[State, ...] = ("INITIALISING", "UNSAFE")
"""States in which nothing is sent."""

VelocityMethod = Literal["info", "plcf", "lc"]
"""Methods that hold no assumption: what the beams do not see is absent."""

_WORDS = {"mode": get_args(Mode), "state": get_args(State)}
_MEASURED = {"none", *get_args(VelocityMethod)}
_SOLVED = COMPONENT_STATUS.index("solved")
# Relative to the largest eigenvalue: what rounding leaves of a covariance that is singular.
_ROUNDING = 1e-9

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """One estimate of the velocity over ground at the platform's origin, checked and read-only.

    Attributes:
        time_ns: time of validity, on the host's clock since 1970.
        mode: "velocity" or "navigation".
        velocity_p_mps: (3,) platform axes; NaN where the beams do not determine a component (mode velocity only).
        covariance_m2ps2: (3, 3) of the components that are there; NaN elsewhere.
        rank: number of axes that the beams of the last ping determine, 0 to 3.
        observed_velocity_p_mps: (3,) minimum-norm velocity along the axes that the beams determine.
        information_s2pm2: (3, 3) information of these beams, of rank `rank`.
        state: see `State`.
        reset_counter: 0 to 255; one more at every discontinuity that no measurement explains (start, restart).
        attitude_t_p: (4,) unit quaternion, scalar first, platform to tangent; None in mode velocity, if not known.
        position_t_m: (3,) tangent frame; None in mode velocity.
        navigation_covariance: (9, 9) of the errors of position (t), misalignment (t) and velocity (p); None in mode
            velocity.
        omega_p_radps: (3,) angular rate of the platform against the tangent frame; None if not known.
        beams: the last ping, on the estimate's clock, NaN where a beam or its range is lost; None if there is none.
    """

    time_ns: int
    mode: Mode
    velocity_p_mps: Floats
    covariance_m2ps2: Floats
    rank: int
    observed_velocity_p_mps: Floats = field(default_factory=lambda: np.zeros(3))
    information_s2pm2: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    state: State = "OK"
    reset_counter: int = 0
    attitude_t_p: Floats | None = None
    position_t_m: Floats | None = None
    navigation_covariance: Floats | None = None
    omega_p_radps: Floats | None = None
    beams: Ping | None = None

    def __post_init__(self) -> None:
        """Checks every field and freezes the arrays.

        Raises:
            DataError: naming the field, its value and what was expected.
        """
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _array(name, value, shape))
        for name, known in _WORDS.items():
            value = getattr(self, name)
            _require(value in known, f"{name} is '{value}'", expected=f"one of {', '.join(known)}")
        for name, least, most in (("time_ns", 0, 2**63 - 1), ("rank", 0, 3), ("reset_counter", 0, 255)):
            value = getattr(self, name)
            is_whole = isinstance(value, int) and not isinstance(value, bool)
            expected = f"an integer from {least} to {most}"
            _require(is_whole and least <= value <= most, f"{name} is {value!r}", expected=expected)
        self._check_numbers()

    def _check_numbers(self) -> None:
        """Checks that components are there as the mode says, and that covariances are covariances."""
        there, whole = self.components, self.complete
        finite = np.isfinite(self.covariance_m2ps2)
        _require(
            bool(finite.all()) if whole else np.array_equal(finite, np.outer(there, there)),
            "covariance_m2ps2 must be finite exactly for the components of velocity_p_mps that are",
        )
        known = self.covariance_m2ps2 if whole else self.covariance_m2ps2[np.ix_(there, there)]
        _check_covariance("covariance_m2ps2", known)
        _check_covariance("information_s2pm2", self.information_s2pm2)
        for name in ("observed_velocity_p_mps", "position_t_m", "omega_p_radps", "attitude_t_p"):
            value = getattr(self, name)
            if value is not None:
                numbers = value.tolist()
                _require(all(map(math.isfinite, numbers)), f"{name} is {numbers}", expected="finite numbers")
        if self.attitude_t_p is not None:
            q = self.attitude_t_p.tolist()
            is_unit = abs(math.hypot(*q) - 1.0) <= 1e-6
            _require(is_unit, f"is {q}", key="attitude_t_p", expected="a unit quaternion")
        if self.mode == "navigation":
            for name in ("attitude_t_p", "position_t_m", "navigation_covariance"):
                _require(getattr(self, name) is not None, f"{name} is missing in mode navigation")
            velocity = self.velocity_p_mps.tolist()
            expected = "three finite components in mode navigation"
            _require(whole, f"is {velocity}", key="velocity_p_mps", expected=expected)
        if self.navigation_covariance is not None:
            _check_covariance("navigation_covariance", self.navigation_covariance)

    @property
    def components(self) -> NDArray[np.bool_]:
        """(3,) which components of the velocity are there."""
        return np.isfinite(self.velocity_p_mps)

    @property
    def complete(self) -> bool:
        """Whether all three components are there."""
        return bool(self.components.all())

    def observable_axes(self) -> tuple[Floats, Floats, Floats]:
        """Principal axes that the beams determine, the best known first.

        Returns:
            Axes (rank, 3), unit vectors in the platform frame; velocity along each (rank,), m/s; variance (rank,).
        """
        eigenvalues, vectors = np.linalg.eigh(self.information_s2pm2)
        axes = vectors.T[::-1][: self.rank]
        return axes, axes @ self.observed_velocity_p_mps, 1.0 / eigenvalues[::-1][: self.rank]

    @classmethod
    def from_fix(
        cls,
        time_ns: int,
        fixes: VelocityFixes,
        row: int = 0,
        *,
        state: State = "OK",
        reset_counter: int = 0,
        beams: Ping | None = None,
    ) -> Self:
        """Mode velocity: a row of what `solve_velocity` gives with the methods "info", "plcf" or "lc".

        Raises:
            DataError: for a solution that holds assumptions or a prior (vb, nsv, vhv, weak_sway, elc): its unseen
                components are no measurement.
        """
        sources = {SOURCES[code] for code in fixes.source[row]}
        if not sources <= _MEASURED:
            assumed = ", ".join(sorted(sources - _MEASURED))
            raise DataError(
                f"the fix is of method '{assumed}', which adds an assumption or a prior",
                place="estimate",
                expected="measurements alone: solve with method 'info'",
            )
        solved = fixes.component[row] == _SOLVED
        seen = np.where(solved, 1.0, np.nan)
        return cls(
            time_ns=int(time_ns),
            mode="velocity",
            velocity_p_mps=fixes.velocity_p_mps[row] * seen,
            covariance_m2ps2=_symmetric(fixes.cov_m2ps2[row]) * np.outer(seen, seen),
            rank=int(fixes.rank[row]),
            observed_velocity_p_mps=fixes.observed_velocity_p_mps[row],
            information_s2pm2=_symmetric(fixes.information_s2pm2[row]),
            state=state,
            reset_counter=reset_counter,
            beams=beams,
        )

    @classmethod
    def from_navigator(
        cls,
        navigator: Navigator,
        *,
        state: State = "OK",
        reset_counter: int = 0,
        fixes: VelocityFixes | None = None,
        omega_p_radps: ArrayLike | None = None,
        beams: Ping | None = None,
    ) -> Self:
        """Mode navigation: state and covariance of a navigator as they are now.

        Args:
            navigator: whose estimate it is.
            state: see `State`.
            reset_counter: as the attribute.
            fixes: one row, what `solve_velocity` gives for the last ping: rank and information of its beams; rank 0
                without.
            omega_p_radps: (3,) as the attribute.
            beams: the last ping.
        """
        navigation = navigator.state()
        joint = _symmetric(navigator.covariance()[:9, :9])
        seen: dict[str, Any] = {"rank": 0}
        if fixes is not None:
            seen = {
                "rank": int(fixes.rank[0]),
                "observed_velocity_p_mps": fixes.observed_velocity_p_mps[0],
                "information_s2pm2": _symmetric(fixes.information_s2pm2[0]),
            }
        return cls(
            time_ns=int(navigation["time_ns"]),
            mode="navigation",
            velocity_p_mps=navigation["velocity_p_mps"],
            covariance_m2ps2=joint[6:, 6:],
            state=state,
            reset_counter=reset_counter,
            attitude_t_p=navigation["attitude_t_p"],
            position_t_m=navigation["position_t_m"],
            navigation_covariance=joint,
            omega_p_radps=None if omega_p_radps is None else np.asarray(omega_p_radps, dtype=np.float64),
            beams=beams,
            **seen,
        )


_SHAPES: dict[str, tuple[int, ...]] = {
    "velocity_p_mps": (3,),
    "covariance_m2ps2": (3, 3),
    "observed_velocity_p_mps": (3,),
    "information_s2pm2": (3, 3),
    "attitude_t_p": (4,),
    "position_t_m": (3,),
    "navigation_covariance": (9, 9),
    "omega_p_radps": (3,),
}


def _array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """A read-only copy as float64."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"{name} holds something else than numbers", place="estimate") from error
    _require(array.shape == shape, f"{name} has shape {array.shape}", expected=shape)
    array.flags.writeable = False
    return array


def _require(holds: bool, what: str, **more: Any) -> None:  # noqa: ANN401, FBT001 - of `DataError`
    if not holds:
        raise DataError(what, place="estimate", **more)


def _symmetric(matrix: Floats) -> Floats:
    return 0.5 * (matrix + matrix.T)


def _check_covariance(name: str, matrix: Floats) -> None:
    """Checks that a matrix is finite, symmetric and without a negative eigenvalue beyond rounding."""
    if matrix.size == 0:
        return
    is_symmetric = np.isfinite(matrix).all() and (np.abs(matrix - matrix.T) <= 1e-12 * np.abs(matrix)).all()
    _require(bool(is_symmetric), f"{name} must be finite and symmetric")
    # In units of each state's own σ: position and misalignment differ by orders of magnitude.
    variance = matrix.diagonal()
    scale = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    least = float(np.linalg.eigvalsh(matrix / scale / scale[:, None])[0])
    is_positive = bool((variance >= 0.0).all()) and least >= -_ROUNDING * len(scale)
    _require(is_positive, f"{name} has a negative eigenvalue", expected="a covariance")
