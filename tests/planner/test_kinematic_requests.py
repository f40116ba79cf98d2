"""The requests ik and fk: inverse to one another, ordered, distinct, free, or refused with a reason."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    FkRequest,
    IkRequest,
    IkResponse,
    PlanCode,
    PoseGoal,
    ValidityRequest,
    ValidityResponse,
)
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.kinematic_requests import KinematicRequests
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER
from tests.profiles import examples

ROOT = Path(__file__).parents[2] / "urdf"
RM1, PAROL6 = load_arm(ROOT / "rm1"), load_arm(ROOT / "parol6")
ARMS = {"rm1": RM1, "parol6": PAROL6}
SERVED = {name: KinematicRequests(arm) for name, arm in ARMS.items()}
PRESENT = {name: JointState(name=arm.joint_names, position=arm.named_states["ready"]) for name, arm in ARMS.items()}
BOTH_ELBOWS = PoseGoal(position=(0.25, 0.15, 0.1))


def ik(name: str, request: IkRequest, age: float = 0.0) -> IkResponse:
    return SERVED[name].ik(request, PRESENT[name], age)


@pytest.mark.parametrize("name", ARMS)
@examples(quick=10, full=25)
@given(where=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6))
def test_ik_of_fk_leads_back_to_the_pose(name: str, where: list[float]):
    arm, served = ARMS[name], SERVED[name]
    configuration = tuple(j.lower + share * (j.upper - j.lower) for j, share in zip(arm.joints, where, strict=False))
    [pose] = served.fk(FkRequest(name=arm.joint_names, position=configuration), None).poses
    goal = PoseGoal(position=pose.translation, orientation=pose.rotation)
    response = ik(name, IkRequest(goal=goal, avoid_collisions=False, solutions=8))
    assert response.code is PlanCode.SUCCESS
    assert response.name == arm.joint_names
    for solution in response.solutions:
        assert all(joint.is_within(value) for joint, value in zip(arm.joints, solution.position, strict=True))
        [back] = served.fk(FkRequest(name=arm.joint_names, position=solution.position), None).poses
        assert np.allclose(back.translation, pose.translation, atol=1e-6)
        assert abs(np.dot(back.rotation, pose.rotation)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("near", [(-0.5, 1.8, 0.08), (1.5, -1.8, 0.08)])
def test_the_solution_nearest_to_the_given_configuration_comes_first(near: tuple[float, ...]):
    start = JointState(name=RM1.joint_names, position=near)
    response = ik("rm1", IkRequest(goal=BOTH_ELBOWS, near=start, solutions=8, avoid_collisions=False))
    distances = [solution.distance for solution in response.solutions]
    assert len(distances) == 2
    assert distances == sorted(distances)
    first = response.solutions[0].position
    slowest = max(abs(a - b) / j.velocity for a, b, j in zip(first, near, RM1.joints, strict=True))
    assert distances[0] == pytest.approx(slowest)


@pytest.mark.parametrize("name", ARMS)
def test_no_more_solutions_than_asked_for_and_all_of_them_distinct(name: str):
    goal = PoseGoal(position=(0.25, 0.05, 0.15))
    for count in (1, 2, 8):
        solutions = ik(name, IkRequest(goal=goal, solutions=count, avoid_collisions=False)).solutions
        assert 1 <= len(solutions) <= count
        for index, one in enumerate(solutions):
            assert all(np.abs(np.subtract(one.position, other.position)).max() > 1e-4 for other in solutions[:index])


def test_one_solution_is_the_nearest_of_all():
    goal = PoseGoal(position=(0.25, 0.05, 0.15))
    one = ik("rm1", IkRequest(goal=goal)).solutions[0]
    assert one == ik("rm1", IkRequest(goal=goal, solutions=8)).solutions[0]


def test_a_redundant_arm_uses_its_freedom_to_stay_away_from_its_limits():
    kinematics = Kinematics(PAROL6)
    place = kinematics.tool(PAROL6.named_states["ready"]).position
    lower, upper = np.array([(joint.lower, joint.upper) for joint in PAROL6.joints]).T

    def eccentricity(configuration: tuple[float, ...] | np.ndarray) -> float:
        return float(np.sum(((configuration - 0.5 * (lower + upper)) / (0.5 * (upper - lower))) ** 2))

    corner = JointState(name=PAROL6.joint_names, position=tuple(lower.tolist()))
    request = IkRequest(
        goal=PoseGoal(position=tuple(place.tolist())), near=corner, solutions=64, avoid_collisions=False
    )
    most_central = min(eccentricity(np.array(each.position)) for each in ik("parol6", request).solutions)
    plain = InverseKinematics(PAROL6, kinematics).nearest(ToolTarget(place), lower, NEVER)
    assert most_central <= min(eccentricity(configuration) for configuration in plain)


def test_configurations_that_touch_are_left_out_unless_asked_for():
    kinematics = Kinematics(PAROL6)
    goal = PoseGoal(position=(0.1, 0.0, 0.1))
    every = ik("parol6", IkRequest(goal=goal, solutions=8, avoid_collisions=False)).solutions
    expected = [each for each in every if kinematics.collisions.distance(each.position) > CLEARANCE]
    assert 0 < len(expected) < len(every)
    assert ik("parol6", IkRequest(goal=goal, solutions=8)).solutions == tuple(expected)


def test_a_pose_at_which_every_configuration_touches_is_refused_with_the_pair():
    pose = Kinematics(RM1).tool((0.3, 2.95, 0.05))
    response = ik("rm1", IkRequest(goal=PoseGoal(position=tuple(pose.position.tolist())), solutions=8))
    assert response.code is PlanCode.GOAL_IN_COLLISION
    assert response.refusal is not None
    assert response.refusal.subject == "base_link / efector_link"


def test_that_the_arm_moves_does_not_matter_but_where_it_is_must_be_known():
    moving = JointState(name=RM1.joint_names, position=(0.0, 0.0, 0.0), velocity=(1.0, 1.0, 0.01))
    assert SERVED["rm1"].ik(IkRequest(goal=BOTH_ELBOWS), moving).code is PlanCode.SUCCESS
    assert SERVED["rm1"].ik(IkRequest(goal=BOTH_ELBOWS), None).code is PlanCode.ROBOT_STATE_STALE
    assert ik("rm1", IkRequest(goal=BOTH_ELBOWS), age=9.0).code is PlanCode.ROBOT_STATE_STALE
    start = JointState(name=RM1.joint_names, position=(0.0, 0.0, 0.0))
    assert SERVED["rm1"].ik(IkRequest(goal=BOTH_ELBOWS, near=start), None).code is PlanCode.SUCCESS


@pytest.mark.parametrize("count", [0, -1, 65])
def test_a_count_that_cannot_be_is_refused(count: int):
    response = ik("rm1", IkRequest(goal=BOTH_ELBOWS, solutions=count))
    assert response.refusal is not None
    assert response.refusal.message == f"{count} solutions cannot be asked for"


def test_out_of_reach_is_refused_with_the_nearest_point():
    response = ik("rm1", IkRequest(goal=PoseGoal(position=(0.6, 0.0, 0.1))))
    assert response.code is PlanCode.NO_IK_SOLUTION
    assert response.refusal is not None
    assert response.refusal.nearest == pytest.approx((0.4063, 0.0, 0.1), abs=1e-3)


def test_fk_takes_the_joints_that_are_not_named_from_where_they_are():
    served = SERVED["rm1"]
    some = served.fk(FkRequest(name=("efector_joint",), position=(0.1,)), PRESENT["rm1"])
    configuration = (*PRESENT["rm1"].position[:2], 0.1)
    assert some == served.fk(FkRequest(name=RM1.joint_names, position=configuration), None)
    assert some.links == (RM1.tool_frame,)


def test_fk_gives_the_links_that_are_asked_for_in_their_order():
    links = ("efector_link", "base_link", "brazo_link")
    response = SERVED["rm1"].fk(FkRequest(links=links), PRESENT["rm1"])
    assert response.links == links
    poses = Kinematics(RM1).link_poses(PRESENT["rm1"].position)
    assert response.poses == tuple(poses[link] for link in links)


@pytest.mark.parametrize(
    ("request_", "code", "said"),
    [
        (FkRequest(links=("efector",)), PlanCode.FRAME_TRANSFORM_FAILURE, 'rm1 has no link "efector"'),
        (FkRequest(name=("q9",), position=(0.0,)), PlanCode.INVALID_GOAL_CONSTRAINTS, 'rm1 has no joint "q9"'),
        (FkRequest(name=("brazo_joint",)), PlanCode.INVALID_GOAL_CONSTRAINTS, "1 names and 0 positions"),
        (FkRequest(name=("brazo_joint",) * 2, position=(0.0, 1.0)), PlanCode.INVALID_GOAL_CONSTRAINTS, "twice"),
        (
            FkRequest(name=("brazo_joint",), position=(1e300,)),
            PlanCode.INVALID_GOAL_CONSTRAINTS,
            "1e+300 is no position",
        ),
    ],
)
def test_fk_refuses_what_is_not_there(request_: FkRequest, code: PlanCode, said: str):
    response = SERVED["rm1"].fk(request_, PRESENT["rm1"])
    assert response.code is code
    assert response.refusal is not None
    assert said in response.refusal.message
    assert response.refusal.remedy


def test_fk_without_a_joint_state_says_so():
    assert SERVED["rm1"].fk(FkRequest(), None).code is PlanCode.ROBOT_STATE_STALE
    beyond = FkRequest(name=RM1.joint_names, position=(math.tau, 0.0, 0.0))
    assert SERVED["rm1"].fk(beyond, None).code is PlanCode.SUCCESS


POST = SceneObject(
    name="post",
    shape=BoxShape(size=(0.04, 0.04, 0.16)),
    pose=Transform(translation=(0.29, 0.27, 0.08), rotation=(0.0, 0.0, 0.0, 1.0)),
)


def validity(request_: ValidityRequest, *objects: SceneObject) -> ValidityResponse:
    world = World(RM1, Kinematics(RM1), PlanningScene(objects=objects))
    return SERVED["rm1"].validity(request_, PRESENT["rm1"], 0.0, world)


def test_where_the_arm_may_stand_is_valid_and_a_limit_is_named_with_the_nearest_value():
    assert validity(ValidityRequest(name=("brazo_joint",), position=(0.3,))).code is PlanCode.SUCCESS
    response = validity(ValidityRequest(name=("brazo_joint",), position=(9.0,)))
    assert response.refusal is not None
    assert (response.refusal.check, response.refusal.subject) == ("joint limit", "brazo_joint")
    assert response.refusal.nearest == (RM1.joint("brazo_joint").upper,)


def test_what_touches_is_named_with_its_place_and_the_nearest_configuration_that_is_free():
    [pose] = SERVED["rm1"].ik(IkRequest(goal=PoseGoal(position=(0.29, 0.27, 0.1))), PRESENT["rm1"]).solutions
    asked = ValidityRequest(name=RM1.joint_names, position=pose.position)
    assert validity(asked).code is PlanCode.SUCCESS
    response = validity(asked, POST)
    assert response.code is PlanCode.GOAL_IN_COLLISION
    assert response.refusal is not None
    assert response.refusal.check == "collision"
    assert all("post" in (contact.first, contact.second) for contact in response.contacts)
    assert validity(ValidityRequest(name=RM1.joint_names, position=response.refusal.nearest), POST).refusal is None


def test_a_configuration_with_an_unknown_joint_or_no_number_is_refused():
    for name, value, said in (("elbow", 0.1, 'no joint "elbow"'), ("brazo_joint", 1e9, "no position")):
        response = validity(ValidityRequest(name=(name,), position=(value,)))
        assert response.refusal is not None
        assert said in response.refusal.message
