"""Images of the cameras on the page: two a second of each at most, only of the cell's own cameras, with outlines."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gemelo.schemas.camera import CameraImage
from gemelo.schemas.detections import Detection, Detections
from gemelo.services.panel.model import cameras
from gemelo.services.panel.model.cameras import AGED, LARGEST, CameraPictures, Picture
from gemelo.services.panel.view.camera_box import CHOSEN, image_html

CUP = Detection(name="cup", corners=((300.0, 200.0), (340.0, 200.0), (340.0, 240.0), (300.0, 240.0)))


@pytest.fixture
def heard(monkeypatch):
    """The pictures of one camera, a clock, and the handlers by key."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(cameras.time, "monotonic", lambda: clock.now)
    handlers = {}
    node = SimpleNamespace(subscribe=lambda topic, handler: handlers.update({topic.key: handler}))
    pictures = CameraPictures(SimpleNamespace(node=node), ("above",))
    return SimpleNamespace(
        pictures=pictures, clock=clock, see=handlers["camera/above/image"], detect=handlers["camera/above/detections"]
    )


def image(stamp: int = 0, **fields) -> CameraImage:
    return CameraImage(**{"stamp": stamp, "camera": "above", "width": 640, "height": 480, "data": b"0", **fields})


def test_the_newest_image_is_an_address_twice_a_second(heard):
    assert heard.pictures.picture("above").address == ""
    shown = []
    for step in range(15):
        heard.clock.now = 100.0 + step / 15.0
        heard.see(image(data=b"%d" % step))
        shown.append(heard.pictures.picture("above").address)
    assert len(set(shown)) == 2
    assert shown[0] == "data:image/jpeg;base64,MA=="


@pytest.mark.parametrize(
    "wrong", [{"encoding": "rgb8"}, {"data": bytes(LARGEST + 1)}, {"camera": '"><script>'}]
)  # fmt: skip
def test_what_is_no_jpeg_too_large_or_of_another_camera_is_not_shown(heard, wrong):
    shown = image(**wrong)
    heard.see(shown)
    assert heard.pictures.picture(shown.camera).address == ""


def test_a_click_means_what_was_detected_in_pixels_of_the_camera(heard):
    heard.see(image())
    heard.detect(Detections(camera="above", items=(CUP,)))
    assert heard.pictures.pointed_at("above", 0.5, 220 / 480, ("cup",)).name == "cup"
    assert heard.pictures.pointed_at("above", 0.5, 220 / 480, ("bolt",)).other == "cup"
    assert heard.pictures.pointed_at("above", 0.1, 0.1, ("cup",)).name == ""
    assert heard.pictures.pointed_at("below", 0.5, 0.5, ("cup",)).name == ""


def test_what_a_detector_that_has_ended_saw_is_neither_drawn_nor_chosen(heard):
    heard.detect(Detections(camera="above", stamp=1, items=(CUP,)))
    for stamp, is_there in ((AGED, True), (1 + AGED, False)):
        heard.clock.now += 1.0
        heard.see(image(stamp))
        assert bool(heard.pictures.picture("above").items) is is_there
        assert bool(heard.pictures.pointed_at("above", 0.5, 220 / 480, ("cup",)).name) is is_there


def test_detections_under_the_name_of_another_camera_are_not_taken(heard):
    heard.see(image())
    heard.detect(Detections(camera="elsewhere", items=(CUP,)))
    assert heard.pictures.pointed_at("above", 0.5, 220 / 480, ("cup",)).nearest == ""


def test_the_chosen_thing_stands_out_and_names_are_safe_in_the_page():
    evil = Detection(name="<script>", corners=CUP.corners)
    shown = image_html("<script>", Picture("data:,", 640, 480, 0, (CUP, evil)), "cup", "<script>")
    assert "<script>" not in shown
    assert shown.count("<polygon") == 4
    assert shown.count(f'stroke="{CHOSEN}"') == 1
