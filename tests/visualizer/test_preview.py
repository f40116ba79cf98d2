"""The planned motion, played by a translucent arm before the real one goes."""

from __future__ import annotations

import math

import pytest

from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.scene import PlanningScene, SceneObject, SphereShape
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.preview import REST, TIMES, PlanPreview
from gemelo.services.visualizer.content.updates import ClearEntity, Poses, SolidMesh, TranslucentArm
from gemelo.services.visualizer.core import Visualizer

NOW = 1_795_000_000_000_000_000
SECOND = 1_000_000_000
NAMES = ("efector_joint", "brazo_joint", "antebrazo_joint")  # not the arm's own order
PATH = PlannedPath(stamp=NOW, name=NAMES, positions=((0.0, 0.0, 0.0), (0.02, 1.0, -0.5)), times=(0.0, 2.0))


@pytest.fixture
def preview(model):
    preview = PlanPreview(model)
    preview.on_planned_path(PATH)
    return preview


def turn(updates, link: str) -> float:
    """[rad] of the joint above a link that turns about z."""
    [poses] = [update for update in updates if isinstance(update, Poses) and update.entity.endswith(f"/{link}")]
    return 2.0 * math.asin(poses.rotations[0, 2])


def test_a_plan_is_played_in_its_own_time_and_again(preview):
    first = preview.take(NOW)
    assert [update.entity for update in first if isinstance(update, TranslucentArm)] == [entities.PLANNED]
    assert turn(first, "brazo_link") == pytest.approx(0.0)
    half = preview.take(NOW + SECOND)
    assert not any(isinstance(update, TranslucentArm) for update in half)
    assert turn(half, "brazo_link") == pytest.approx(0.5)
    assert turn(half, "antebrazo_link") == pytest.approx(-0.25)
    assert turn(preview.take(NOW + int(2.5 * SECOND)), "brazo_link") == pytest.approx(1.0)
    assert turn(preview.take(NOW + int((3.0 + REST) * SECOND)), "brazo_link") == pytest.approx(0.5)


def test_it_ends_after_some_times(preview):
    preview.take(NOW)
    after = NOW + int(TIMES * (2.0 + REST) * SECOND) + 1
    preview.take(after)
    assert [type(update) for update in preview.take(after + 1)] == [ClearEntity]
    assert preview.take(after + 2) == []


def test_it_ends_when_the_arm_goes(preview):
    preview.take(NOW)
    preview.on_joint_state(JointState(name=NAMES, velocity=(0.0, 0.0, 0.0)))
    assert any(isinstance(update, Poses) for update in preview.take(NOW + 1))
    preview.on_joint_state(JointState(name=NAMES, velocity=(0.0, 0.1, 0.0)))
    assert [type(update) for update in preview.take(NOW + 2)] == [ClearEntity]


def test_a_new_viewer_gets_the_arm_again(preview):
    preview.take(NOW)
    preview.restart()
    assert any(isinstance(update, TranslucentArm) for update in preview.take(NOW + 1))


@pytest.mark.parametrize(
    "path",
    [
        PlannedPath(points=((0.0, 0.0, 0.0),)),
        PlannedPath(name=("other",), positions=((0.0,), (1.0,)), times=(0.0, 1.0)),
        PlannedPath(name=NAMES, positions=((0.0,), (1.0,)), times=(0.0, 1.0)),
        PlannedPath(name=NAMES, positions=((0.0, 0.0, 0.0),), times=(0.0,)),
    ],
)
def test_a_path_without_a_motion_is_not_played(model, path):
    preview = PlanPreview(model)
    preview.on_planned_path(path)
    assert preview.take(NOW) == []


def test_the_arm_that_plays_the_plan_carries_what_the_real_one_does(model):
    core = Visualizer(model, "rm1", "efector_link")
    cup = SceneObject(name="cup", shape=SphereShape(radius=0.02), frame="efector_link", attached=True)
    core.scene.on_scene(PlanningScene(objects=(cup,)))
    core.on_planned_path(PATH)
    hands = [update.entity for update in core.step(NOW) if isinstance(update, SolidMesh)]
    assert sorted(hand.split("/")[1] for hand in hands) == ["measured", "planned"]
    assert all(hand.endswith("efector_link/carried/cup") for hand in hands)
