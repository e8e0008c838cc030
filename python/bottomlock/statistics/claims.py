"""The paper's claims as `statistics/claims.toml` states them: numbers, orderings, drifts, and how we read them."""

import tomllib
from importlib import resources
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bottomlock.errors import DataError
from bottomlock.files.columns import BIASES

Number = float | list[float] | bool | str


class _Claim(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    place: str
    trajectory: str
    quantity: Literal["velocity", "attitude", "bias"]
    says: str
    reading: str
    _ruled_by: ClassVar[str] = "kind"
    """The field whose value names the rule."""

    @property
    def rule(self) -> str:
        """Name of the rule of the verdict."""
        return str(getattr(self, self._ruled_by))


class _OneMethodClaim(_Claim):
    method: str

    @property
    def methods(self) -> list[str]:
        """The methods that the claim is about."""
        return [self.method]


class ValueClaim(_OneMethodClaim):
    """RMS over runs of one method at one time."""

    kind: Literal["value"]
    printed: float
    half_digit: float
    time_s: float


class ImprovementClaim(_Claim):
    """Improvement of one method over another: `reduction` is 1 − method/reference, `excess` reference/method − 1."""

    kind: Literal["improvement"]
    method: str
    reference: str
    formula: Literal["reduction", "excess"]
    printed: float
    half_digit: float
    time_s: float

    @property
    def words(self) -> str:
        """The formula with the names of the methods: `INS / PLCF − 1`."""
        method, reference = self.method.upper(), self.reference.upper()
        return f"{reference} / {method} − 1" if self.formula == "excess" else f"1 − {method} / {reference}"

    @property
    def methods(self) -> list[str]:
        """The methods that the claim is about."""
        return [self.method, self.reference]


class OrderingClaim(_Claim):
    """Each of `better` against each of `worse`, or against itself on another trajectory."""

    _ruled_by = "relation"
    kind: Literal["ordering"]
    better: list[str]
    worse: list[str]
    relation: Literal["better", "equal"]
    time_s: float
    tolerance: float = 0.0
    than_trajectory: str | None = None

    @property
    def methods(self) -> list[str]:
        """The methods that the claim is about."""
        return [*self.better, *self.worse]

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Better and worse, each with each."""
        if self.than_trajectory is not None:
            return [(method, method) for method in self.better]
        return [(better, worse) for better in self.better for worse in self.worse]


class DriftClaim(_OneMethodClaim):
    """How the RMS of one method changes over a window of time, or in the turns."""

    _ruled_by = "pattern"
    kind: Literal["drift"]
    pattern: Literal["rising", "level", "oscillating"]
    window_s: tuple[float, float] | None = None
    tolerance: float = 0.0


class CauseClaim(_OneMethodClaim):
    """A drift over a window of time, and the cause that is given for it: without the cause the drift is smaller."""

    kind: Literal["cause"]
    window_s: tuple[float, float]
    without: Literal["dive"]
    tolerance: float


class BiasClaim(_Claim):
    """Remaining errors of the IMU biases at the end, as fractions of the bias (the error without aiding)."""

    _ruled_by = "pattern"
    kind: Literal["bias"]
    methods: list[str]
    biases: list[str]
    """Of `files.columns.BIASES`."""
    pattern: Literal["observable", "unobservable", "more"]
    """All shrink; none shrinks; all together shrink more than on another trajectory."""
    tolerance: float = 0.0
    than_trajectory: str | None = None


class NotTestableError(Exception):
    """Why a campaign's tables cannot decide a claim."""


Claim = ValueClaim | ImprovementClaim | OrderingClaim | DriftClaim | CauseClaim | BiasClaim


class PaperTrajectory(BaseModel):
    """The paper's number of a trajectory and of its figures."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    number: int
    kind: str
    velocity_figure: int
    attitude_figure: int


class Paper(BaseModel):
    """All claims, the rule of each kind of verdict in words, and the setup that the claims hold for."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: str
    rules: dict[str, str]
    setup: dict[str, Number]
    trajectories: dict[str, PaperTrajectory]
    claim: list[Annotated[Claim, Field(discriminator="kind")]]


def load_paper() -> Paper:
    """The packaged claims.

    >>> paper = load_paper()
    >>> next(claim.printed for claim in paper.claim if claim.id == "t1-velocity-ins")
    34.0
    """
    text = (resources.files("bottomlock.statistics") / "claims.toml").read_text(encoding="utf-8")
    return parse_paper(text, place="statistics/claims.toml")


def parse_paper(text: str, *, place: str) -> Paper:
    """Claims from TOML text; `place` names it in errors.

    Raises:
        DataError: for ill-formed TOML, a missing or unknown key, a rule without words, and two claims with one id.
    """
    try:
        paper = Paper.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise DataError(error, place=place) from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise DataError(f"{where}: {first['msg']}", place=place) from error
    seen: set[str] = set()
    for claim in paper.claim:
        if claim.id in seen:
            raise DataError(f"two claims have the id '{claim.id}'", place=place)
        if claim.rule not in paper.rules:
            raise DataError(
                f"claim '{claim.id}': rule '{claim.rule}' has no words under [rules]", place=place
            )
        if isinstance(claim, DriftClaim) and claim.pattern != "oscillating" and claim.window_s is None:
            raise DataError(f"claim '{claim.id}': pattern '{claim.pattern}' needs window_s", place=place)
        if isinstance(claim, BiasClaim):
            _check_biases(claim, place)
        seen.add(claim.id)
    return paper


def _check_biases(claim: BiasClaim, place: str) -> None:
    for bias in claim.biases:
        if bias not in BIASES:
            raise DataError(
                f"claim '{claim.id}': unknown bias '{bias}'",
                place=place,
                expected=f"one of {', '.join(BIASES)}",
            )
    if (claim.pattern == "more") != (claim.than_trajectory is not None):
        raise DataError(
            f"claim '{claim.id}': pattern 'more', and it alone, needs than_trajectory", place=place
        )
