"""The published ways that ours is compared with: OpenCV's corners and its pose of least error."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, from_opencv
from gemelo.libraries.vision.tag_pose import square
from gemelo.libraries.vision.tags import DEFAULT_FAMILY, FAMILIES

METHODS = {"SUBPIX": cv2.aruco.CORNER_REFINE_SUBPIX, "APRILTAG": cv2.aruco.CORNER_REFINE_APRILTAG}
APRILTAG_SHIFT = 0.5  # [px] by which APRILTAG's corners are off along both axes


def opencv_corners(image: NDArray[np.uint8], method: str) -> Array | None:
    """The corners (4, 2) [px] of the first tag with OpenCV's refinement "SUBPIX" or "APRILTAG"; None without a tag."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = METHODS[method]
    dictionary = cv2.aruco.getPredefinedDictionary(FAMILIES[DEFAULT_FAMILY][0])
    found = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)[0]
    return np.asarray(found[0][0], dtype=np.float64) if len(found) else None


def opencv_pose(corners: Array, model: CameraModel, size: float) -> Array:
    """camera_from_tag (4, 4) of IPPE_SQUARE, its solution of least error, of `corners` (4, 2) [px] and `size` [m]."""
    solved = cv2.solvePnPGeneric(square(size), corners, model.matrix, model.distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    return from_opencv(solved[1][0], solved[2][0])
