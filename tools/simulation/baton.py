"""The lock of a simulation, and conditions whose waits last as long as virtual time says."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

T = TypeVar("T")

WaitUntil = Callable[[Callable[[], bool], float | None], bool]


class Baton:
    """A lock that one thread may take several times; it knows whether another one wants it."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self.wanting: deque[None] = deque()  # one for each thread that waits for it

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        if self._lock.acquire(False):
            return True
        if not blocking:
            return False
        self.wanting.append(None)
        try:
            return self._lock.acquire(True, timeout)
        finally:
            self.wanting.pop()

    def release(self) -> None:
        self._lock.release()

    def __enter__(self) -> bool:
        return self._lock.acquire(False) or self.acquire()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._lock.release()

    # What `threading.Condition` asks of a lock that one thread takes several times.

    def _is_owned(self) -> bool:
        return self._lock._is_owned()  # type: ignore[attr-defined,no-any-return]

    def _release_save(self) -> object:
        return self._lock._release_save()  # type: ignore[attr-defined]

    def _acquire_restore(self, state: object) -> None:
        self.wanting.append(None)
        try:
            self._lock._acquire_restore(state)  # type: ignore[attr-defined]
        finally:
            self.wanting.pop()


class VirtualCondition(threading.Condition):
    """A condition on the simulation's lock: whoever waits runs the simulation."""

    def __init__(self, baton: Baton, wait_until: WaitUntil) -> None:
        super().__init__(baton)  # type: ignore[arg-type]
        self._baton = baton
        self._wait_until = wait_until
        self._notified = 0

    def __enter__(self) -> bool:
        return self._baton.__enter__()

    def wait(self, timeout: float | None = None) -> bool:
        before = self._notified
        return self._wait_until(lambda: self._notified != before, timeout)

    def wait_for(self, predicate: Callable[[], T], timeout: float | None = None) -> T:
        self._wait_until(predicate, timeout)  # type: ignore[arg-type]  # whatever it returns is looked at as a truth
        return predicate()

    def notify(self, n: int = 1) -> None:
        self._notified += 1

    def notify_all(self) -> None:
        self._notified += 1
