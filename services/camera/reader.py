"""The reader of one source, a thread of its own: it keeps the newest image only, and opens again what has failed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import cv2

from gemelo.libraries.runtime.clock import Clock
from gemelo.schemas.camera import CameraCondition
from gemelo.schemas.reasons import plain
from gemelo.services.camera.sources.source import CameraFault, CameraSource, EncodedImage, fault_of

RETRY = 0.5  # [s] between two attempts to open

Event = EncodedImage | CameraFault


class ImageReader:
    """Reads until `stop`; `wake` is called from its thread when there is something to `take`, once until it is taken.

    A reader that is slower than the camera loses all but the newest image, and no fault.
    """

    def __init__(self, source: CameraSource, wake: Callable[[], None], name: str = "camera") -> None:
        self._source, self._wake = source, wake
        self._lock = threading.Lock()
        self._faults: list[CameraFault] = []
        self.frame: EncodedImage | None = None  # the newest that nobody has taken
        self._stop, self._anew = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout: float = 1.0) -> None:
        """Ends it; a device that hangs is left behind after `timeout` [s]."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def reopen(self) -> None:
        """Closes and opens the source: for one that gives the same image again and again."""
        self._anew.set()

    def take(self) -> list[Event]:
        """Faults since the last call, then the newest image that came after them."""
        with self._lock:
            events: list[Event] = [*self._faults]
            if self.frame is not None:
                events.append(self.frame)
            self._faults, self.frame = [], None
        return events

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._source.open()
                self._read_on()
            except CameraFault as fault:
                self._put(fault)
                if fault.condition is CameraCondition.ENDED:
                    self._stop.set()
            except (OSError, cv2.error) as error:  # as a folder that is being removed while it is read
                self._put(fault_of(self._thread.name, CameraCondition.REFUSED, plain(str(error))))
            finally:
                self._source.close()
            self._stop.wait(RETRY)

    def _read_on(self) -> None:
        due = time.monotonic()
        self._anew.clear()
        while not (self._stop.is_set() or self._anew.is_set()):
            self._put(self._source.read())
            due = max(due + self._source.period, time.monotonic() - self._source.period)
            wait = due - time.monotonic()
            if self._source.period and wait > 0.0:
                self._stop.wait(wait)

    def _put(self, event: Event) -> None:
        with self._lock:
            is_first = self.frame is None and not self._faults
            if isinstance(event, CameraFault):
                self._faults.append(event)
                self.frame = None  # of before the fault
            else:
                self.frame = event
        if is_first:
            self._wake()


class ClockedReader(ImageReader):
    """As `ImageReader`, without a thread: a clock of virtual time has it read."""

    def __init__(self, source: CameraSource, wake: Callable[[], None], name: str, clock: Clock) -> None:
        super().__init__(source, wake, name)
        self._clock, self._is_open = clock, False

    def start(self) -> None:
        self._clock.later(0.0, self._read)

    def stop(self, timeout: float = 1.0) -> None:
        """Closes the source; there is nothing to wait `timeout` [s] for."""
        self._stop.set()
        self._close()

    def _read(self) -> None:
        """One image, and the next when it is due."""
        if self._stop.is_set():
            return
        pause = RETRY
        try:
            if self._anew.is_set():
                self._close()
            if not self._is_open:
                self._anew.clear()
                self._source.open()
                self._is_open = True
            self._put(self._source.read())
            pause = self._source.period
        except CameraFault as fault:
            self._put(fault)
            self._close()
            if fault.condition is CameraCondition.ENDED:
                return
        self._clock.later(pause, self._read)

    def _close(self) -> None:
        if self._is_open:
            self._is_open = False
            self._source.close()
