"""Poses that show where a camera stands: chosen within sight, told what they cannot say, and judged on images."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.vision.boards import Sighting, TagBoard
from gemelo.libraries.vision.calibration.link_pose import LinkAt, link_pose
from gemelo.libraries.vision.calibration.mount import fit_mount
from gemelo.libraries.vision.calibration.poses import Belief, Chosen, choose_poses
from gemelo.libraries.vision.calibration.reprojection import BoardView, Carrier
from gemelo.libraries.vision.calibration.shots import one_of, without_hidden
from gemelo.libraries.vision.camera_model import of_field_of_view
from gemelo.libraries.vision.rigid import Array, from_transform, inverse, rigid, turn
from gemelo.libraries.vision.tag_pose import square
from gemelo.schemas.reasons import because
from gemelo.tools.bench.vision.mount_images import (
    Setup,
    Sight,
    Taken,
    board_on_tool,
    camera_on_link,
    limits_of,
    standing,
    tag_on_level_tool,
    take,
)
from gemelo.tools.bench.vision.mounting import looking, tool_error

MODEL = of_field_of_view(np.radians(66.0), 640, 480)
WAYS = {
    "camera on parol6's wrist": (camera_on_link, "parol6"),
    "board on parol6's tool": (board_on_tool, "parol6"),
    "tag on rm1's tool": (tag_on_level_tool, "rm1"),
}
POSES = dict(zip(WAYS, (10, 10, 15), strict=True))  # rm1's tool hides its tag in some


@cache
def setup_of(way: str) -> Setup:
    """With a camera that samples coarsely, for speed."""
    make, robot = WAYS[way]
    setup = make(load_arm(project_root() / "urdf" / robot))
    source = msgspec.structs.replace(setup.camera.source, samples=1)
    return replace(setup, camera=msgspec.structs.replace(setup.camera, source=source))


@cache
def taken(way: str) -> tuple[Sight, Taken]:
    sight = Sight(setup_of(way))
    return sight, take(sight, sight.setup.height if way.startswith("tag") else None, count=POSES[way])


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_a_link_is_where_the_kinematics_have_it(robot: str) -> None:
    arm = load_arm(project_root() / "urdf" / robot)
    kinematics, random = Kinematics(arm), np.random.default_rng(1)
    for joints in random.uniform(*limits_of(arm), (20, len(arm.joints))):
        for link, pose in kinematics.link_poses(joints).items():
            assert link_pose(arm, link)(joints) == pytest.approx(from_transform(pose), abs=1e-9)


@pytest.mark.parametrize("way", list(WAYS))
def test_chosen_poses_place_the_camera_within_half_a_millimetre(way: str) -> None:
    sight, found = taken(way)
    fit = fit_mount(found.views, sight.model, sight.setup.carrier, found.belief.height)
    assert fit.is_accepted, fit.faults
    assert tool_error(fit.parent_from_camera, sight.truth, sight.setup.carrier) < 0.5
    assert fit.held_out < 0.0005


@pytest.mark.parametrize("way", list(WAYS))
def test_chosen_poses_are_within_limits_apart_and_in_sight(way: str) -> None:
    sight, found = taken(way)
    lower, upper = limits_of(sight.setup.arm)
    may_stand = standing(sight.setup.arm)
    assert len(found.chosen.joints) == POSES[way]
    for joints, pose in zip(found.chosen.joints, found.chosen.camera_from_board, strict=True):
        assert (joints > lower).all()
        assert (joints < upper).all()
        assert may_stand(joints)
        assert found.belief.is_seen(pose)
    nearest, farthest = found.chosen.distances
    assert farthest > 1.2 * nearest
    turns = np.degrees(found.chosen.turns)
    if sight.setup.arm.name == "rm1":
        assert turns[1] < 0.01  # it turns its tool about one axis
    else:
        assert turns[1] > 10.0


def test_the_same_seed_chooses_the_same_poses_and_what_may_not_stand_is_not_among_them() -> None:
    sight, found = taken("board on parol6's tool")
    arm, at = sight.setup.arm, link_pose(sight.setup.arm, sight.setup.link)
    start, limits = np.array(sight.setup.start), limits_of(sight.setup.arm)

    def choose(seed: int, banned: Array | None = None) -> Chosen:
        def may_stand(joints: Array) -> bool:
            return banned is None or not np.array_equal(joints, banned)

        return choose_poses(found.belief, at, limits, start, may_stand, 5, seed)

    first = choose(1)
    assert all(np.array_equal(a, b) for a, b in zip(first.joints, choose(1).joints, strict=True))
    assert not np.array_equal(first.joints[0], choose(2).joints[0])
    without = choose(1, banned=first.joints[0]).joints
    assert len(without) == 5
    assert all(not np.array_equal(first.joints[0], joints) for joints in without)
    assert len(choose_poses(found.belief, at, limits, start, lambda joints: False, 5).joints) == 0
    assert arm.name == "parol6"


def test_an_arm_that_cannot_tilt_is_told_before_it_moves_what_is_to_be_measured() -> None:
    sight, found = taken("tag on rm1's tool")
    arm = sight.setup.arm
    chosen = choose_poses(
        replace(found.belief, height=None), link_pose(arm, sight.setup.link), limits_of(arm),
        np.array(sight.setup.start), lambda joints: True, 10,
    )  # fmt: skip
    height = because("measure.advice.height")
    parts = {"parts": ("camera height",), "last": "board on link height"}
    assert chosen.undetermined == (because("measure.undetermined.several", height, **parts),)
    fit = fit_mount(found.views, sight.model, Carrier.BOARD)
    assert fit.undetermined == chosen.undetermined
    assert fit.held_out == np.inf


def gantry(joints: Array) -> Array:
    """Three slides: what they carry never turns."""
    return rigid(np.eye(3), joints)


def table_of_four(joints: Array) -> Array:
    """Three slides and a turn about the vertical."""
    return rigid(turn(np.array([0.0, 0.0, joints[3]])), joints[:3])


@pytest.mark.parametrize(
    ("link_at", "start", "count"), [(gantry, (0.3, 0.0, 0.1), 3), (table_of_four, (0.3, 0.0, 0.1, 0.0), 1)]
)
def test_arms_of_too_few_axes_are_refused_by_name(link_at: LinkAt, start: tuple[float, ...], count: int) -> None:
    board = TagBoard(columns=1, rows=1, tag=0.05)
    camera = looking(np.array([0.45, 0.1, 0.65]), np.array([0.3, 0.0, 0.1]))
    carried = rigid(np.zeros(3), np.array([0.02, 0.01, 0.03]))
    belief = Belief(MODEL, Carrier.BOARD, camera, carried, board.points())
    limits = np.array([0.0, -0.3, 0.0, -2.0])[: len(start)], np.array([0.6, 0.3, 0.3, 2.0])[: len(start)]
    chosen = choose_poses(belief, link_at, limits, np.array(start), lambda joints: True, 10)
    assert len(chosen.joints) >= 8
    assert len(chosen.undetermined) == count
    assert {each.code for each in chosen.undetermined} == {"measure.undetermined.several"}
    advice = {each.causes[0].code for each in chosen.undetermined}
    if link_at is table_of_four:
        assert advice == {"measure.advice.height"}
        known = choose_poses(replace(belief, height=0.03), link_at, limits, np.array(start), lambda joints: True, 10)
        assert known.undetermined == ()
    else:
        assert "measure.advice.poses" in advice


@pytest.mark.parametrize("way", list(WAYS))
def test_tags_of_another_size_than_said_are_named(way: str) -> None:
    sight, found = taken(way)
    smaller = [
        replace(view, sighting=replace(view.sighting, points=view.sighting.points / 1.05)) for view in found.views
    ]
    fit = fit_mount(smaller, sight.model, sight.setup.carrier, found.belief.height)
    assert not fit.is_accepted
    assert fit.faults[0].code == "measure.scale.larger"
    assert fit.faults[0].values["percent"] == pytest.approx(5.0, abs=0.999)
    assert tool_error(fit.parent_from_camera, sight.truth, sight.setup.carrier) > 4.0  # why it is refused


@pytest.mark.parametrize("way", list(WAYS)[:2])
def test_a_pose_in_which_the_board_had_moved_is_named_and_left_out(way: str) -> None:
    sight, found = taken(way)
    setup, views, bumped = sight.setup, list(found.views), 4
    shift = rigid(np.zeros(3), np.array([0.004, 0.003, 0.0]))
    pose = views[bumped].base_from_link
    moved = setup.carrier_from_board @ shift
    motion = pose if setup.carrier is Carrier.BOARD else inverse(pose)
    camera_from_board = inverse(sight.truth) @ motion @ moved
    points = views[bumped].sighting.points
    pixels = sight.model.project(points @ camera_from_board[:3, :3].T + camera_from_board[:3, 3])
    views[bumped] = replace(views[bumped], sighting=Sighting(points, pixels, 0.05))
    fit = fit_mount(views, sight.model, setup.carrier)
    assert fit.outliers == (bumped,)
    assert fit.errors[bumped] > 0.002
    assert fit.is_accepted
    assert tool_error(fit.parent_from_camera, sight.truth, setup.carrier) < 0.5


BOARD = TagBoard()


def seen(shift: float = 0.0, sigma: float = 0.03, tags: int = 9) -> Sighting:
    """The board as it is seen from 0.4 m, `shift` [px] aside."""
    pose = rigid(turn(np.array([np.pi - 0.4, 0.2, 0.3])), np.array([0.0, 0.0, 0.4]))
    points = BOARD.points()[: 4 * tags]
    pixels = MODEL.project(points @ pose[:3, :3].T + pose[:3, 3])
    return Sighting(points, pixels + np.random.default_rng(1).normal(0.0, 0.02, pixels.shape) + shift, sigma)


@pytest.mark.parametrize(
    ("images", "sentence"),
    [
        ([seen(), None], "0 tags are seen, at least 4 are needed"),
        ([seen(), seen(tags=3)], "3 tags are seen, at least 4 are needed"),
        ([seen(), seen(sigma=0.4)], "blurred: its corners are known to .-0.40 px, at most 0.2"),
        ([seen(), seen(shift=1.0)], "the board moves in the image, by 1.4 px"),
    ],
)
def test_images_that_are_no_measurement_are_refused_by_name(images: list[Sighting | None], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        one_of(images, 16)


def test_images_of_a_board_that_stands_are_averaged_over_the_tags_that_all_show() -> None:
    mean = one_of([seen(), seen(shift=0.2, tags=6)], 16)
    assert len(mean.points) == 24
    assert mean.pixels == pytest.approx(seen().pixels[:24] + 0.1)


def test_a_tag_whose_corner_is_hidden_is_left_out_and_a_single_one_refused() -> None:
    whole = seen()
    pixels = whole.pixels.copy()
    pixels[9] += (1.2, 0.0)
    found = without_hidden(replace(whole, pixels=pixels), MODEL)
    assert len(found.points) == 32
    assert not any(np.array_equal(point, whole.points[9]) for point in found.points)
    assert len(without_hidden(whole, MODEL).points) == 36
    single = replace(whole, points=square(0.03), pixels=pixels[8:12])
    with pytest.raises(ValueError, match=r"px beside those of a square .* hides one of its edges"):
        without_hidden(single, MODEL)


def test_a_tag_with_a_covered_margin_is_not_measured() -> None:
    """In this pose the column of rm1's tool hides a part of the white around the tag, and none of its black."""
    sight, _ = taken("tag on rm1's tool")
    image = sight.image(np.array(sight.setup.start))
    board = sight.setup.board
    found = board.find(image, sight.model)
    assert found is not None
    corners = found.pixels
    outward = corners[1] - corners[0]
    across = np.array([-outward[1], outward[0]])
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    right = ((x - corners[1, 0]) * outward[0] + (y - corners[1, 1]) * outward[1]) / np.linalg.norm(outward)
    along = ((x - corners[1, 0]) * across[0] + (y - corners[1, 1]) * across[1]) / np.linalg.norm(across)
    covered = np.where((right > 1.0) & (np.abs(along) < 3 * np.linalg.norm(across)), np.uint8(120), image)
    hidden = board.find(covered, sight.model)
    assert hidden is None or len(hidden.points) == 0
    if hidden is not None:
        assert hidden.uneven == (200,)


def test_views_of_another_carrier_do_not_fit() -> None:
    """The board on the tool taken for a board on the table: refused, whatever is found."""
    sight, found = taken("board on parol6's tool")
    fit = fit_mount(
        [BoardView(view.base_from_link, view.sighting) for view in found.views], sight.model, Carrier.CAMERA
    )
    assert fit.faults or fit.held_out > 0.002
