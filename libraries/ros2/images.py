"""Cameras in messages of ROS 2: compressed images, and the model of the lens beside each."""

from __future__ import annotations

from typing import Any

import numpy as np

from gemelo.libraries.ros2.messages import header_of
from gemelo.libraries.ros2.types import make
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.frames import FrameTransform

IMAGE, INFO = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
JPEG = "jpeg"
FIVE = 5  # coefficients of plumb_bob
UNTURNED = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def frame_of(camera: str, prefix: str = "") -> str:
    """The name of a camera's optical frame."""
    return f"{prefix}{camera}_optical_frame"


def compressed_image(image: CameraImage, prefix: str = "") -> Any | None:
    """sensor_msgs/CompressedImage with the stamp of the capture; None for an image that is not compressed."""
    if image.encoding != JPEG:
        return None
    header = header_of(image.stamp, frame_of(image.camera, prefix))
    return make(IMAGE, header=header, format=JPEG, data=np.frombuffer(image.data, np.uint8))


def camera_info(info: CameraInfo, stamp: int, prefix: str = "") -> Any:
    """sensor_msgs/CameraInfo at `stamp` [ns]: OpenCV's model, which ROS calls plumb_bob."""
    k = np.array(info.intrinsics or (0.0,) * 9, np.float64)
    lens = (*info.distortion, *(0.0,) * FIVE)[:FIVE]
    return make(
        INFO,
        header=header_of(stamp, frame_of(info.name, prefix)),
        height=info.height,
        width=info.width,
        distortion_model="plumb_bob",
        d=np.array(lens, np.float64),
        k=k,
        r=np.array(UNTURNED, np.float64),
        p=np.hstack([k.reshape(3, 3), np.zeros((3, 1))]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def camera_frame(info: CameraInfo, stamp: int) -> FrameTransform | None:
    """The optical frame in the frame that carries the camera, at `stamp` [ns]; None where it is not known."""
    if not info.is_mounted:
        return None
    return FrameTransform(stamp=stamp, parent=info.parent, child=frame_of(info.name), transform=info.parent_from_camera)
