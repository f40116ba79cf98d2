"""The parts that all wires share: a thread that connects again and again, and a queue for what arrives."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable

from gemelo.services.stepper_gateway.links.link import Received
from gemelo.services.stepper_gateway.links.repeated_states import Repetition

CAPACITY = 4096  # [messages] 80 s of state; chosen: beyond any pause of the loop that the arm would bear
BACK_OFF = (0.1, 0.2, 0.5, 1.0)  # [s] between attempts; chosen: quick after a short cut, no flood after a long one


class ReceiveQueue:
    """Bounded: what is not taken in time makes room for what is newer; one thread puts, one takes.

    A state that repeats the one before wakes nobody: the loop takes it at its next step.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._waiting: deque[Received] = deque(maxlen=CAPACITY)
        self._wake = wake
        self._repetition = Repetition()

    def put(self, *received: Received) -> None:
        self._waiting.extend(received)
        repeated = [self._repetition.is_in(each) for each in received]
        if not all(repeated):
            self._wake()

    def take(self, most: int) -> list[Received]:
        taken: list[Received] = []
        with contextlib.suppress(IndexError):
            while len(taken) < most:
                taken.append(self._waiting.popleft())
        return taken


def keep_connected(connection: Callable[[], bool], stop: threading.Event) -> None:
    """Until `stop`: one `connection` after the other; each returns at its end, and says whether it ever stood."""
    attempt = 0
    while not stop.is_set():
        if connection():
            attempt = 0
        stop.wait(BACK_OFF[min(attempt, len(BACK_OFF) - 1)])
        attempt += 1
