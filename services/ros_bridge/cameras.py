"""The cameras of the cell file as topics of ROS 2: images as they were compressed, the lens, and where each stands."""

from __future__ import annotations

from collections.abc import Callable

from gemelo.libraries.ros2 import images
from gemelo.libraries.ros2.types import encode, ros_type
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.frames import FrameTransform
from gemelo.schemas.topics import camera_image, camera_info
from gemelo.services.ros_bridge.topics import Publishing


class CameraTopics:
    """One camera."""

    def __init__(
        self, node: Node, ros: Publishing, name: str, prefix: str, on_frame: Callable[[FrameTransform], None]
    ) -> None:
        """`prefix` stands before frames; `on_frame` gets the optical frame once it is known where the camera stands."""
        self._node, self._prefix, self._on_frame = node, prefix, on_frame
        self._image = ros.publisher(f"camera/{name}/image/compressed", ros_type(images.IMAGE))
        self._lens = ros.publisher(f"camera/{name}/camera_info", ros_type(images.INFO))
        self._info: CameraInfo | None = None
        node.subscribe(camera_info(name), self._take_info)
        node.subscribe(camera_image(name), self._take_image)

    def _take_info(self, info: CameraInfo) -> None:
        self._info = info
        frame = images.camera_frame(info, self._node.now())
        if frame is not None:
            self._on_frame(frame)

    def _take_image(self, image: CameraImage) -> None:
        message = images.compressed_image(image, self._prefix)
        if message is None:
            return
        self._image.put(encode(message), image.stamp)
        if self._info is not None:
            lens = images.camera_info(self._info, image.stamp, self._prefix)
            self._lens.put(encode(lens), image.stamp)
