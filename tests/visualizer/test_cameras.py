"""Cameras in the view: the newest image, outlines of what was found, and the frustum where the camera is."""

from __future__ import annotations

import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb

from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.detections import Detection, Detections
from gemelo.schemas.frames import Transform
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.cameras import CameraView
from gemelo.services.visualizer.content.updates import Frustum, Labels, Outlines, PictureUpdate
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.services.visualizer.render.layout import ArmLayout, blueprint
from gemelo.services.visualizer.render.sink import APPLICATION, Sink

NOW = 1_795_000_000_000_000_000
TENTH = 100_000_000
CUP = Detection(
    name="cup",
    corners=((10.0, 10.0), (20.0, 10.0), (20.0, 20.0), (10.0, 20.0)),
    base_from_thing=Transform(translation=(0.2, 0.1, 0.04)),
    is_located=True,
    sigma=0.0003,
)


def jpeg(level: int) -> bytes:
    return cv2.imencode(".jpg", np.full((48, 64, 3), level, np.uint8))[1].tobytes()


def info(parent: str = "base_link") -> CameraInfo:
    return CameraInfo(
        name="above", width=64, height=48, intrinsics=(60.0, 0.0, 31.5, 0.0, 60.0, 23.5, 0.0, 0.0, 1.0),
        parent=parent, parent_from_camera=Transform(translation=(0.3, 0.0, 0.5), rotation=(1.0, 0.0, 0.0, 0.0)),
    )  # fmt: skip


@pytest.fixture
def view(model) -> CameraView:
    return CameraView(model)


def test_of_many_images_the_newest_is_shown_five_times_a_second(view: CameraView) -> None:
    shown = []
    for step in range(10):
        for level in (step, step + 100):
            view.on_image(CameraImage(camera="above", data=jpeg(level)))
        shown += [(step, update) for update in view.take(NOW + step * TENTH)]
    assert [step for step, _ in shown] == [0, 2, 4, 6, 8]
    assert all(isinstance(update, PictureUpdate) and update.jpeg == jpeg(step + 100) for step, update in shown)


def test_a_camera_in_the_hand_has_its_frustum_on_the_link(view: CameraView, model) -> None:
    view.on_info(info("efector_link"))
    (frustum,) = view.take(NOW)
    assert isinstance(frustum, Frustum)
    assert frustum.entity == entities.camera_pose(model.paths["efector_link"], "above")
    assert view.take(NOW + TENTH) == []
    view.on_info(info("nowhere"))
    assert view.take(NOW + TENTH) == []


def test_what_was_found_is_outlined_and_has_a_dot_with_its_sigma_where_it_is_believed(view: CameraView) -> None:
    lost = Detection(name="tag 9", corners=CUP.corners)
    view.on_detections(Detections(camera="above", items=(CUP, lost)))
    outlines, dots = view.take(NOW)
    assert isinstance(outlines, Outlines)
    assert outlines.texts == ("cup ± 0.30 mm", "tag 9 ± 0.00 mm")
    assert outlines.strips[0].tolist() == [[10, 10], [20, 10], [20, 20], [10, 20], [10, 10]]
    assert isinstance(dots, Labels)
    assert (dots.texts, dots.points.tolist()) == (("cup ± 0.30 mm",), [[0.2, 0.1, 0.04]])
    view.on_detections(Detections(camera="above"))
    outlines, dots = view.take(NOW + TENTH)
    assert isinstance(outlines, Outlines)
    assert outlines.strips == ()


@pytest.mark.parametrize(
    "odd",
    [
        Detection(corners=((1.0,), (2.0, 3.0))), Detection(corners=((1e300, 0.0), (0.0, 0.0))),
        Detection(is_located=True, base_from_thing=Transform(translation=(1.0,))), Detection(),
    ],
)  # fmt: skip
def test_odd_detections_are_left_out(view: CameraView, odd: Detection) -> None:
    view.on_detections(Detections(camera="above", items=(odd,)))
    outlines, dots = view.take(NOW)
    assert isinstance(outlines, Outlines)
    assert isinstance(dots, Labels)
    assert (outlines.strips, dots.texts) == ((), ())


def test_a_new_viewer_is_told_everything_again(view: CameraView) -> None:
    view.on_info(info())
    view.on_image(CameraImage(camera="above", data=jpeg(1)))
    view.on_detections(Detections(camera="above", items=(CUP,)))
    assert len(view.take(NOW)) == 4
    view.restart()
    assert len(view.take(NOW + TENTH)) == 4


def test_image_outlines_frustum_and_dots_are_in_a_recording(model, tmp_path: Path) -> None:
    core = Visualizer(model, "rm1", "efector_link")
    core.cameras.on_info(info())
    core.cameras.on_image(CameraImage(camera="above", data=jpeg(1)))
    core.cameras.on_detections(Detections(camera="above", items=(CUP,)))
    path = tmp_path / "cameras.rrd"
    stream = rr.RecordingStream(APPLICATION, recording_id="cameras")
    stream.save(str(path))
    sink = Sink(stream, model, tmp_path, blueprint(ArmLayout(model, 20.0, 20.0, ("above",))))
    sink.write(core.step(NOW))
    core.cameras.on_detections(Detections(camera="above"))
    sink.write(core.step(NOW + TENTH))
    sink.close()
    printed = subprocess.run([rerun_binary(), "rrd", "print", path], capture_output=True, text=True, check=True).stdout
    frustum = entities.camera_pose(model.paths["base_link"], "above")
    for entity in (entities.camera_picture("above"), entities.found_in("above"), f"{frustum}/lens", frustum):
        assert f"/{entity} " in printed or f"/{entity}'" in printed or f"/{entity}" in printed.split(), entity


def test_every_camera_has_a_view_of_its_own_and_without_one_the_layout_is_as_ever(model) -> None:
    def origins(node: object) -> list[str]:
        if isinstance(node, rrb.Container):
            return [origin for inner in node.contents for origin in origins(inner)]
        return [str(getattr(node, "origin", ""))]

    with_cameras = origins(blueprint(ArmLayout(model, 20.0, 20.0, ("above", "hand"))).root_container)
    without = origins(blueprint(ArmLayout(model, 20.0, 20.0)).root_container)
    assert [each for each in with_cameras if each not in without] == ["cameras/above", "cameras/hand"]
