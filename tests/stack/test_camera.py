"""A virtual camera in the whole stack: its image follows the arm, is shown, and is in the recording."""

from __future__ import annotations

import re
import time
from pathlib import Path

import cv2
import pytest
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader

from tests.stack.gemelo import gemelo


@pytest.fixture(scope="module")
def stack(cell_stack):
    return cell_stack


def tags_in(file: Path) -> set[int]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36H11)
    numbers = cv2.aruco.ArucoDetector(dictionary).detectMarkers(cv2.imread(str(file)))[1]
    return set() if numbers is None else set(numbers.ravel().tolist())


def test_the_camera_of_the_cell_sees_the_arm_where_it_is_and_is_recorded(stack, tmp_path):
    assert re.search(r"overhead +virtual .* calibrated +measured +streaming", gemelo(stack, "camera", "list"))
    gemelo(stack, "move", "--named", "left")
    view = tmp_path / "view.jpg"
    gemelo(stack, "camera", "view", "overhead", "--save", str(view))
    assert {1, 100, 101} <= tags_in(view)
    gemelo(stack, "move", "--to", "0.26", "0.16", "0.12")  # above the cup, whose tag it hides
    gemelo(stack, "camera", "view", "overhead", "--save", str(view))
    assert 1 not in tags_in(view)
    assert {100, 101} <= tags_in(view)
    assert re.search(r"camera/overhead/image", gemelo(stack, "topic", "list"))
    recorded = wait_for_images(stack)
    assert {"foxglove.CompressedImage", "foxglove.CameraCalibration", "foxglove.FrameTransform"} <= recorded


def wait_for_images(stack) -> set[str]:
    """The schemas of the recording once it has images."""
    deadline = time.monotonic() + 20.0
    while True:
        (file,) = (stack.out / "recordings").glob("*.mcap")
        with file.open("rb") as stream:
            names = schemas_of(StreamReader(stream))
        if "foxglove.CompressedImage" in names or time.monotonic() > deadline:
            return names
        time.sleep(0.5)


def schemas_of(reader: StreamReader) -> set[str]:
    found = set()
    try:
        for record in reader.records:
            if type(record).__name__ == "Schema":
                found.add(record.name)
    except McapError:  # the file is being written: it ends anywhere
        pass
    return found
