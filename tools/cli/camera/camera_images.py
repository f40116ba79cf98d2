"""The images of one camera for the commands that measure it: from the bus, or from a folder."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np

from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE, write_measured
from gemelo.libraries.arm.cell.cell_file import Cell
from gemelo.libraries.vision.rigid import Array, to_transform
from gemelo.libraries.vision.tags import GreyImage
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.cell import CameraRecord, MeasuredCamera, Mount
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import JOINT_STATES, camera_image, camera_info
from gemelo.tools.cli.camera.cells import cell_of
from gemelo.tools.cli.common.errors import CommandError, require_folder, unknown, usage
from gemelo.tools.cli.common.session import CommandSession, load_robot

if TYPE_CHECKING:
    from gemelo import Arm

PATIENCE = 3.0  # [s] for the next image
SLOWEST = 0.5  # [s] from image to image
AT_REST = 1e-3  # [rad/s] or [m/s]
SETTLING = 200_000_000  # [ns] in which what an arm carries comes to rest after it
MOST_HEARD = 30  # images that are kept
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")


@dataclass(frozen=True)
class Subject:
    """The camera that is measured."""

    cell: Cell
    record: CameraRecord

    @property
    def name(self) -> str:
        return self.record.name

    @property
    def measured(self) -> MeasuredCamera:
        """What was measured of it until now."""
        return self.cell.measured.get(self.name, MeasuredCamera(name=self.name))

    def write_mount(self, parent: str, pose: Array, held_out: float) -> Path:
        """Adds that the camera's `pose` (4, 4) in `parent` was measured today, and how far off it was."""
        found = to_transform(pose)
        (x, y, z), (qx, qy, qz, qw) = found.translation, found.rotation
        mount = Mount(
            parent=parent, position=(x, y, z), rotation=(qx, qy, qz, qw), held_out=held_out,
            date=datetime.now(UTC).strftime("%Y-%m-%d"),
        )  # fmt: skip
        return self.write(mount=mount)

    def write(self, **found: object) -> Path:
        """Adds to camera.toml what was found; the other cameras stay as they are."""
        known = {**self.cell.measured, self.name: msgspec.structs.replace(self.measured, **found)}
        path = self.cell.path.with_name(CAMERA_FILE)
        write_measured(path, [known[name] for name in self.cell.camera_names if name in known])
        return path


def subject(name: str) -> Subject:
    """The camera of the deployment's cell; its first one without a name. Raises `CommandError`."""
    robot = load_robot()
    cell = cell_of(robot)
    if not cell.cameras:
        raise usage(because("camera.none"))
    if not robot.deployment.cell:
        raise usage(because("camera.elsewhere", file=str(cell.path)))
    chosen = name or cell.cameras[0].name
    if chosen not in cell.camera_names:
        raise unknown("camera", chosen, cell.camera_names)
    return Subject(cell, cell.camera(chosen))


class Eye:
    """One camera, for an `arm` that shows it things: only what was seen at rest counts."""

    def __init__(self, arm: Arm, name: str) -> None:
        self._arm, self._name = arm, name
        self._heard: deque[CameraImage] = deque(maxlen=MOST_HEARD)
        arm.node.subscribe(camera_image(name), self._on_image)
        self._info = arm.node.latest(camera_info(name))
        self._state = arm.node.latest(JOINT_STATES)

    @property
    def info(self) -> CameraInfo:
        """What is known of its lens and place; raises `CommandError` where nobody tells it."""
        self._arm.wait_for(lambda: self._info.message is not None, PATIENCE)
        if self._info.message is None:
            raise CommandError(because("camera.silent", camera=self._name))
        return self._info.message

    def images(self, count: int) -> list[GreyImage]:
        """The next `count` images that were taken after the arm came to rest; raises `CommandError` where none come."""
        arm = self._arm
        if not arm.wait_for(lambda: all(abs(speed) < AT_REST for speed in arm.velocities.values()), PATIENCE):
            raise CommandError(because("camera.no_rest"))
        arm.wait_for(lambda: self._state.message is not None, PATIENCE)
        state = self._state.message
        since = (state.stamp if state is not None else arm.node.now()) + SETTLING
        seen: dict[int, CameraImage] = {}

        def are_enough() -> bool:
            seen.update((each.stamp, each) for each in list(self._heard) if each.stamp > since)
            return len(seen) >= count

        patience = PATIENCE + count * SLOWEST
        if not arm.wait_for(are_enough, patience):
            few = because("camera.few_images", count=len(seen), camera=self._name, time=patience, wanted=count)
            raise CommandError(few)
        taken = [seen[stamp] for stamp in sorted(seen)[:count]]
        decoded = [cv2.imdecode(np.frombuffer(each.data, np.uint8), cv2.IMREAD_GRAYSCALE) for each in taken]
        return [np.asarray(image, dtype=np.uint8) for image in decoded if image is not None]

    def _on_image(self, image: CameraImage) -> None:
        self._heard.append(image)
        self._arm.wake()


def from_folder(path: Path, size: tuple[int, int]) -> Iterator[GreyImage]:
    """The images of a folder by name; raises `CommandError` for one that is none, or of another size [px]."""
    require_folder(path, f"--images {path}")
    files = sorted(each for each in path.glob("*") if each.suffix.lower() in SUFFIXES)
    if not files:
        raise usage(because("camera.no_images", folder=str(path), suffixes=SUFFIXES))
    for file in files:
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise usage(because("camera.no_image_file", file=str(file)))
        if image.shape != size[::-1]:
            found = f"{image.shape[1]} x {image.shape[0]}"
            wanted = f"{size[0]} x {size[1]}"
            raise usage(because("camera.other_size", file=str(file), size=found, wanted=wanted))
        yield np.asarray(image, dtype=np.uint8)


def from_bus(session: CommandSession, name: str) -> Iterator[GreyImage]:
    """The newest image, again and again; raises `CommandError` where none comes."""
    newest: list[CameraImage] = []
    subscription = session.node.subscribe(camera_image(name), newest.append)
    try:
        while True:
            deadline = session.node.monotonic() + PATIENCE
            while not newest and session.node.monotonic() < deadline:
                session.node.wait(0.02)
            if not newest:
                raise CommandError(because("camera.no_image", camera=name, time=PATIENCE))
            message, newest[:] = newest[-1], []
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_GRAYSCALE)
            if image is not None:
                yield np.asarray(image, dtype=np.uint8)
    finally:
        subscription.close()


def info_of(session: CommandSession, name: str) -> CameraInfo:
    """What is known of the camera's lens; raises `CommandError` where nobody tells it."""
    heard: list[CameraInfo] = []
    subscription = session.node.subscribe(camera_info(name), heard.append)
    deadline = session.node.monotonic() + PATIENCE
    while not heard and session.node.monotonic() < deadline:
        session.node.wait(0.02)
    subscription.close()
    if not heard:
        raise CommandError(because("camera.silent", camera=name))
    return heard[-1]
