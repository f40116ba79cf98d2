"""Images in the recording: a few a second, under the schemas that Foxglove's viewers know."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.frames import Transform
from gemelo.services.logger.core import Entry
from gemelo.services.logger.images import CameraRecorder
from gemelo.services.logger.recording import Recording

START = 1_795_000_000_000_000_000
SECOND = 1_000_000_000
# What the published JSON schemas require, foxglove/schemas/jsonschema on GitHub.
FIELDS = {
    "foxglove.CompressedImage": {"timestamp", "frame_id", "data", "format"},
    "foxglove.CameraCalibration": {
        "timestamp", "frame_id", "width", "height", "distortion_model", "D", "K", "R", "P",
    },
    "foxglove.FrameTransform": {"timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"},
}  # fmt: skip


def image(at: float, encoding: str = "jpeg") -> CameraImage:
    return CameraImage(stamp=START + round(at * SECOND), camera="above", encoding=encoding, data=b"\xff\xd8 jpeg")


@pytest.mark.parametrize(("rate", "recorded"), [(2.0, 20), (15.0, 150), (30.0, 150), (0.5, 5), (0.0, 0)])
def test_images_are_thinned_to_the_rate_and_never_doubled(rate: float, recorded: int) -> None:
    recorder = CameraRecorder("above")
    kept = [each for step in range(150) for each in recorder.on_image(image(step / 15.0), rate)]
    assert len(kept) == pytest.approx(recorded, abs=1)


def test_a_clock_that_is_set_back_does_not_end_the_recording() -> None:
    recorder = CameraRecorder("above")
    assert len(list(recorder.on_image(image(1000.0), 2.0))) == 1
    assert len(list(recorder.on_image(image(3.0), 2.0))) == 1


def test_what_is_no_jpeg_is_left_out() -> None:
    assert list(CameraRecorder("above").on_image(image(0.0, "rgb8"), 2.0)) == []


def test_a_recording_has_them_under_foxgloves_names_and_fields(tmp_path: Path) -> None:
    recorder = CameraRecorder("above")
    k = (554.0, 0.0, 319.5, 0.0, 553.0, 239.5, 0.0, 0.0, 1.0)
    info = CameraInfo(
        name="above", width=640, height=480, intrinsics=k, distortion=(0.1, 0.0, 0.0, 0.0, 0.0), parent="base_link",
        parent_from_camera=Transform(translation=(0.3, 0.0, 0.5), rotation=(1.0, 0.0, 0.0, 0.0)),
    )  # fmt: skip
    said = [*recorder.on_info(info, START), *recorder.on_image(image(0.5), 2.0)]
    recording = Recording(tmp_path, "images", {})
    recording.write([Entry(topic, message, START) for topic, message in said])
    recording.close()
    with recording.path.open("rb") as file:
        found = {schema.name: (channel.topic, json.loads(schema.data), json.loads(message.data))
                 for schema, channel, message in make_reader(file).iter_messages()}  # fmt: skip
    assert found.keys() == FIELDS.keys()
    for name, (key, schema, message) in found.items():
        assert key.startswith("foxglove/camera/above/")
        assert set(schema["properties"]) == set(message) == FIELDS[name]
        assert schema["title"] == name
    picture = found["foxglove.CompressedImage"][2]
    assert base64.b64decode(picture["data"]) == b"\xff\xd8 jpeg"
    assert picture["timestamp"] == {"sec": START // SECOND, "nsec": SECOND // 2}
    lens = found["foxglove.CameraCalibration"][2]
    assert (lens["K"], lens["P"][:4], len(lens["P"])) == (list(k), [554.0, 0.0, 319.5, 0.0], 12)
    frame = found["foxglove.FrameTransform"][2]
    assert frame["child_frame_id"] == lens["frame_id"] == picture["frame_id"]
