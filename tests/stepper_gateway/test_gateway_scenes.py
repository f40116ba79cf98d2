"""A trajectory that was planned in another scene than the newest is not followed."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.tools.virtual_arm.gateway_driver import PlannerInput, SceneInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

HOME, THERE = (0.0, 0.0, 0.0), (0.1, -0.2, 0.01)


def goal(
    version: int | None, delay: float = 0.0, rig: VirtualArm | None = None, epoch: int | None = None
) -> FollowJointTrajectoryGoal:
    """To be begun `delay` [s] from now on."""
    trajectory = move(HOME, THERE)
    if rig is not None:
        trajectory = replace(trajectory, stamp=rig.moment.unix + round(delay * 1e9))
    return FollowJointTrajectoryGoal(trajectory=trajectory, scene_version=version, scene_epoch=epoch)


def heard(*versions: int) -> VirtualArm:
    """A gateway that has been told these versions of a scene, in this order."""
    return told(*(SceneInput(version, 0) for version in versions))


def told(*scenes: SceneInput) -> VirtualArm:
    rig = VirtualArm().ready()
    for scene in scenes:
        rig.handle(scene)
    return rig


def test_a_plan_of_an_older_scene_is_refused_with_both_versions():
    rig = heard(3, 4)
    said = "planned in scene version 3, the scene is version 4 now: plan again"
    assert rig.goal(goal(3))[:3] == (False, FollowErrorCode.SCENE_CHANGED, said)
    assert rig.goal(goal(4)).accepted
    assert rig.finish()[0] is GoalStatusCode.SUCCEEDED


def test_the_scene_before_the_first_edit_is_one_too():
    rig = heard(0, 1)
    assert rig.goal(goal(0)).code is FollowErrorCode.SCENE_CHANGED


@pytest.mark.parametrize("versions", [(), (4,)])
def test_what_was_not_planned_in_a_scene_is_followed(versions: tuple[int, ...]):
    assert heard(*versions).goal(goal(None)).accepted


def test_a_gateway_that_knows_of_no_scene_refuses_none():
    assert heard().goal(goal(7)).accepted


def test_a_planner_that_starts_again_tells_its_scene_again_and_plans_stay_good():
    assert heard(4, 4).goal(goal(4)).accepted


def test_a_client_may_know_of_a_new_scene_sooner_than_the_gateway():
    rig = heard(4)
    assert rig.goal(goal(5)).accepted


def test_a_scene_that_went_back_makes_plans_of_the_later_one_bad():
    """A planner whose file was damaged begins again with nothing around the arm."""
    rig = told(SceneInput(4, 7), SceneInput(5, 7), SceneInput(0, 0))
    assert rig.goal(goal(5, epoch=7)).code is FollowErrorCode.SCENE_CHANGED
    assert rig.goal(goal(0, epoch=0)).accepted


def test_a_scene_that_has_grown_to_the_same_version_again_is_another():
    """After a lost file, and as many edits as before it."""
    rig = told(SceneInput(5, 7), SceneInput(0, 0), SceneInput(5, 8))
    verdict = rig.goal(goal(5, epoch=7))
    assert verdict.code is FollowErrorCode.SCENE_CHANGED
    assert "holds no more" in verdict.reason
    assert verdict.reason.endswith("plan again")
    assert rig.goal(goal(5, epoch=8)).accepted


@pytest.mark.parametrize("version", [-1, -(2**62), 2**31, 4 + 10_001])
def test_a_version_that_no_planner_gives_is_dropped_counted_and_said_once(version: int):
    rig = heard(4)
    for _ in range(3):
        rig.handle(SceneInput(version, 0))
    assert rig.core.scenes_dropped == 3
    assert rig.goal(goal(3)).code is FollowErrorCode.SCENE_CHANGED
    assert rig.goal(goal(4)).accepted
    assert rig.finish()[0] is GoalStatusCode.SUCCEEDED
    assert sum(str(version) in line for line in rig.log) == 1


def test_a_goal_that_waits_for_its_time_is_aborted_where_the_scene_changes_meanwhile():
    rig = heard(4)
    assert rig.goal(goal(4, delay=1.0, rig=rig)).accepted
    rig.run(0.5)
    rig.handle(SceneInput(5, 0))
    status, result = rig.finish()
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.SCENE_CHANGED)
    assert rig.position == HOME


def test_an_edit_does_not_stop_what_is_under_way():
    rig = heard(4)
    assert rig.goal(goal(4)).accepted
    rig.run(0.2)
    rig.handle(SceneInput(5, 0))
    assert rig.finish()[0] is GoalStatusCode.SUCCEEDED


OLDER, NEWER = "00000000000000000100.12.workshop", "00000000000000000200.34.office"


def alive(*instances: str) -> VirtualArm:
    """A gateway for which these planners live, and have published scene 4 of epochs 1, 2 ... in this order."""
    rig = VirtualArm().ready()
    for epoch, instance in enumerate(instances, 1):
        rig.handle(PlannerInput(instance, True))
        rig.handle(SceneInput(4, epoch, instance))
    return rig


@pytest.mark.parametrize("stranger", ["", OLDER, "00000000000000000300.56.nowhere"])
def test_a_scene_of_a_planner_that_does_not_live_changes_nothing_and_is_logged_once(stranger: str):
    rig = alive(NEWER)
    for version in (7, 8):
        rig.handle(SceneInput(version, 9, stranger))
    assert rig.goal(goal(8, epoch=9)).code is FollowErrorCode.SCENE_CHANGED
    assert rig.goal(goal(4, epoch=1)).accepted
    assert rig.finish()[0] is GoalStatusCode.SUCCEEDED
    assert rig.core.scenes_dropped == 2
    assert sum("the planner that lives is process 34 on office" in line for line in rig.log) == 1


def test_of_two_planners_that_live_no_plan_is_followed_until_one_has_ended():
    rig = alive(OLDER, NEWER)
    for epoch in (1, 2):
        verdict = rig.goal(goal(4, epoch=epoch))
        assert verdict.code is FollowErrorCode.SCENE_CHANGED
        assert "two planners live, process 12 on workshop and process 34 on office" in verdict.reason
    rig.handle(PlannerInput(OLDER, False))
    assert rig.goal(goal(4, epoch=1)).code is FollowErrorCode.SCENE_CHANGED
    assert rig.goal(goal(4, epoch=2)).accepted


def test_a_planner_beside_which_a_second_one_came_and_went_is_followed_again():
    rig = alive(OLDER, NEWER)
    rig.handle(PlannerInput(NEWER, False))
    assert rig.goal(goal(4, epoch=2)).code is FollowErrorCode.SCENE_CHANGED
    assert rig.goal(goal(4, epoch=1)).accepted


def test_a_planner_that_starts_and_gives_way_at_once_hinders_nothing():
    """A second node of a name declares its token for a moment, and publishes nothing."""
    rig = alive(OLDER)
    rig.handle(PlannerInput(NEWER, True))
    assert rig.goal(goal(4, epoch=1)).accepted


def test_a_scene_that_comes_before_its_planners_token_counts_once_that_is_there():
    rig = alive(OLDER)
    rig.handle(PlannerInput(OLDER, False))
    rig.handle(SceneInput(1, 2, NEWER))
    assert rig.goal(goal(1, epoch=2)).code is FollowErrorCode.SCENE_CHANGED
    rig.handle(PlannerInput(NEWER, True))
    assert rig.goal(goal(1, epoch=2)).accepted


def test_a_router_that_takes_all_tokens_with_it_leaves_the_scene_as_it_is():
    rig = alive(OLDER)
    rig.handle(PlannerInput(OLDER, False))
    assert rig.goal(goal(3, epoch=1)).code is FollowErrorCode.SCENE_CHANGED
    assert rig.goal(goal(4, epoch=1)).accepted


def test_scenes_of_many_strangers_do_not_push_out_that_of_the_living_planner():
    rig = alive(OLDER)
    for number in range(100):
        rig.handle(SceneInput(9, 9, f"{number:020d}.1.nowhere"))
    assert rig.goal(goal(4, epoch=1)).accepted
