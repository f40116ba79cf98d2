"""The one extra thread of a node, for handlers that take longer than a loop's period."""

from __future__ import annotations

import threading
from queue import SimpleQueue

from services.runtime.inbox import Task


class Worker:
    """Does tasks in order, in a thread that starts with the first."""

    def __init__(self) -> None:
        self._tasks: SimpleQueue[Task | None] = SimpleQueue()
        self._thread: threading.Thread | None = None

    def put(self, task: Task) -> None:
        self._tasks.put(task)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, daemon=True, name="worker")
            self._thread.start()

    def close(self) -> None:
        """Ends after the present task; does not wait for it."""
        self._tasks.put(None)

    def _run(self) -> None:
        while (task := self._tasks.get()) is not None:
            task()
