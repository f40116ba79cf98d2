"""Images that were stored: of a folder, or of one file, which is a video or a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.camera import CameraCondition
from gemelo.schemas.cell import CameraRecord
from gemelo.schemas.reasons import because
from gemelo.services.camera.sources.source import EncodedImage, encoded, fault_of

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
                raise fault_of(
                    self._record.name, CameraCondition.ENDED, because("camera.file.end", file=str(self._folder))
                )
            self._waiting = self._pictures()
        return picture(self._record, self._waiting.pop(0), self._clock)

    def close(self) -> None:
        pass

    def _pictures(self) -> list[Path]:
        if not self._folder.is_dir():
            what = because("camera.folder.none", folder=str(self._folder))
            raise fault_of(self._record.name, CameraCondition.MISSING, what)
        found = sorted(each for each in self._folder.iterdir() if each.suffix.lower() in PICTURES)
        if not found:
            what = because("camera.folder.empty", folder=str(self._folder))
            raise fault_of(self._record.name, CameraCondition.MISSING, what)
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
            raise fault_of(
                self._record.name, CameraCondition.MISSING, because("camera.file.none", file=str(self._path))
            )
        if self._path.suffix.lower() in PICTURES:
            return
        self._capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise fault_of(
                self._record.name, CameraCondition.REFUSED, because("camera.file.no_video", file=str(self._path))
            )

    def read(self) -> EncodedImage:
        """Raises `CameraFault` at the end, and for another size than the cell file's."""
        if self._capture is None:
            return picture(self._record, self._path, self._clock)
        is_there, image = self._capture.read()
        if not is_there and self._loop:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            is_there, image = self._capture.read()
        if not is_there:
            raise fault_of(self._record.name, CameraCondition.ENDED, because("camera.file.end", file=str(self._path)))
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
        what = because("camera.file.unreadable", file=str(path), error=error.strerror or str(error))
        raise fault_of(record.name, CameraCondition.MISSING, what) from None
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise fault_of(record.name, CameraCondition.REFUSED, because("camera.file.no_picture", file=str(path)))
    return _frame(record, path, image, content if path.suffix.lower() != ".png" else encoded(image), clock.unix())


def _frame(record: CameraRecord, path: Path, image: Any, content: bytes, stamp: int) -> EncodedImage:
    height, width = image.shape[:2]
    if (width, height) != record.size:
        wanted = {"wanted_width": record.size[0], "wanted_height": record.size[1]}
        what = because("camera.file.size", file=str(path), width=width, height=height, **wanted)
        raise fault_of(record.name, CameraCondition.REFUSED, what)
    return EncodedImage(stamp, width, height, content)
