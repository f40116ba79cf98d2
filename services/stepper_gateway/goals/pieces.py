"""Work on a long goal in pieces, between which the gateway's loop does what else is due: states, heartbeats, stops."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Generic, TypeVar

from gemelo.services.stepper_gateway.goals.rejections import GoalRejected

T = TypeVar("T")

PIECE = 500  # points, or samples of a path, in one; chosen: below 10 ms with eight joints

Pieces = Generator[None, None, T]  # yields after each piece; its value is the result


class Part(Generic[T]):
    """One check of a goal, done once however often it is looked at: its result, or the rejection that it ends with."""

    def __init__(self, pieces: Pieces[T]) -> None:
        self._pieces = pieces
        self._results: list[T] = []  # one, once it is done
        self.rejected: GoalRejected | None = None

    def go_on(self) -> Iterator[None]:
        """Does what is left of it; whoever leaves that halfway may go on later."""
        while self._advance():
            yield

    def result(self) -> T:
        """Does what is left of it at once; raises `GoalRejected`."""
        while self._advance():
            pass
        if self.rejected is not None:
            raise self.rejected
        return self._results[0]

    def _advance(self) -> bool:
        """Does one piece; False if nothing is left."""
        if self._results or self.rejected is not None:
            return False
        try:
            next(self._pieces)
        except StopIteration as ended:
            self._results.append(ended.value)
            return False
        except GoalRejected as rejected:
            self.rejected = rejected
            return False
        return True
