"""The cameras of the cell, as LeRobot has cameras: the newest image, decoded once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import gemelo
from gemelo.api.addresses import is_address
from gemelo.api.robot_files import find_robot
from gemelo.libraries.arm.cell.cell_file import cell_of, load_cell
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.camera import CameraImage, CameraStatus
from gemelo.schemas.cell import CameraRecord
from gemelo.schemas.reasons import Reason, because, plain, remedy

Image = np.ndarray[Any, np.dtype[np.uint8]]
TO_READ = 2.0  # [s] for a cell to come over the bus
LIST = remedy("list_cameras")
OLDEST = 1.0  # [s] that an image may be old, beside four periods of its camera


def described(arm: str) -> tuple[ArmDescription, tuple[CameraRecord, ...]]:
    """An arm and the cameras of its cell, by their files; from the bus where `arm` is an address."""
    found = find_robot(arm, ask=False)
    if is_address(arm):
        return found.description, _cameras_on_bus(arm, found.description)
    cell = found.deployment.cell
    return found.description, load_cell(Path(cell), found.description).cameras if cell else ()


def _cameras_on_bus(address: str, description: ArmDescription) -> tuple[CameraRecord, ...]:
    """Of the cell that the process `camera` publishes there; none where it has none."""
    with gemelo.connect(address, needs_gateway=False) as arm:
        latest = arm.node.latest(gemelo.topics.CELL)
        arm.wait_for(lambda: latest.message is not None, TO_READ if "camera" in arm.node.alive() else 0.0)
        texts = latest.message
    return cell_of(texts, description, is_here=False).cameras if texts is not None and texts.path else ()


class CellCamera:
    """One camera of the cell; its interface is that of LeRobot's cameras."""

    def __init__(self, record: CameraRecord) -> None:
        self.name, self.fps = record.name, record.fps
        self.width, self.height = record.size
        self._patience = OLDEST + 4.0 / record.fps
        self._arm: gemelo.Arm | None = None
        self._status: CameraStatus | None = None
        self._message: CameraImage | None = None
        self._arrived = 0.0  # [s] monotonic
        self._read: CameraImage | None = None  # the one that was decoded
        self._image: Image | None = None

    @property
    def is_connected(self) -> bool:
        """True between `connect_to` and `disconnect`."""
        return self._arm is not None

    def connect_to(self, arm: gemelo.Arm, timeout: float) -> None:
        """Awaits the first image for `timeout` [s]; raises TimeoutError with what the camera reports."""
        self._arm = arm
        arm.node.subscribe(gemelo.topics.camera_status(self.name), self._on_status)
        arm.node.subscribe(gemelo.topics.camera_image(self.name), self._on_image)
        if not arm.wait_for(lambda: self._message is not None, timeout):
            why = because("lerobot.camera.silent", LIST, camera=self.name, time=timeout)
            raise TimeoutError(str(self._fault() or why))

    def read_latest(self, max_age_ms: float | None = None) -> Image:
        """The newest image (height, width, 3), RGB; raises TimeoutError where it is older than `max_age_ms` [ms]."""
        if self._arm is None or self._message is None:
            raise ConnectionError(str(because("lerobot.not_connected", name=self.name)))
        age = self._arm.node.monotonic() - self._arrived
        most = self._patience if max_age_ms is None else max_age_ms / 1000.0
        if age > most:
            why = because("lerobot.camera.old", LIST, camera=self.name, age=age, limit=most)
            raise TimeoutError(str(self._fault() or why))
        if self._image is None or self._read is not self._message:
            self._read = self._message
            self._image = decoded(self._read)
        return self._image

    def async_read(self, timeout_ms: float = 200.0) -> Image:
        """As `read_latest`, but an image that was read already is awaited anew for `timeout_ms` [ms]."""
        if self._arm is not None:
            self._arm.wait_for(lambda: self._message is not self._read, timeout_ms / 1000.0)
        return self.read_latest()

    def disconnect(self) -> None:
        """The images end with the connection of the arm."""
        self._arm = None

    def _on_image(self, message: CameraImage) -> None:
        if self._arm is not None:
            self._message, self._arrived = message, self._arm.node.monotonic()
            self._arm.wake()

    def _on_status(self, status: CameraStatus) -> None:
        self._status = status

    def _fault(self) -> Reason | None:
        """What is wrong with the camera, as it reports it."""
        status = self._status
        if status is None or not status.text:
            return None
        return because("lerobot.camera.fault", status.why or plain(status.text), camera=self.name)


def decoded(message: CameraImage) -> Image:
    """The image (height, width, 3), RGB; raises ValueError where the data is none."""
    if message.encoding in ("rgb8", "mono8"):
        rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, -1)
        return np.repeat(rows, 3, axis=2) if message.encoding == "mono8" else rows
    import cv2  # slow to load, and part of LeRobot's own environment

    image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        count, encoding = len(message.data), message.encoding
        raise ValueError(str(because("lerobot.camera.data", camera=message.camera, count=count, encoding=encoding)))
    return np.asarray(image[..., ::-1], np.uint8)
