"""The cameras of one cell on the bus: a reader, a core and the publishers of each."""

from __future__ import annotations

import cv2

from gemelo.libraries.arm.cell.camera_model import believed_info, exact_info
from gemelo.libraries.arm.cell.cell_file import Cell
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.bus.wire import TooLarge
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.node_clock import NodeClock
from gemelo.libraries.runtime.scene_meshes import SceneMeshes
from gemelo.schemas.camera import CameraCondition, CameraImage
from gemelo.schemas.cell import CameraRecord, FileSource, FolderSource, V4l2Source, VirtualSource
from gemelo.schemas.topics import (
    GATEWAY,
    GRIPPER_STATE,
    JOINT_STATES,
    SCENE,
    camera_image,
    camera_info,
    camera_status,
    camera_truth,
)
from gemelo.services.camera.core import CameraCore
from gemelo.services.camera.reader import ClockedReader, ImageReader
from gemelo.services.camera.sources.source import CameraSource, EncodedImage, fault_of
from gemelo.services.camera.sources.stored import FolderOfImages, Video
from gemelo.services.camera.sources.v4l2 import V4l2Camera
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera, true_detections
from gemelo.services.camera.virtual.world import CameraWorld

REOPEN = 3_000_000_000  # [ns] between two attempts to wake a camera that gives the same image again and again


class Cameras:
    """Every camera of the cell, from the first image to the last."""

    def __init__(self, node: Node, arm: ArmDescription, cell: Cell) -> None:
        """Starts a thread for each camera; raises `DescriptionError` where the arm cannot be drawn."""
        cv2.setNumThreads(1)
        self._world = _watched_world(node, arm, cell)
        self._node, self._arm = node, arm
        self._cameras = [_Camera(node, arm, cell, record, self._world) for record in cell.cameras]

    def tell_about(self, cell: Cell) -> None:
        """Publishes each camera's lens and pose as the cell knows them now."""
        for record in cell.cameras:
            info = believed_info(cell, record, self._arm.base_frame)
            self._node.publisher(camera_info(record.name)).put(info)

    def step(self, now: int) -> None:
        for camera in self._cameras:
            camera.step(now)
        self._node.set_ready(True)

    def close(self) -> None:
        for camera in self._cameras:
            camera.reader.stop()


class _Camera:
    """One camera between its thread and the bus."""

    def __init__(
        self, node: Node, arm: ArmDescription, cell: Cell, record: CameraRecord, world: CameraWorld | None
    ) -> None:
        self._node, self._record, self._cell = node, record, cell
        self._exact, self._world = exact_info(record, arm.base_frame), world
        self._image = node.publisher(camera_image(record.name))
        self._status = node.publisher(camera_status(record.name))
        source = self._source(record, cell)
        self._core = CameraCore(record.name, record.fps, source.is_live, node.now())
        self._said, self._reopened = "", 0
        wake = lambda: node.post(self._take)  # noqa: E731
        self.reader = (
            ClockedReader(source, wake, record.name, node.clock)
            if node.clock.is_virtual
            else ImageReader(source, wake, record.name)
        )
        self.reader.start()

    def step(self, now: int) -> None:
        status = self._core.step(now)
        if status is not None:
            self._status.put(status)
            self._tell_truth()
        self._log()
        if self._core.condition is CameraCondition.FROZEN and now - self._reopened > REOPEN:
            self._reopened = now
            self.reader.reopen()

    def _take(self) -> None:
        now = self._node.now()
        for event in self.reader.take():
            if isinstance(event, EncodedImage):
                image = self._core.on_frame(event, now)
                if image is not None:
                    self._put(image, now)
            else:
                self._core.on_fault(event, now)

    def _put(self, image: CameraImage, now: int) -> None:
        try:
            self._image.put(image)
        except TooLarge as error:
            self._core.on_fault(fault_of(self._record.name, CameraCondition.REFUSED, error.reason), now)

    def _log(self) -> None:
        """A change of condition, once."""
        text = self._core.text or str(self._core.condition)
        if self._core.condition is CameraCondition.STARTING or self._core.condition == self._said:
            return
        is_first, self._said = not self._said, self._core.condition
        if self._core.text:
            self._node.log.warning("%s", text)
        else:
            self._node.log.info('camera "%s": images come%s', self._record.name, "" if is_first else " again")

    def _tell_truth(self) -> None:
        if isinstance(self._record.source, VirtualSource) and self._world is not None:
            things = {thing.name: thing for thing in self._cell.things}
            truth = true_detections(self._world.snapshot(), self._exact, things)
            self._node.publisher(camera_truth(self._record.name)).put(truth)

    def _source(self, record: CameraRecord, cell: Cell) -> CameraSource:
        clock = self._node.clock
        match record.source:
            case V4l2Source():
                return V4l2Camera(record, record.source)
            case FolderSource():
                return FolderOfImages(record, cell.path_of(record.source.path), record.source.loop, clock)
            case FileSource():
                return Video(record, cell.path_of(record.source.path), record.source.loop, clock)
            case VirtualSource():
                assert self._world is not None  # there is one for every cell with a virtual camera
                return VirtualCamera(record, record.source, self._exact, self._world.snapshot, clock)


def _watched_world(node: Node, arm: ArmDescription, cell: Cell) -> CameraWorld | None:
    """The world that virtual cameras look at, kept up to date; None where there is none of them."""
    if not any(isinstance(record.source, VirtualSource) for record in cell.cameras):
        return None
    world = CameraWorld(arm, cell, NodeClock(node, GATEWAY).to_own)
    node.subscribe(JOINT_STATES, world.on_joint_state)
    node.subscribe(GRIPPER_STATE, world.on_gripper_state)
    node.subscribe(SCENE, SceneMeshes(node, world.on_scene).on_scene)
    return world
