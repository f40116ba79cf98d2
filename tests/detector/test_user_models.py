"""Things by a model of the user's own: read, run and placed on the table; and what is no such model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.vision.camera_model import model_of
from gemelo.libraries.vision.rigid import from_transform, inverse
from gemelo.schemas.cell import ColourThing, OnnxThing
from gemelo.schemas.detections import DetectionKind
from gemelo.services.detector.core import Detector
from gemelo.services.detector.main import read_models
from gemelo.services.detector.user_models import BadModel, Found, UserModel, projected_box, standing, without_doubles
from tests.detector.onnx_file import red_finder
from tests.detector.test_detector_core import Table, changed, names, off

SIZE = 320  # [px]


@pytest.fixture
def model(tmp_path: Path) -> UserModel:
    return UserModel(red_finder(tmp_path / "red.onnx", SIZE), SIZE)


def thing(path: Path, **fields: object) -> OnnxThing:
    return OnnxThing(name="red_block", model=str(path), label=0, box=(0.03, 0.03, 0.03), input=SIZE, **fields)


@pytest.fixture
def table(rm1_folder: Path) -> Table:
    """rm1's, with nothing red on it but the block."""
    return Table(load_arm(rm1_folder))


def looking(table: Table, wanted: OnnxThing, warn=print) -> Detector:
    kept = [each for each in table.cell.things if not isinstance(each, ColourThing)]
    cell = changed(table.cell, things=(*kept, wanted))
    return Detector(cell, read_models(cell, warn))


def test_a_class_of_the_users_model_has_a_place_on_the_table(table: Table, tmp_path: Path) -> None:
    table.detector = looking(table, thing(red_finder(tmp_path / "red.onnx", SIZE)))
    found = table.look()
    assert "red_block" in names(found)
    (item,) = [each for each in found.items if each.name == "red_block"]
    assert item.kind is DetectionKind.ONNX
    assert item.is_located
    assert off(item, table.truth()["red_block"]) < max(3.0 * item.sigma, 0.004)
    assert 5e-4 < item.sigma < 5e-3
    middle = np.mean(item.corners, axis=0)
    outline = np.mean(table.truth()["red_block"].corners, axis=0)
    assert np.linalg.norm(middle - outline) < 6.0


@pytest.mark.parametrize(
    "wanted", [{"label": 1}, {"threshold": 0.9999}, {"box": (0.1, 0.1, 0.1)}, {"box": (0.012, 0.012, 0.012)}]
)
def test_another_class_a_low_score_and_another_size_are_left_out(
    table: Table, tmp_path: Path, wanted: dict[str, object]
) -> None:
    table.detector = looking(table, replace(thing(red_finder(tmp_path / "red.onnx", SIZE)), **wanted))
    assert "red_block" not in names(table.look())


def test_without_red_nothing_is_found(model: UserModel) -> None:
    assert not model.look(np.full((480, 640, 3), 90, np.uint8), 0.1)


def test_a_box_is_in_pixels_of_the_image_it_was_found_in(model: UserModel) -> None:
    image = np.full((480, 640, 3), 90, np.uint8)
    image[100:160, 400:480] = (220, 30, 30)
    (found,) = model.look(image, 0.5)
    assert found.sides == pytest.approx([399.5, 99.5, 479.5, 159.5], abs=2.5)
    assert found.label == 0


def test_what_is_no_model_is_named_and_the_others_are_looked_for(table: Table, tmp_path: Path) -> None:
    (tmp_path / "bad.onnx").write_bytes(b"no model")
    said: list[str] = []
    table.detector = looking(table, thing(tmp_path / "bad.onnx"), said.append)
    assert "cup" in names(table.look())
    assert "red_block" not in names(table.look())
    assert 'thing "red_block" is not looked for' in said[0]
    with pytest.raises(BadModel) as refused:
        UserModel(tmp_path / "bad.onnx", SIZE)
    (why,) = refused.value.reason.causes
    assert [why.code, *(each.code for each in why.causes)] == ["model.not_onnx", "model.onnx.field"]
    assert "cannot be read by OpenCV" in said[0]


@pytest.mark.parametrize(
    ("size", "model", "code", "values", "sentence"),
    [
        (64, {}, "model.other_size", {"edge": SIZE, "size": 64}, "320 x 320 pixels, not 64: write `input = 320`"),
        (SIZE, {"layout": "turned"}, "model.layout", {"shape": "(1, 100, 5)"}, "a layout of YOLO"),
        (SIZE, {"said": (0, 3, 0, 0)}, "model.unreadable", {}, "leaves the size .* open.*`dynamic=False imgsz=320`"),
        (SIZE, {"said": (1, 1, SIZE, SIZE)}, "model.channels", {"channels": 1}, "images of 1 channels"),
        (
            SIZE,
            {"said": (1, 3, SIZE, 640)},
            "model.not_square",
            {"width": 640, "height": SIZE},
            "640 x 320 pixels: exp",
        ),
        (SIZE, {"said": (1, 512)}, "model.dimensions", {"count": 2}, "an input of 2 dimensions"),
        (SIZE, {"names": "{0: 'red', 1: 'blue'}"}, "model.task", {"scores": 1, "classes": 2}, "names 2 classes: one"),
        (SIZE, {"gain": -1e5}, "model.scores", {}, "scores from -0.* to 0: those of YOLO are from 0 to 1"),
    ],
)
def test_what_a_model_is_not_fit_for_is_said_with_the_remedy(
    tmp_path: Path, size: int, model: dict[str, Any], code: str, values: dict[str, Any], sentence: str
) -> None:
    path = red_finder(tmp_path / "red.onnx", SIZE, **model)
    with pytest.raises(BadModel, match=sentence) as refused:
        UserModel(path, size)
    reason = refused.value.reason
    assert reason.code == code
    assert reason.values["file"] == str(path)
    assert {name: reason.values[name] for name in values} == values


def test_a_thing_may_name_its_class_where_the_model_says_the_names(table: Table, tmp_path: Path) -> None:
    path = red_finder(tmp_path / "red.onnx", SIZE, names="{0: 'red block'}")
    table.detector = looking(table, replace(thing(path), label="red block"))
    assert "red_block" in names(table.look())


@pytest.mark.parametrize(
    ("said", "label", "code", "sentence"),
    [
        ("{0: 'red block'}", "red", "model.class.name", 'no class "red"; it has 0 red block'),
        ("{0: 'red block'}", 3, "model.class.number", "no class 3; it has 0 red block"),
        ("", 3, "model.class.beyond", "no class 3; it has 1, counted from 0"),
        ("", "red", "model.class.unnamed", 'does not say the names of its classes: write the number for "red"'),
    ],
)
def test_a_class_that_the_model_does_not_have_is_refused_and_the_others_are_looked_for(
    table: Table, tmp_path: Path, said: str, label: int | str, code: str, sentence: str
) -> None:
    told: list[str] = []
    wanted = replace(thing(red_finder(tmp_path / "red.onnx", SIZE, names=said)), label=label)
    with pytest.raises(BadModel) as refused:
        UserModel(tmp_path / "red.onnx", SIZE).number_of(label)
    assert refused.value.reason.code == code
    table.detector = looking(table, wanted, told.append)
    assert sentence in told[0]
    assert "red_block" not in names(table.look())
    assert "cup" in names(table.look())


def test_doubles_of_a_class_are_one_and_classes_stay_apart() -> None:
    sides = np.array([[10.0, 10.0, 50.0, 50.0], [12.0, 11.0, 51.0, 52.0], [200.0, 10.0, 240.0, 50.0]])
    scores = np.array([[0.9, 0.0], [0.8, 0.0], [0.7, 0.0]])
    assert [each.score for each in without_doubles(sides, scores, 0.5)] == [0.9, 0.7]
    scores[1] = (0.0, 0.8)
    assert sorted(each.score for each in without_doubles(sides, scores, 0.5)) == [0.7, 0.8, 0.9]
    assert not without_doubles(sides, scores, 0.95)


@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.2])
def test_a_long_thing_is_placed_whatever_its_turn(table: Table, yaw: float) -> None:
    lens, size = model_of(table.exact), (0.06, 0.02, 0.03)
    plane = inverse(from_transform(table.exact.parent_from_camera))
    sides = projected_box(np.array([0.28, 0.1, yaw]), lens, plane, size)
    place = standing(Found(0, 0.9, sides), lens, plane, size)
    assert place is not None
    assert place.plane_from_box[:2, 3] == pytest.approx([0.28, 0.1], abs=1.5e-3)
    assert standing(Found(0, 0.9, np.array([5.0, 5.0, 5.2, 9.0])), lens, plane, size) is None
