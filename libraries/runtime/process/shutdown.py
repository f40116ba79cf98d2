"""Shutdown by SIGTERM and SIGINT: the first requests a clean stop, a process that does not stop in time is ended."""

from __future__ import annotations

import _thread
import faulthandler
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from types import FrameType

GRACE = 2.0  # [s] from the signal to the end of the process, whatever its callbacks do
SIGNALS = (signal.SIGTERM, signal.SIGINT)


class ShutdownRequest:
    """The request that the process shuts down; safe to set in a signal handler."""

    def __init__(self) -> None:
        self.is_set = False
        self._listeners: list[Callable[[], None]] = []
        self._wake: SimpleQueue[None] = SimpleQueue()

    def set(self) -> None:
        self.is_set = True
        self._wake.put(None)
        for each in self._listeners:
            each()

    def wait(self, timeout: float) -> bool:
        """True if it is set; waits up to `timeout` [s] for it. For one thread only."""
        if not self.is_set:
            with suppress(Empty):
                self._wake.get(timeout=timeout)
        return self.is_set

    def on_set(self, listener: Callable[[], None]) -> None:
        """`listener` must be safe in a signal handler."""
        self._listeners.append(listener)


@contextmanager
def stop_on_signals(stop: ShutdownRequest, grace: float = GRACE) -> Iterator[None]:
    """Sets `stop` at the first signal, until the block ends; does nothing outside the main thread.

    A block that has not ended `grace` [s] after the signal is ended with the process, exit code 1.
    A second SIGINT raises KeyboardInterrupt.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals = 0
    is_over = False

    def guard() -> None:
        time.sleep(grace)
        if not is_over:
            _end(grace)

    def on_signal(number: int, frame: FrameType | None) -> None:
        nonlocal signals
        signals += 1
        if signals == 1:
            _thread.start_new_thread(guard, ())  # a Thread's locks may be held by the code that was interrupted
            stop.set()
        elif number == signal.SIGINT:
            raise KeyboardInterrupt

    before = {each: signal.signal(each, on_signal) for each in SIGNALS}
    try:
        yield
    finally:
        is_over = True
        for each, handler in before.items():
            signal.signal(each, handler)


def end_with_any_thread(log: logging.Logger, is_stopping: Callable[[], bool]) -> None:
    """From now on an error that ends a thread ends the process, exit code 1, unless `is_stopping()`.

    A service that goes on without the thread which reads its wire looks well and hears nothing; one that has ended is
    started again.
    """

    def on_error(died: threading.ExceptHookArgs) -> None:
        name = died.thread.name if died.thread is not None else "unknown"
        error = (died.exc_type, died.exc_value or died.exc_type(), died.exc_traceback)
        log.error('the thread "%s" has died, and with it this process', name, exc_info=error)
        if not is_stopping():
            _exit(1)

    threading.excepthook = on_error


def end_soon(code: int) -> None:
    """Ends the process with `code` after `GRACE`, where it has not ended by itself."""

    def guard() -> None:
        time.sleep(GRACE)
        _exit(code)

    _thread.start_new_thread(guard, ())


def _exit(code: int) -> None:
    with suppress(OSError):
        sys.stderr.flush()
    os._exit(code)


def _end(grace: float) -> None:
    with suppress(OSError):  # nobody, or a full disk, takes the words
        print(f"did not stop within {grace:g} s: ended where it stands:", file=sys.stderr)
        faulthandler.dump_traceback(file=sys.stderr)
        sys.stderr.flush()
    os._exit(1)
