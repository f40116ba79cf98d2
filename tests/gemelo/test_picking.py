"""The place of the jaws beside a thing, and their turn to it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gemelo import Lost, Refused
from gemelo.api.grasping import lift_above, looking_down, turn_between, yaw_of
from gemelo.api.picking import look_twice
from gemelo.api.seeing import Seen
from gemelo.api.units import Pose
from gemelo.libraries.arm.frames.transforms import from_axis_angle, rotate
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.cell import ColourThing, TagThing
from gemelo.schemas.grippers.kinds import Gripper

BEYOND = 0.016  # [m] rm1's jaws


@pytest.fixture
def gripper(rm1_folder: Path) -> Gripper:
    found = load_arm(rm1_folder).gripper
    assert found is not None
    return found


def seen(z: float) -> Seen:
    return Seen("thing", Pose((0.3, 0.0, z)), 1e-4, "tag", "overhead", 1, "")


def block(height: float, **fields: object) -> ColourThing:
    return ColourThing(name="thing", colour="red", box=(0.03, 0.03, height), **fields)  # type: ignore[arg-type]


def test_the_tool_stays_above_a_block_and_the_jaws_beside_it(gripper: Gripper) -> None:
    lift = lift_above(block(0.03), gripper, seen(0.015))
    tool = 0.015 + lift
    assert tool > 0.03
    assert tool - BEYOND < 0.03 - 0.004
    assert tool - BEYOND > 0.003


def test_a_grasp_point_near_the_top_of_a_high_thing_is_between_the_jaws(gripper: Gripper) -> None:
    cup = TagThing(name="thing", id=1, size=0.028, box=(0.036, 0.036, 0.1), grasp_offset=(0.0, 0.0, -0.006))
    lift = lift_above(cup, gripper, seen(0.1))
    assert 0.094 + lift - BEYOND < 0.094 < 0.094 + lift


def test_a_thing_that_is_too_flat_for_the_jaws_is_refused_with_both_lengths(gripper: Gripper) -> None:
    with pytest.raises(Refused, match="5 mm high: the jaws, 16 mm long") as refused:
        lift_above(block(0.005), gripper, seen(0.0025))
    assert refused.value.check == "grasp"


@pytest.mark.parametrize("yaw", [-2.0, 0.0, 0.4, 3.0])
def test_a_tool_that_looks_down_has_its_jaws_along_the_side_that_is_asked_for(yaw: float) -> None:
    turn = looking_down(yaw)
    assert rotate(turn, (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0))
    assert math.remainder(yaw_of(turn) - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    body = ((0.3, 0.0, 0.015), from_axis_angle((0.0, 0.0, 1.0), yaw))
    turned, side = turn_between(Pose((0.3, 0.0, 0.1), turn), body, (0.05, 0.02, 0.03))
    assert turned == pytest.approx(0.0, abs=1e-9)
    assert side == 0.02  # the jaws move along y of the thing


@pytest.mark.parametrize(
    ("askew", "turned", "side"), [(0.3, -0.3, 0.02), (1.2, math.pi / 2 - 1.2, 0.05), (-0.4, 0.4, 0.02)]
)
def test_jaws_turn_a_thing_by_the_way_to_its_nearest_side(askew: float, turned: float, side: float) -> None:
    body = ((0.3, 0.0, 0.015), from_axis_angle((0.0, 0.0, 1.0), askew))
    found = turn_between(Pose((0.3, 0.0, 0.1), looking_down(0.0)), body, (0.05, 0.02, 0.03))
    assert found == (pytest.approx(turned), side)


class Blinking:
    """Eyes to which the given errors happen first."""

    def __init__(self, *errors: Exception) -> None:
        self.errors = list(errors)

    def one(self, name: str, camera: str = "") -> Seen:
        if self.errors:
            raise self.errors.pop(0)
        return seen(0.015)


@pytest.mark.parametrize(
    "error", [Refused("late", check="camera"), Refused("it moves", check="moving"), Lost("no answer")]
)
def test_it_looks_once_more_where_no_image_was_of_use(error: Exception) -> None:
    assert look_twice(Blinking(error), "thing", "") == seen(0.015)  # type: ignore[arg-type]
    with pytest.raises(type(error)):
        look_twice(Blinking(error, error), "thing", "")  # type: ignore[arg-type]


def test_it_does_not_look_again_for_what_a_good_image_does_not_show() -> None:
    with pytest.raises(Refused, match="not seen"):
        look_twice(Blinking(Refused("not seen", check="detection")), "thing", "")  # type: ignore[arg-type]
