"""A camera that is missing, taken, unplugged or frozen is named within 2 s, and comes back: in virtual time."""

from __future__ import annotations

import pytest

from gemelo.schemas.camera import CameraCondition, CameraImage, CameraStatus
from gemelo.schemas.reasons import Reason, because
from gemelo.services.camera.core import CameraCore
from gemelo.services.camera.sources.source import EncodedImage, fault_of

SECOND = 1_000_000_000
STEP = SECOND // 10
START = 1_700_000_000 * SECOND


NO_VIDEO = because("camera.file.no_video", file="a.avi")


class Watched:
    """A core and its clock, which the shell steps ten times a second."""

    def __init__(self, fps: float = 15.0, is_live: bool = True) -> None:
        self.now = START
        self.core = CameraCore("webcam", fps, is_live, self.now)
        self.said: list[CameraStatus] = []
        self._count = 0

    def wait(self, seconds: float, streaming: bool = False, same: bool = False) -> list[CameraImage]:
        """Steps for so long; with `streaming` a new image comes before every step."""
        images = []
        for _ in range(round(seconds * SECOND / STEP)):
            self.now += STEP
            if streaming:
                image = self.frame(same)
                images += [image] if image is not None else []
            status = self.core.step(self.now)
            self.said += [status] if status is not None else []
        return images

    def frame(self, same: bool = False) -> CameraImage | None:
        self._count += 0 if same else 1
        return self.core.on_frame(EncodedImage(self.now - 5, 640, 480, b"\xff\xd8%d" % self._count), self.now)

    def fault(self, condition: CameraCondition, what: Reason = NO_VIDEO) -> None:
        self.core.on_fault(fault_of("webcam", condition, what), self.now)

    def until(self, condition: CameraCondition, timeout: float, streaming: bool = False, same: bool = False) -> float:
        """[s] until a status of that condition has been said."""
        begun, known = self.now, len(self.said)
        while not any(status.condition is condition for status in self.said[known:]):
            assert self.now - begun < timeout * SECOND, [status.condition for status in self.said]
            self.wait(0.1, streaming, same)
        return (self.now - begun) / SECOND


def test_images_go_through_with_the_stamp_of_their_capture() -> None:
    watched = Watched()
    (image,) = watched.wait(0.1, streaming=True)
    assert (image.stamp, image.camera, image.encoding) == (watched.now - 5, "webcam", "jpeg")
    assert watched.said[-1].condition is CameraCondition.STREAMING
    watched.wait(3.0, streaming=True)
    assert watched.said[-1].fps == pytest.approx(10.0, abs=1.0)
    assert watched.said[-1].text == ""


def test_the_status_is_said_at_every_change_and_once_a_second() -> None:
    watched = Watched()
    watched.wait(5.0, streaming=True)
    assert 5 <= len(watched.said) <= 7


@pytest.mark.parametrize("condition", [CameraCondition.MISSING, CameraCondition.TAKEN, CameraCondition.REFUSED])
def test_what_cannot_be_opened_is_named_at_the_next_step_and_comes_back(condition: CameraCondition) -> None:
    watched = Watched()
    taken = because("camera.device.taken", holder="process 12 (cheese)", path="/dev/video0")
    watched.fault(condition, taken)
    assert watched.until(condition, 2.0) <= 0.2
    assert watched.said[-1].why == because("camera.fault", taken, camera="webcam")
    assert watched.said[-1].text == 'camera "webcam": process 12 (cheese) has /dev/video0: end that program'
    watched.fault(condition)
    watched.wait(1.0)
    watched.frame()
    assert watched.until(CameraCondition.STREAMING, 2.0) <= 0.2
    assert watched.said[-1].text == ""


def test_what_has_streamed_and_is_missing_was_unplugged_until_it_streams_again() -> None:
    watched = Watched()
    watched.wait(1.0, streaming=True)
    watched.fault(CameraCondition.MISSING)
    assert watched.until(CameraCondition.UNPLUGGED, 2.0) <= 0.2
    for _ in range(4):  # attempts to open it
        watched.wait(0.5)
        watched.fault(CameraCondition.MISSING)
    assert watched.core.condition is CameraCondition.UNPLUGGED
    watched.frame()
    assert watched.until(CameraCondition.STREAMING, 2.0) <= 0.2


def test_one_that_sends_nothing_is_frozen_within_two_seconds_and_comes_back() -> None:
    watched = Watched()
    watched.wait(1.0, streaming=True)
    assert watched.until(CameraCondition.FROZEN, 2.0) <= 2.0
    assert "no new image for 1." in watched.said[-1].text
    why = watched.said[-1].why
    assert why is not None
    assert [cause.code for cause in why.causes] == ["camera.frozen"]
    watched.frame()
    assert watched.until(CameraCondition.STREAMING, 2.0) <= 0.2


def test_one_that_repeats_its_image_is_frozen_too_and_what_it_repeats_is_not_published() -> None:
    watched = Watched()
    watched.wait(1.0, streaming=True)
    known = watched.now
    watched.until(CameraCondition.FROZEN, 2.0, streaming=True, same=True)
    assert watched.now - known <= 2 * SECOND
    assert watched.wait(1.0, streaming=True, same=True) == []
    assert len(watched.wait(0.3, streaming=True)) == 3


def test_a_folder_of_one_picture_may_repeat_it() -> None:
    watched = Watched(is_live=False)
    assert len(watched.wait(5.0, streaming=True, same=True)) == 50
    assert watched.core.condition is CameraCondition.STREAMING


def test_one_that_never_answers_is_named_too() -> None:
    watched = Watched()
    assert watched.until(CameraCondition.FROZEN, 2.0) <= 2.0


def test_a_slow_camera_is_given_its_own_time() -> None:
    watched = Watched(fps=0.5)
    for _ in range(5):
        watched.frame()
        watched.wait(2.0)
    assert watched.core.condition is CameraCondition.STREAMING
