"""A Rerun recording on a disk that may refuse it for a while: what comes afterwards goes into a file beside the first.

Rerun's writer ends at the first write that fails, and what it has written by then can be read.
"""

from __future__ import annotations

import ctypes
import itertools
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import rerun as rr

from gemelo.libraries.runtime.process.own_files import make_own
from gemelo.libraries.runtime.process.unwritten import RETRY
from gemelo.services.visualizer.render.sink import APPLICATION, Sink

TO_FLUSH = 1.0  # [s] for the disk to take what waits; chosen: one that is slower has failed
ROOM = 1_000_000  # [bytes] that a disk must take before a file is begun; chosen: more than the first second
FLUSHED = 5.0  # [s] between two looks whether the writer lives; chosen: what a full disk costs of the past


class RecordingFile:
    """One recording; times in [s] monotonic."""

    def __init__(self, path: Path, recording_id: str, make_sink: Callable[[rr.RecordingStream], Sink]) -> None:
        """`make_sink` gives a new stream all that is static."""
        self._path, self._recording_id, self._make_sink = path, recording_id, make_sink
        self._stream: rr.RecordingStream | None = None
        self._has_begun = False
        self._next = float("-inf")  # of the next look or attempt
        self.sink: Sink | None = None
        self.problem = ""  # why nothing is written now

    def step(self, monotonic: float) -> bool:
        """Looks after the file at `monotonic` [s]; True where it was opened just now, and gets all from the start."""
        if monotonic < self._next:
            return False
        if self.sink is None:
            self._next = monotonic + RETRY
            return self._open()
        self._next = monotonic + (FLUSHED if self._is_written() else RETRY)
        return False

    def close(self) -> None:
        """Hands over what is left, in 5 s at most."""
        if self.sink is not None:
            with suppress(RuntimeError):
                self.sink.close(timeout=5.0)

    def _open(self) -> bool:
        path = self._free_path() if self._has_begun else self._path
        stream: rr.RecordingStream | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            require_room(path.parent)
            make_own(path)
            stream = rr.RecordingStream(APPLICATION, recording_id=self._recording_id)
            stream.save(str(path))
            sink = self._make_sink(stream)
            stream.flush(timeout_sec=TO_FLUSH)
        except (OSError, RuntimeError) as error:
            keep_for_ever(stream)
            if self._has_begun:
                with suppress(OSError):
                    path.unlink(missing_ok=True)
            self.problem = f"cannot write the recording {path}: {error}; it is tried again every {RETRY:g} s"
            return False
        self._stream, self.sink, self._has_begun, self.problem = stream, sink, True, ""
        return True

    def _is_written(self) -> bool:
        """True while Rerun's writer lives."""
        assert self._stream is not None
        try:
            self._stream.flush(timeout_sec=TO_FLUSH)
        except RuntimeError as error:
            self.problem = f"the recording ends, and goes on in a file beside it as soon as its disk takes one: {error}"
            keep_for_ever(self._stream)
            self._stream, self.sink = None, None
            return False
        return True

    def _free_path(self) -> Path:
        """`twin-2.rrd` beside `twin.rrd`, or the next that is not there."""
        numbered = (self._path.with_stem(f"{self._path.stem}-{number}") for number in itertools.count(2))
        return next(path for path in numbered if not path.exists())


def require_room(folder: Path) -> None:
    """Raises OSError where `folder` does not take `ROOM` bytes now."""
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(bytes(ROOM))
        file.flush()


def keep_for_ever(stream: rr.RecordingStream | None) -> None:
    """Never frees a stream whose writer has ended: that may wait without end for a word of the writer (Rerun 0.41).

    There are few of them, as each had `ROOM` before.
    """
    if stream is not None:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))
