"""The time of one request: its deadline, its cancellation, and where the time went."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

from gemelo.schemas.planning import PlanningTimes
from gemelo.services.planner.request.refusals import PlanRefused, timed_out


def endless() -> float:
    """A clock [s] that stands still, so that no deadline ever passes."""
    return 0.0


class CancelFlag(Protocol):
    """Set from another thread to cancel a plan: the native planner's `CancelFlag`, or a `threading.Event`."""

    def set(self) -> None: ...

    def is_set(self) -> bool: ...


class CountedTime(CancelFlag, Protocol):
    """A flag that is a clock too: its time goes on by the same amount with every question, from whoever works for the
    plan, so that the same plan takes the same time however busy the machine is."""

    def time(self, questions: int = 1) -> float:
        """[s] after so many more questions."""
        ...


class DeadlinePassed(PlanRefused):
    """The refusal (TIMED_OUT) of a plan whose deadline has passed, from wherever it is at."""

    def __init__(self) -> None:
        refused = timed_out()
        super().__init__(refused.code, refused.refusal)


class Deadline(NamedTuple):
    """`allowed` seconds from `began`, both by `clock` [s]; it has passed as soon as `cancel` is set.

    Without arguments it never passes.
    """

    clock: Callable[[], float] = endless
    allowed: float = math.inf
    began: float = 0.0
    cancel: CancelFlag | None = None

    @property
    def left(self) -> float:
        """Time left [s], at least 0."""
        if self.cancel is not None and self.cancel.is_set():
            return 0.0
        return max(0.0, self.allowed - (self.clock() - self.began))

    def has_passed(self) -> bool:
        """True if no time is left, or the plan is cancelled."""
        if self.cancel is not None and self.cancel.is_set():
            return True
        return not self.allowed - (self.clock() - self.began) > 0.0

    def check(self) -> None:
        """Raises `PlanRefused` (TIMED_OUT) if the deadline has passed."""
        if self.has_passed():
            raise DeadlinePassed

    def extended(self, part: float) -> Deadline:
        """A deadline later by `part`, a share of the time allowed, for the answer to one that has passed."""
        return Deadline(self.clock, (1.0 + part) * self.allowed, self.began, self.cancel)

    def share(self, part: float) -> Deadline:
        """A deadline within this one: only `part`, a share in (0, 1], of the time that is left."""
        now = self.clock()
        return Deadline(self.clock, part * (self.allowed - (now - self.began)), now, self.cancel)


NEVER = Deadline()


class TimedPhase:
    """One phase of a plan, as the block of a `with`: no `contextmanager`, which takes longer, a dozen times a plan."""

    def __init__(self, watch: Stopwatch, name: str) -> None:
        self._watch, self._name = watch, name

    def __enter__(self) -> None:
        self._watch.newest = self._name
        self._began, self._outer = self._watch.begin()

    def __exit__(self, *_: object) -> None:
        self._watch.end(self._name, self._began, self._outer)


class Stopwatch:
    """Adds up the phases of `PlanningTimes` [s] by `clock`; a phase inside another one counts for the inner one."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._spent = dict.fromkeys(PlanningTimes.__struct_fields__, 0.0)
        self._inner = 0.0
        self.newest = ""  # name of the phase begun last; may be read from another thread

    def phase(self, name: str) -> TimedPhase:
        """Counts the time of the `with` block for the field `name` of `PlanningTimes`."""
        return TimedPhase(self, name)

    def begin(self) -> tuple[float, float]:
        """The time [s], and what has been counted [s] within the phase around the one that begins."""
        outer, self._inner = self._inner, 0.0
        return self._clock(), outer

    def end(self, name: str, began: float, outer: float) -> None:
        """Counts a phase that began at the time `began` [s], with `outer` [s] counted around it."""
        took = self._clock() - began
        self._spent[name] += took - self._inner
        self._inner = outer + took

    @property
    def times(self) -> PlanningTimes:
        """The seconds spent in each phase so far."""
        return PlanningTimes(**self._spent)
