"""Detections in images of the virtual camera, against the true poses of the things."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.cell.camera_model import believed_info, exact_info
from gemelo.libraries.arm.cell.cell_file import Cell, load_cell
from gemelo.libraries.arm.cell.colours import RGB, nearest_colour
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.vision.rigid import Array, from_transform
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.cell import BoxThing, Colour, ColourThing, VirtualSource
from gemelo.schemas.detections import Detection, Detections
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import because
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera, true_detections
from gemelo.services.camera.virtual.world import CameraWorld
from gemelo.services.detector.core import Detector
from gemelo.services.detector.images import NoPicture

ON_PLANE, OF_BOX = 0.1e-3, 0.5e-3  # [m]


@pytest.fixture(params=["rm1", "parol6"])
def arm(request: pytest.FixtureRequest, rm1_folder: Path) -> ArmDescription:
    return load_arm(rm1_folder.parent / request.param)


@pytest.fixture
def rm1(rm1_folder: Path) -> ArmDescription:
    return load_arm(rm1_folder)


class Table:
    """A cell with its world, its camera and its detector."""

    def __init__(self, arm: ArmDescription, cell: Cell | None = None, believed: Cell | None = None) -> None:
        """`believed`: what the detector is told, where that is not the truth."""
        self.cell = cell or load_cell(arm.folder / "cell.toml", arm)
        self.world = CameraWorld(arm, self.cell)
        values = arm.named_states["ready"]
        self.world.on_joint_state(JointState(stamp=1, name=arm.joint_names, position=values))
        record = self.cell.camera("overhead")
        assert isinstance(record.source, VirtualSource)
        self.exact = exact_info(record, arm.base_frame)
        self.camera = VirtualCamera(record, record.source, self.exact, self.world.snapshot)
        told = believed or self.cell
        self.info = believed_info(told, told.camera("overhead"), arm.base_frame)
        self.detector = Detector(told)

    def image(self) -> np.ndarray:
        return self.camera.image(self.world.snapshot())

    def look(self, image: np.ndarray | None = None, where: Array | str | None = "known") -> Detections:
        place = from_transform(self.info.parent_from_camera) if isinstance(where, str) else where
        return self.detector.look(self.image() if image is None else image, self.info, place, 7)

    def truth(self) -> dict[str, Detection]:
        things = {thing.name: thing for thing in self.cell.things}
        return {item.name: item for item in true_detections(self.world.snapshot(), self.exact, things).items}


def off(item: Detection, truth: Detection) -> float:
    """[m]"""
    return float(np.linalg.norm(np.subtract(item.base_from_thing.translation, truth.base_from_thing.translation)))


def names(found: Detections) -> list[str]:
    return sorted(item.name for item in found.items)


def changed(cell: Cell, **fields: object) -> Cell:
    return Cell(**{name: getattr(cell, name) for name in Cell.__dataclass_fields__} | fields)


def test_every_thing_of_the_sample_cells_is_found_where_it_is(arm: ArmDescription) -> None:
    table = Table(arm)
    found, truth = table.look(), table.truth()
    assert {thing.name for thing in table.cell.things} <= set(names(found))
    assert found.doubt == ""
    for item in found.items:
        if item.name in truth:
            assert off(item, truth[item.name]) < (ON_PLANE if item.kind == "tag" else OF_BOX), item
            assert off(item, truth[item.name]) < 4.0 * item.sigma
            assert item.is_located


def test_a_tag_that_does_not_lie_is_measured_in_space(rm1: ArmDescription) -> None:
    """At one place the virtual camera's coarse samples are the error, so it is asked at many."""
    table, random, errors = Table(rm1), np.random.default_rng(1), []
    table.world.on_joint_state(JointState(stamp=1, name=rm1.joint_names, position=rm1.named_states["folded"]))
    for _ in range(30):
        tilted = from_rpy(random.uniform(-0.35, 0.35), random.uniform(-0.35, 0.35), random.uniform(-3.0, 3.0))
        table.world.put("cup", ((random.uniform(0.22, 0.32), random.uniform(-0.15, 0.15), 0.09), tilted))
        for cup in (item for item in table.look().items if item.name == "cup"):
            errors.append(off(cup, table.truth()["cup"]))
            assert errors[-1] < 4.0 * cup.sigma
            assert cup.sigma > ON_PLANE  # it is less sure than on a plane
    assert len(errors) > 25
    assert np.median(errors) < 0.6e-3


def test_where_the_camera_stands_is_not_known_only_tags_are_found_and_in_its_own_frame(rm1: ArmDescription) -> None:
    table = Table(rm1)
    found = table.look(where=None)
    assert {"cup", "tag 100"} <= set(names(found))
    assert not any(item.is_located or item.kind == "colour" for item in found.items)
    (cup,) = [item for item in found.items if item.name == "cup"]
    away = np.subtract(cup.camera_from_thing.translation, table.truth()["cup"].camera_from_thing.translation)
    assert np.linalg.norm(away) < 4.0 * cup.sigma < 4e-3


def test_a_camera_that_was_moved_is_noticed_by_the_fixed_tags(rm1: ArmDescription) -> None:
    cell = load_cell(rm1.folder / "cell.toml", rm1)
    camera = cell.camera("overhead")
    moved = replace(
        camera,
        position=(camera.position[0] + 0.01, *camera.position[1:]),
        look_at=(camera.look_at[0] + 0.01, *camera.look_at[1:]),
    )
    found = Table(rm1, changed(cell, cameras=(moved,)), believed=cell).look()
    assert "tag 10" in found.doubt
    assert "moved" in found.doubt
    assert found.doubt_why is not None
    assert (found.doubt_why.code, str(found.doubt_why)) == ("detect.tag_moved", found.doubt)


def test_a_wrong_tag_size_is_noticed_by_the_fixed_tags(rm1: ArmDescription) -> None:
    cell = load_cell(rm1.folder / "cell.toml", rm1)
    wrong = tuple(replace(tag, size=0.05) for tag in cell.tags)
    assert "mm away from its place" in Table(rm1, cell, believed=changed(cell, tags=wrong)).look().doubt


def test_two_tags_of_one_number_are_both_told(rm1: ArmDescription) -> None:
    table = Table(rm1)
    image = table.image().copy()
    corners = np.array(table.truth()["cup"].corners)
    (left, top), (right, bottom) = corners.min(axis=0).astype(int) - 8, corners.max(axis=0).astype(int) + 9
    patch = image[top:bottom, left:right].copy()
    image[30 : 30 + patch.shape[0], 300 : 300 + patch.shape[1]] = patch
    assert names(table.look(image)).count("cup") == 2


@pytest.mark.parametrize("share", [0.0, 0.02])
def test_in_the_dark_nothing_is_found(rm1: ArmDescription, share: float) -> None:
    table = Table(rm1)
    assert table.look((table.image() * share).astype(np.uint8)).items == ()


def test_glare_on_a_tag_hides_it_and_moves_nothing_else(rm1: ArmDescription) -> None:
    table = Table(rm1)
    image = table.image().copy()
    middle = np.array(table.truth()["cup"].corners).mean(axis=0)
    cv2.circle(image, (int(middle[0]), int(middle[1])), 16, (255, 255, 255), -1)
    found = table.look(image)
    assert "cup" not in names(found)
    assert {"red_block", "blue_block", "tray"} <= set(names(found))


def test_a_block_that_is_half_hidden_is_not_told_to_be_elsewhere(rm1: ArmDescription) -> None:
    table = Table(rm1)
    image = table.image().copy()
    corners = np.array(table.truth()["red_block"].corners)
    middle = corners.mean(axis=0).astype(int)
    image[middle[1] - 30 : middle[1] + 30, middle[0] : middle[0] + 40] = (158, 150, 138)
    for item in table.look(image).items:
        assert item.name != "red_block" or off(item, table.truth()["red_block"]) < 2e-3


def test_a_block_behind_a_post_is_told_to_be_unclear_with_its_place_in_the_image_and_why(rm1: ArmDescription) -> None:
    """Half of it is seen: too little to measure, and too much to say that nothing is there."""
    table = Table(rm1)
    corners = np.array(table.truth()["red_block"].corners)
    middle = corners.mean(axis=0).astype(int)
    image = table.image().copy()
    image[middle[1] - 60 : middle[1] + 60, middle[0] : middle[0] + 60] = (128, 134, 142)
    found = table.look(image)
    assert "red_block" not in names(found)
    (unclear,) = found.unclear
    assert "red_block" in unclear.names
    assert "something red is seen" in unclear.reason
    around = np.array(unclear.corners)
    assert (around.min(axis=0) < middle + 2).all()
    assert (around.max(axis=0) > middle - 2).all()
    assert table.look().unclear == ()


@pytest.mark.parametrize("colour", list(Colour))
def test_one_colour_is_not_taken_for_another(rm1: ArmDescription, colour: Colour) -> None:
    cell = load_cell(rm1.folder / "cell.toml", rm1)
    things = tuple(
        ColourThing(name=each.value, colour=each, box=(0.03, 0.03, 0.03), position=(0.3, -0.12, 0.015))
        for each in Colour
    )
    only = tuple(thing for thing in things if thing.colour is colour)
    found = Table(rm1, changed(cell, things=only), believed=changed(cell, things=things)).look()
    assert [name for name in names(found) if name in list(Colour)] == [colour.value]
    assert nearest_colour(RGB[colour]) is colour


def test_a_box_is_found_by_standing_out_from_the_table_and_is_no_tagged_or_coloured_one(rm1: ArmDescription) -> None:
    cell = load_cell(rm1.folder / "cell.toml", rm1)
    wood = BoxThing(name="wood", box=(0.05, 0.03, 0.025), position=(0.36, 0.14, 0.0125), yaw=0.7)
    table = Table(rm1, changed(cell, things=(*cell.things, wood)))
    found = table.look()
    assert names(found).count("wood") == 1
    (item,) = [each for each in found.items if each.name == "wood"]
    assert off(item, table.truth()["wood"]) < OF_BOX


@pytest.mark.parametrize("box", [(0.03, 0.026, 0.03), (0.026, 0.03, 0.03), (0.04, 0.02, 0.03), (0.03, 0.03, 0.03)])
def test_a_block_is_found_however_it_is_turned(rm1: ArmDescription, box: tuple[float, float, float]) -> None:
    """Of nearly equal sides too: which is which must not be guessed from the region alone."""
    random = np.random.default_rng(5)
    cell = load_cell(rm1.folder / "cell.toml", rm1)
    block = next(thing for thing in cell.things if thing.name == "red_block")
    table = Table(rm1, changed(cell, things=(replace(block, box=box),), places=()))
    table.world.on_joint_state(JointState(stamp=1, name=rm1.joint_names, position=rm1.named_states["folded"]))
    for _ in range(12):
        radius, angle, yaw = random.uniform(0.2, 0.34), random.uniform(-1.0, 1.0), random.uniform(-np.pi, np.pi)
        place = (radius * np.cos(angle), radius * np.sin(angle), box[2] / 2.0)
        table.world.put("red_block", (place, from_rpy(0.0, 0.0, yaw)))
        found = {item.name: item for item in table.look().items}
        assert "red_block" in found, (place, yaw)
        assert off(found["red_block"], table.truth()["red_block"]) < OF_BOX


def test_an_image_of_another_size_is_refused_with_both_sizes(rm1: ArmDescription) -> None:
    table = Table(rm1)
    with pytest.raises(NoPicture, match="its image is 320 x 240, not 640 x 480 pixels") as refused:
        table.look(cv2.resize(table.image(), (320, 240)))
    assert refused.value.reason == because(
        "detect.image.size", camera="overhead", width=320, height=240, wanted_width=640, wanted_height=480
    )


def test_a_camera_without_a_lens_is_refused(rm1: ArmDescription) -> None:
    table = Table(rm1)
    table.info = CameraInfo(name="overhead", width=640, height=480)
    with pytest.raises(ValueError, match="9"):
        table.look()


def test_a_thing_that_is_not_on_the_table_is_not_found(rm1: ArmDescription) -> None:
    cell = load_cell(rm1.folder / "cell.toml", rm1)
    empty = changed(cell, things=tuple(replace(thing, position=None) for thing in cell.things))
    found = Table(rm1, empty, believed=cell).look()
    assert not {thing.name for thing in cell.things} & set(names(found))
