"""Closes the sessions that a program forgets: one left open would never let the process end."""

from __future__ import annotations

import threading
from typing import Protocol


class Closable(Protocol):
    """A session."""

    def close(self) -> None: ...


_open: set[Closable] = set()
_watch: list[threading.Thread] = []  # not a daemon, which would be cut off in the middle of closing


def close_with_the_program(session: Closable) -> None:
    """Closes it when the main thread ends, unless `forget` is called before."""
    _open.add(session)
    if not _watch:
        _watch.append(threading.Thread(target=_close_all_after_main, name="close"))
        _watch[0].start()


def forget(session: Closable) -> None:
    """It has been closed."""
    _open.discard(session)


def _close_all_after_main() -> None:
    threading.main_thread().join()
    for session in list(_open):
        session.close()
