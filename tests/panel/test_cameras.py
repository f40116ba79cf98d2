"""Images of the cameras on the page: two a second of each at most, only of the cell's own cameras."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from schemas.camera import CameraImage
from services.panel.model import cameras
from services.panel.model.cameras import LARGEST, CameraPictures
from services.panel.view.kit import picture


@pytest.fixture
def heard(monkeypatch):
    """The pictures of one camera, a clock, and the handlers by key."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(cameras.time, "monotonic", lambda: clock.now)
    handlers = {}
    node = SimpleNamespace(subscribe=lambda topic, handler: handlers.update({topic.key: handler}))
    return CameraPictures(SimpleNamespace(node=node), ("above",)), clock, handlers["camera/above/image"]


def test_the_newest_image_is_an_address_twice_a_second(heard):
    pictures, clock, hear = heard
    assert pictures.address("above") == ""
    shown = []
    for step in range(15):
        clock.now = 100.0 + step / 15.0
        hear(CameraImage(camera="above", data=b"%d" % step))
        shown.append(pictures.address("above"))
    assert len(set(shown)) == 2
    assert shown[0] == "data:image/jpeg;base64,MA=="


@pytest.mark.parametrize(
    "image",
    [
        CameraImage(camera="above", encoding="rgb8", data=b"1"),
        CameraImage(camera="above", data=bytes(LARGEST + 1)),
        CameraImage(camera='"><script>', data=b"1"),
    ],
)
def test_what_is_no_jpeg_too_large_or_of_another_camera_is_not_shown(heard, image):
    pictures, _, hear = heard
    hear(image)
    assert pictures.address(image.camera) == ""


def test_a_caption_is_safe_in_the_page():
    assert "<script>" not in picture("data:,", "<script>")
