"""Sources: a camera's settings and failures by name, folders and files as they are, and the thread that reads them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from gemelo.schemas.camera import CameraCondition
from gemelo.schemas.cell import CameraRecord, V4l2Source, VirtualSource
from gemelo.schemas.reasons import because
from gemelo.services.camera.reader import ImageReader
from gemelo.services.camera.sources.source import CameraFault, EncodedImage, encoded
from gemelo.services.camera.sources.stored import FolderOfImages, Video
from gemelo.services.camera.sources.v4l2 import MJPG, V4l2Camera, capture_stamp, holder_of

RECORD = CameraRecord(name="webcam", source=VirtualSource(), size=(64, 48), fps=100.0)
MS = 1_000_000


class PretendCapture:
    """The part of cv2.VideoCapture that is used, with a driver that keeps or refuses what it is told."""

    def __init__(self, keeps: dict[int, float] | None = None, images: list[np.ndarray] | None = None) -> None:
        self.keeps = {cv2.CAP_PROP_AUTOFOCUS: 0.0, **(keeps or {})}
        self.told: list[tuple[int, float]] = []
        self.values: dict[int, float] = {}
        self.images = images or []
        self.is_open = True

    def isOpened(self) -> bool:  # noqa: N802
        return self.is_open

    def set(self, key: int, value: float) -> bool:
        self.told.append((key, value))
        self.values[key] = value
        return True

    def get(self, key: int) -> float:
        return self.keeps.get(key, self.values.get(key, 0.0))

    def read(self) -> tuple[bool, np.ndarray]:
        return (True, self.images.pop(0)) if self.images else (False, np.empty(0, np.uint8))

    def release(self) -> None:
        self.is_open = False


@pytest.fixture
def device(tmp_path: Path) -> Path:
    """Stands for /dev/video0: a file that can be there, be gone, and be open elsewhere."""
    path = tmp_path / "video0"
    path.write_bytes(b"")
    return path


def camera(device: Path, capture: PretendCapture, **settings: float) -> V4l2Camera:
    source = V4l2Source(device=str(device), **settings)  # type: ignore[arg-type]
    return V4l2Camera(RECORD, source, lambda path: capture, lambda path: "")


def fault_of(source: V4l2Camera | FolderOfImages | Video, what: str = "open") -> CameraFault:
    with pytest.raises(CameraFault) as raised:
        getattr(source, what)()
    assert 'camera "webcam": ' in str(raised.value)
    return raised.value


def test_the_size_is_set_before_the_rate_and_jpeg_goes_through_untouched(device: Path) -> None:
    jpeg = np.frombuffer(encoded(np.zeros((48, 64, 3), np.uint8)), np.uint8)[None, :]
    capture = PretendCapture(images=[jpeg])
    source = camera(device, capture)
    source.open()
    order = [key for key, _ in capture.told]
    assert order.index(cv2.CAP_PROP_FOURCC) < order.index(cv2.CAP_PROP_FRAME_WIDTH) < order.index(cv2.CAP_PROP_FPS)
    assert (cv2.CAP_PROP_CONVERT_RGB, 0.0) in capture.told
    assert source.read().data == jpeg.tobytes()
    source.close()
    assert not capture.is_open


def test_a_camera_without_jpeg_is_encoded_here(device: Path) -> None:
    capture = PretendCapture({cv2.CAP_PROP_FOURCC: 0.0}, [np.full((48, 64, 3), 90, np.uint8)])
    source = camera(device, capture)
    source.open()
    image = cv2.imdecode(np.frombuffer(source.read().data, np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (48, 64, 3)
    assert abs(int(image.mean()) - 90) <= 1


def test_what_the_camera_does_not_take_is_refused_by_name(device: Path) -> None:
    size = fault_of(camera(device, PretendCapture({cv2.CAP_PROP_FRAME_WIDTH: 320.0, cv2.CAP_PROP_FRAME_HEIGHT: 240.0})))
    assert size.condition is CameraCondition.REFUSED
    assert "it gives 320 x 240, not 64 x 48: write size = [320, 240]" in str(size)
    sizes = {"given_width": 320, "given_height": 240, "width": 64, "height": 48}
    assert size.reason == because("camera.fault", because("camera.size", **sizes), camera="webcam")
    focus = fault_of(camera(device, PretendCapture({cv2.CAP_PROP_FOCUS: 0.0}), focus=30.0))
    assert "does not take focus = 30 (it says 0)" in str(focus)
    exposure = fault_of(camera(device, PretendCapture({cv2.CAP_PROP_EXPOSURE: 250.0}), exposure=150.0))
    assert "does not take exposure = 150 (it says 250)" in str(exposure)
    autofocus = fault_of(camera(device, PretendCapture({cv2.CAP_PROP_AUTOFOCUS: 1.0})))
    assert "its autofocus cannot be switched off" in str(autofocus)
    camera(device, PretendCapture(), focus=30.0, exposure=150.0).open()


def test_a_device_that_is_not_there_is_missing_and_one_that_goes_silent_is_unplugged_or_frozen(device: Path) -> None:
    missing = fault_of(camera(device.with_name("video7"), PretendCapture()))
    assert missing.condition is CameraCondition.MISSING
    assert "video7: plug it in; `gemelo camera list`" in str(missing)
    assert [cause.code for cause in missing.reason.causes] == ["camera.device.none"]
    source = camera(device, PretendCapture())
    source.open()
    assert fault_of(source, "read").condition is CameraCondition.FROZEN
    device.unlink()
    assert fault_of(source, "read").condition is CameraCondition.UNPLUGGED


def test_a_real_capture_of_what_is_no_camera_is_refused(device: Path) -> None:
    fault = fault_of(V4l2Camera(RECORD, V4l2Source(device=str(device)), what_else=lambda path: ""))
    assert fault.condition is CameraCondition.REFUSED
    assert "gives no images" in str(fault)


@pytest.mark.parametrize("path", ["/dev/null", "/dev/tty", "/dev/zero", "a pipe", "a folder", "a file"])
def test_a_path_that_is_no_camera_is_refused_by_name_before_it_is_opened(path: str, tmp_path: Path) -> None:
    (tmp_path / "a folder").mkdir()
    (tmp_path / "a file").write_bytes(b"")
    os.mkfifo(tmp_path / "a pipe")
    path = path if path.startswith("/") else str(tmp_path / path)
    fault = fault_of(V4l2Camera(RECORD, V4l2Source(device=path), capture=pytest.fail))
    what = Path(path).name if " " in path and "pipe" not in path else "another device"
    assert fault.condition is CameraCondition.REFUSED
    assert f"{path} is {what}, no camera: write the device as `gemelo camera list` prints it" in str(fault)


def test_the_program_that_has_the_camera_is_named(device: Path) -> None:
    command = [sys.executable, "-c", f"f = open({str(device)!r}); print('open', flush=True); input()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdout is not None
            assert other.stdout.readline() == "open\n"
            capture = PretendCapture()
            capture.is_open = False
            fault = fault_of(camera(device, capture))
        finally:
            other.kill()
    assert fault.condition is CameraCondition.TAKEN
    assert f"process {other.pid} (python" in str(fault)
    assert holder_of(str(device)) == ""


@pytest.mark.parametrize(
    ("driver", "stamp"),
    [(4_990.0, 990 * MS), (0.0, 1000 * MS), (5_100.0, 1000 * MS), (900.0, 1000 * MS)],
    ids=["10 ms ago", "says nothing", "in the future", "of another clock"],
)
def test_the_stamp_is_the_drivers_time_where_it_has_one(driver: float, stamp: int) -> None:
    assert capture_stamp(driver, monotonic=5_000 * MS, now=1_000 * MS) == stamp


def test_a_folder_is_played_by_name_and_its_jpegs_go_through_untouched(tmp_path: Path) -> None:
    for number in (2, 1):
        (tmp_path / f"{number}.jpg").write_bytes(encoded(np.full((48, 64, 3), 40 * number, np.uint8)))
    cv2.imwrite(str(tmp_path / "3.png"), np.full((48, 64, 3), 120, np.uint8))
    source = FolderOfImages(RECORD, tmp_path, loop=True)
    source.open()
    read = [source.read() for _ in range(4)]
    assert [each.data for each in read[:2]] == [(tmp_path / f"{number}.jpg").read_bytes() for number in (1, 2)]
    assert read[2].data.startswith(b"\xff\xd8")
    assert read[3].data == read[0].data
    assert (read[0].width, read[0].height) == (64, 48)


def test_a_folder_that_is_played_once_ends_and_one_without_pictures_is_missing(tmp_path: Path) -> None:
    assert fault_of(FolderOfImages(RECORD, tmp_path, loop=True)).condition is CameraCondition.MISSING
    assert "there is no folder" in str(fault_of(FolderOfImages(RECORD, tmp_path / "none", loop=True)))
    (tmp_path / "1.jpg").write_bytes(encoded(np.zeros((48, 64, 3), np.uint8)))
    source = FolderOfImages(RECORD, tmp_path, loop=False)
    source.open()
    source.read()
    assert fault_of(source, "read").condition is CameraCondition.ENDED
    source.close()
    source.open()
    assert fault_of(source, "read").condition is CameraCondition.ENDED


def test_a_picture_of_another_size_or_of_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "1.jpg").write_bytes(encoded(np.zeros((24, 32, 3), np.uint8)))
    source = FolderOfImages(RECORD, tmp_path, loop=True)
    source.open()
    assert "is 32 x 24, not 64 x 48: write size = [32, 24]" in str(fault_of(source, "read"))
    (tmp_path / "1.jpg").write_bytes(b"\xff\xd8 no picture")
    source.open()
    assert "is no picture" in str(fault_of(source, "read"))


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, MJPG, 10.0, (64, 48))
    for level in (20, 200):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    return path


def test_a_video_is_played_again_or_ends(video: Path) -> None:
    source = Video(RECORD, video, loop=True)
    source.open()
    levels = [int(cv2.imdecode(np.frombuffer(source.read().data, np.uint8), 0).mean()) for _ in range(4)]
    source.close()
    assert levels == pytest.approx([20, 200, 20, 200], abs=3)
    once = Video(RECORD, video, loop=False)
    once.open()
    once.read(), once.read()
    assert fault_of(once, "read").condition is CameraCondition.ENDED
    once.close()
    assert fault_of(Video(RECORD, video.with_name("none.avi"), loop=True)).condition is CameraCondition.MISSING


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    folder = tmp_path / "pictures"
    folder.mkdir()
    (folder / "1.jpg").write_bytes(encoded(np.zeros((48, 64, 3), np.uint8)))
    return folder


@pytest.fixture
def reading(pictures: Path) -> Iterator[tuple[ImageReader, threading.Semaphore]]:
    woken = threading.Semaphore(0)
    reader = ImageReader(FolderOfImages(RECORD, pictures, loop=True), woken.release)
    reader.start()
    yield reader, woken
    reader.stop()


def test_a_source_that_goes_comes_back_by_itself(
    pictures: Path, reading: tuple[ImageReader, threading.Semaphore]
) -> None:
    reader, woken = reading
    assert isinstance(next_of(reader, woken, EncodedImage), EncodedImage)
    shutil.move(pictures, pictures.with_name("away"))
    fault = next_of(reader, woken, CameraFault)
    assert isinstance(fault, CameraFault)
    assert fault.condition is CameraCondition.MISSING
    shutil.move(pictures.with_name("away"), pictures)
    assert isinstance(next_of(reader, woken, EncodedImage), EncodedImage)


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), cv2.error("no memory")])
def test_a_source_that_fails_in_a_way_of_its_own_is_named_and_tried_again(
    pictures: Path, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, errors = FolderOfImages.read, [error]

    def read(self: FolderOfImages) -> EncodedImage:
        if errors:
            raise errors.pop()
        return real(self)

    monkeypatch.setattr(FolderOfImages, "read", read)
    woken = threading.Semaphore(0)
    reader = ImageReader(FolderOfImages(RECORD, pictures, loop=True), woken.release, "webcam")
    reader.start()
    try:
        fault = next_of(reader, woken, CameraFault)
        assert isinstance(fault, CameraFault)
        assert str(fault).startswith('camera "webcam": ')
        assert fault.condition is CameraCondition.REFUSED
        assert isinstance(next_of(reader, woken, EncodedImage), EncodedImage)
    finally:
        reader.stop()


def test_a_video_that_is_removed_while_it_is_played_goes_on_and_is_missing_when_it_is_opened_again(video: Path) -> None:
    source = Video(RECORD, video, loop=True)
    source.open()
    source.read()
    video.unlink()
    for _ in range(5):  # more than it has: from its beginning again
        assert source.read().width == 64
    source.close()
    assert fault_of(source).condition is CameraCondition.MISSING


def test_a_single_picture_that_is_removed_is_missing_and_comes_back(pictures: Path) -> None:
    path = pictures / "1.jpg"
    content, source = path.read_bytes(), Video(RECORD, pictures / "1.jpg", loop=True)
    source.open()
    source.read()
    path.unlink()
    assert fault_of(source, "read").condition is CameraCondition.MISSING
    path.write_bytes(content)
    assert source.read().data == content


def test_a_slow_reader_gets_the_newest_image_only_and_is_woken_once(
    reading: tuple[ImageReader, threading.Semaphore],
) -> None:
    reader, woken = reading
    assert woken.acquire(timeout=5.0)
    first = reader.take()
    begun = time.time_ns()
    deadline = time.monotonic() + 60.0
    assert woken.acquire(timeout=5.0)
    while reader.frame is None or reader.frame.stamp < begun + 50 * MS:  # five images and more
        assert time.monotonic() < deadline
        os.sched_yield()
    assert not woken.acquire(blocking=False)
    events = reader.take()
    assert [type(each) for each in (*first, *events)] == [EncodedImage, EncodedImage]


def next_of(reader: ImageReader, woken: threading.Semaphore, kind: type) -> object:
    """Takes until something of that kind has come."""
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        woken.acquire(timeout=1.0)
        found = [event for event in reader.take() if isinstance(event, kind)]
        if found:
            return found[-1]
    raise AssertionError(f"no {kind.__name__} in 10 s")
