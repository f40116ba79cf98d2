"""Images that were stored: of a folder, or of one file, which is a video or a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.camera import CameraCondition
from gemelo.schemas.cell import CameraRecord
from gemelo.services.camera.sources.source import CameraFault, EncodedImage, encoded

PICTURES = {".jpg", ".jpeg", ".png"}


class FolderOfImages:
    """The pictures of a folder by name; the folder is read again at every round, so that it may grow."""

    is_live = False

    def __init__(self, record: CameraRecord, folder: Path, loop: bool, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self.period = 1.0 / record.fps
        self._record, self._folder, self._loop = record, folder, loop
        self._waiting: list[Path] = []
        self._has_begun = False

    def open(self) -> None:
        """Raises `CameraFault` where there is no picture."""
        if not self._has_begun or self._loop:
            self._waiting = self._pictures()
            self._has_begun = True

    def read(self) -> EncodedImage:
        """Raises `CameraFault` at the end, for a picture that cannot be read, and for one of another size."""
        if not self._waiting:
            if not self._loop:
                raise _fault(self._record, CameraCondition.ENDED, f"{self._folder} is at its end")
            self._waiting = self._pictures()
        return picture(self._record, self._waiting.pop(0), self._clock)

    def close(self) -> None:
        pass

    def _pictures(self) -> list[Path]:
        if not self._folder.is_dir():
            raise _fault(self._record, CameraCondition.MISSING, f"there is no folder {self._folder}")
        found = sorted(each for each in self._folder.iterdir() if each.suffix.lower() in PICTURES)
        if not found:
            raise _fault(self._record, CameraCondition.MISSING, f"no picture (.jpg, .png) is in {self._folder}")
        return found


class Video:
    """A video, or one picture again and again."""

    is_live = False

    def __init__(self, record: CameraRecord, path: Path, loop: bool, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self.period = 1.0 / record.fps
        self._record, self._path, self._loop = record, path, loop
        self._capture: Any = None

    def open(self) -> None:
        """Raises `CameraFault` where it is not there or no video."""
        if not self._path.is_file():
            raise _fault(self._record, CameraCondition.MISSING, f"there is no file {self._path}")
        if self._path.suffix.lower() in PICTURES:
            return
        self._capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise _fault(self._record, CameraCondition.REFUSED, f"{self._path} is no video that OpenCV can read")

    def read(self) -> EncodedImage:
        """Raises `CameraFault` at the end, and for another size than the cell file's."""
        if self._capture is None:
            return picture(self._record, self._path, self._clock)
        is_there, image = self._capture.read()
        if not is_there and self._loop:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            is_there, image = self._capture.read()
        if not is_there:
            raise _fault(self._record, CameraCondition.ENDED, f"{self._path} is at its end")
        return _frame(self._record, self._path, image, encoded(image), self._clock.unix())

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None


def picture(record: CameraRecord, path: Path, clock: Clock = SYSTEM) -> EncodedImage:
    """A picture as a frame, a JPEG as it is; raises `CameraFault`."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise _fault(record, CameraCondition.MISSING, f"{path}: {error.strerror or error}") from None
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise _fault(record, CameraCondition.REFUSED, f"{path} is no picture that OpenCV can read")
    return _frame(record, path, image, content if path.suffix.lower() != ".png" else encoded(image), clock.unix())


def _frame(record: CameraRecord, path: Path, image: Any, content: bytes, stamp: int) -> EncodedImage:
    height, width = image.shape[:2]
    if (width, height) != record.size:
        wish = f"{record.size[0]} x {record.size[1]}"
        said = f"{path} is {width} x {height}, not {wish}: write size = [{width}, {height}]"
        raise _fault(record, CameraCondition.REFUSED, said)
    return EncodedImage(stamp, width, height, content)


def _fault(record: CameraRecord, condition: CameraCondition, text: str) -> CameraFault:
    return CameraFault(condition, f'camera "{record.name}": {text}')
