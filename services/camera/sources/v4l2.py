"""A camera of Linux by OpenCV's VideoCapture: MJPEG handed through as it comes, settings fixed or refused by name."""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.camera import CameraCondition
from gemelo.schemas.cell import CameraRecord, V4l2Source
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.camera.sources.source import CameraFault, EncodedImage, encoded, fault_of

MANUAL_EXPOSURE = 1.0  # V4L2_EXPOSURE_MANUAL
MJPG = cv2.VideoWriter.fourcc(*"MJPG")
START_OF_JPEG = b"\xff\xd8"
OLDEST = 1_000_000_000  # [ns] a driver's time that is further back is none
PROCESSES = Path("/proc")
VIDEO_MAJOR = 81  # of the kernel's video devices (Documentation/admin-guide/devices.txt)


class Capture(Protocol):
    """The part of cv2.VideoCapture that is used."""

    def isOpened(self) -> bool: ...  # noqa: N802

    def set(self, key: int, value: float) -> bool: ...

    def get(self, key: int) -> float: ...

    def read(self) -> tuple[bool, NDArray[np.uint8]]: ...

    def release(self) -> None: ...


def open_device(path: str) -> Capture:
    """The device by V4L2 alone: another back end may open another camera in its place."""
    capture: Capture = cv2.VideoCapture(path, cv2.CAP_V4L2)
    return capture


class V4l2Camera:
    """One device, opened anew whenever it has failed."""

    period = 0.0
    is_live = True

    def __init__(
        self,
        record: CameraRecord,
        source: V4l2Source,
        capture: Callable[[str], Capture] = open_device,
        what_else: Callable[[str], str] | None = None,
    ) -> None:
        """`what_else`: what a path is that is no video device; empty for one that is."""
        self._record, self._source = record, source
        self._open_capture, self._what_else = capture, what_else or kind_of
        self._capture: Capture | None = None
        self._is_jpeg = False

    def open(self) -> None:
        """Raises `CameraFault`: missing, not permitted, taken, or a setting that it does not take."""
        path = os.path.realpath(self._source.device)
        if not os.path.exists(path):
            raise self._fault(CameraCondition.MISSING, because("camera.device.none", LIST, device=self._source.device))
        if other := self._what_else(path):
            what = because("camera.device.other", device=self._source.device, kind=other)
            raise self._fault(CameraCondition.REFUSED, what)
        if not os.access(path, os.R_OK | os.W_OK):
            raise self._fault(CameraCondition.REFUSED, because("camera.device.permission", path=path))
        self._capture = self._open_capture(path)
        if not self._capture.isOpened():
            raise self._why_closed(path)
        self._configure(self._capture)

    def read(self) -> EncodedImage:
        """Waits for the next image (h, w, 3); raises `CameraFault` where none comes."""
        assert self._capture is not None, "open it first"
        is_there, data = self._capture.read()
        if not is_there:
            raise self._why_silent()
        stamp = capture_stamp(self._capture.get(cv2.CAP_PROP_POS_MSEC), time.monotonic_ns(), time.time_ns())
        content = data.tobytes() if self._is_jpeg else encoded(data)
        if not content.startswith(START_OF_JPEG):
            raise self._fault(CameraCondition.REFUSED, because("camera.mjpeg"))
        width, height = self._record.size
        return EncodedImage(stamp, width, height, content)

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None

    def _configure(self, capture: Capture) -> None:
        """The format first, then the size, and the rate last: each resets those after it."""
        width, height = self._record.size
        capture.set(cv2.CAP_PROP_FOURCC, MJPG)
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        capture.set(cv2.CAP_PROP_FPS, self._record.fps)
        self._is_jpeg = int(capture.get(cv2.CAP_PROP_FOURCC)) == MJPG
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0.0 if self._is_jpeg else 1.0)
        given = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if given != (width, height):
            sizes = {"given_width": int(given[0]), "given_height": int(given[1]), "width": width, "height": height}
            raise self._fault(CameraCondition.REFUSED, because("camera.size", **sizes))
        self._fix_focus(capture)
        if self._source.exposure is not None:
            capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL_EXPOSURE)
            self._fix(capture, cv2.CAP_PROP_EXPOSURE, "exposure", self._source.exposure)

    def _fix_focus(self, capture: Capture) -> None:
        """A focus that moves changes the focal length, and with it every distance."""
        has_autofocus = capture.get(cv2.CAP_PROP_AUTOFOCUS) > 0.0
        if has_autofocus:
            capture.set(cv2.CAP_PROP_AUTOFOCUS, 0.0)
            if capture.get(cv2.CAP_PROP_AUTOFOCUS) > 0.0:
                raise self._fault(CameraCondition.REFUSED, because("camera.autofocus"))
        if self._source.focus is not None:
            self._fix(capture, cv2.CAP_PROP_FOCUS, "focus", self._source.focus)

    def _fix(self, capture: Capture, key: int, name: str, wanted: float) -> None:
        capture.set(key, wanted)
        given = capture.get(key)
        if abs(given - wanted) > 0.5:
            what = because("camera.control", name=name, value=wanted, given=given)
            raise self._fault(CameraCondition.REFUSED, what)

    def _why_closed(self, path: str) -> CameraFault:
        holder = holder_of(path)
        if holder:
            return self._fault(CameraCondition.TAKEN, because("camera.device.taken", holder=holder, path=path))
        return self._fault(CameraCondition.REFUSED, because("camera.device.no_images", LIST, path=path))

    def _why_silent(self) -> CameraFault:
        if not os.path.exists(os.path.realpath(self._source.device)):
            return self._fault(CameraCondition.UNPLUGGED, because("camera.device.gone", device=self._source.device))
        return self._fault(CameraCondition.FROZEN, because("camera.device.silent"))

    def _fault(self, condition: CameraCondition, what: Reason) -> CameraFault:
        return fault_of(self._record.name, condition, what)


LIST = remedy("list_cameras_there")


def kind_of(path: str) -> str:
    """What it is where it is no video device of Linux; empty where it is one, or is gone."""
    try:
        found = os.stat(path)
    except OSError:
        return ""
    if stat.S_ISCHR(found.st_mode):
        return "" if os.major(found.st_rdev) == VIDEO_MAJOR else "another device"
    return "a folder" if stat.S_ISDIR(found.st_mode) else "a file" if stat.S_ISREG(found.st_mode) else "another device"


def capture_stamp(driver: float, monotonic: int, now: int) -> int:
    """[ns] UNIX time of an image whose driver says `driver` [ms] of the monotonic clock; `now` where that is none.

    `monotonic` and `now` [ns] are the two clocks at the same moment.
    """
    age = monotonic - int(driver * 1e6)
    return now - age if driver > 0.0 and 0 <= age <= OLDEST else now


def holder_of(path: str) -> str:
    """The process of this user that has the file open, as "process 123 (cheese)"; empty where none is seen."""
    for folder in PROCESSES.glob("[0-9]*"):
        if int(folder.name) != os.getpid() and _has_open(folder, path):
            try:
                return f"process {folder.name} ({(folder / 'comm').read_text().strip()})"
            except OSError:
                return f"process {folder.name}"
    return ""


def _has_open(folder: Path, path: str) -> bool:
    try:
        return any(os.readlink(each) == path for each in (folder / "fd").iterdir())
    except OSError:  # it has ended, or is another user's
        return False
