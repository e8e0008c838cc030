"""What a search has come to, in numbers from which it goes on to the same bits."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from bottomlock.replay.tune.search import State

Save = Callable[[Mapping[str, Any]], None]
"""Keeps the content of a journal."""


@dataclass(eq=False)
class Journal:
    """Record of a search.

    Attributes:
        finished: the results of finished stages by their names.
        stage: the stage at work, empty between stages.
        state: its state.
        passes, wall_s: done so far.
        save: called with the content after each change.
    """

    finished: dict[str, Any] = field(default_factory=dict)
    stage: str = ""
    state: dict[str, Any] | None = None
    passes: int = 0
    wall_s: float = 0.0
    save: Save = lambda _: None

    def begun(self, stage: str) -> State | None:
        """The state that a stage was interrupted in; None where it begins."""
        if self.stage != stage or self.state is None:
            return None
        return State(**(self.state | {"at": tuple(self.state["at"])}))

    def note(self, stage: str, state: State, passes: int, wall_s: float) -> None:
        """Records the state of a stage."""
        self.stage, self.state = stage, asdict(state) | {"at": list(state.at)}
        self._save(passes, wall_s)

    def finish(self, stage: str, result: Mapping[str, Any], passes: int, wall_s: float) -> None:
        """Records the result of a stage."""
        self.finished[stage] = dict(result)
        self.stage, self.state = "", None
        self._save(passes, wall_s)

    def _save(self, passes: int, wall_s: float) -> None:
        self.passes, self.wall_s = passes, wall_s
        self.save(
            {
                "finished": self.finished,
                "stage": self.stage,
                "state": self.state,
                "passes": passes,
                "wall_s": wall_s,
            }
        )
