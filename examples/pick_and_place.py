"""Carries a part around a post, on whichever arm is running, and leaves the planning scene as it was found."""

import tomllib
from xml.etree import ElementTree

from schemas.actions import GoalStatusCode
from schemas.frames import Transform
from schemas.message import Vector
from schemas.motion import FollowJointTrajectoryGoal
from schemas.planning import FkRequest, FreeMotion, Goal, LinearMotion, NamedGoal, PlanRequest, PlanResponse, PoseGoal
from schemas.scene import AllowedPair, BoxShape, SceneAction, SceneObject, SceneRequest
from schemas.topics import DESCRIPTION, FK, FOLLOW_JOINT_TRAJECTORY, PLAN, SCENE, SCENE_EDIT
from services.runtime.node import Node

FROM, TO = "left", "ready"  # named states of both arms in which the tool looks down
LIFT, GAP = 0.03, 0.006  # [m] that the part is lifted; from the part to the tool, more than the planner's clearance
PART, STAND, POST = (0.02, 0.02, 0.02), (0.05, 0.05, 0.01), (0.03, 0.03, 0.1)  # [m] edges
LINE = LinearMotion(speed=0.05)


def plan(request: PlanRequest) -> PlanResponse:
    response = node.call(PLAN, request, timeout=request.allowed_time + 5.0)
    if response.refusal is not None:
        raise SystemExit(f"refused: {response.refusal.message}; {response.refusal.remedy}")
    return response


def move(what: str, goal: Goal, motion: FreeMotion | LinearMotion) -> None:
    planned = plan(PlanRequest(goal=goal, motion=motion, allowed_time=5.0))
    goal = FollowJointTrajectoryGoal(
        trajectory=planned.trajectory, scene_version=planned.scene_version, scene_epoch=planned.scene_epoch
    )
    handle = follow.send(goal)
    try:
        outcome = handle.wait(planned.duration + 10.0)
    except KeyboardInterrupt:  # the arm would go on by itself
        handle.cancel()
        outcome = handle.wait(timeout=10.0)
    lost = sum(abs(a - b) for a, b in zip(outcome.result.commanded_steps, outcome.result.executed_steps, strict=True))
    print(f"{what}: {planned.planner_id}, {planned.duration:.2f} s, {lost} steps lost", flush=True)
    if outcome.status is not GoalStatusCode.SUCCEEDED:
        raise SystemExit(f"{outcome.status.name}: {outcome.result.error_string}")


def edit(what: str, request: SceneRequest) -> None:
    response = node.call(SCENE_EDIT, request)
    if not response.accepted:
        raise SystemExit(f"refused: {response.reason}")
    print(f"{what}: scene version {response.version}", flush=True)


def add(name: str, size: Vector, at: Vector) -> None:
    item = SceneObject(name=name, shape=BoxShape(size=size), pose=Transform(translation=at))
    edit(f"add {name}", SceneRequest(object=item))


def tool_pose(name: tuple[str, ...], position: Vector) -> Transform:
    return node.call(FK, FkRequest(name=name, position=position)).poses[0]


def above(pose: Transform, height: float) -> Vector:
    x, y, z = pose.translation
    return (x, y, z + height)


def pose_goal(pose: Transform, height: float = 0.0) -> PoseGoal:
    return PoseGoal(position=above(pose, height), orientation=pose.rotation)


with Node("pick_and_place") as node:
    follow, description, scene = node.action(FOLLOW_JOINT_TRAJECTORY), node.latest(DESCRIPTION), node.latest(SCENE)
    while (about := description.message) is None or (found := scene.message) is None:
        node.wait(0.1)
    tool = tomllib.loads(about.robot_toml)["tool_frame"]
    [holder] = ElementTree.fromstring(about.urdf).findall(f"joint/child[@link='{tool}']/../parent")

    ends = [plan(PlanRequest(goal=NamedGoal(name=state))).trajectory for state in (FROM, TO)]
    names, (first, last) = ends[0].joint_names, [each.points[-1].positions for each in ends]
    pick, place = tool_pose(names, first), tool_pose(names, last)
    between = tool_pose(names, tuple((a + b) / 2 for a, b in zip(first, last, strict=True)))
    try:
        add("post", POST, between.translation)  # in the middle of the straight way
        add("part", PART, above(pick, -LIFT - GAP - PART[2] / 2))
        for name, pose in (("pick_stand", pick), ("place_stand", place)):
            add(name, STAND, above(pose, -LIFT - GAP - PART[2] - STAND[2] / 2))
            pair = AllowedPair(first="part", second=name)
            edit(f"part may touch {name}", SceneRequest(action=SceneAction.ALLOW, pair=pair))
        move("above the part", pose_goal(pick), FreeMotion())
        move("down", pose_goal(pick, -LIFT), LINE)
        grip = SceneObject(frame=tool, touch_links=(holder.attrib["link"],))
        edit("grip", SceneRequest(action=SceneAction.ATTACH, name="part", object=grip))
        move("up", pose_goal(pick), LINE)
        move("around the post", pose_goal(place), FreeMotion())
        move("down", pose_goal(place, -LIFT), LINE)
        edit("let go", SceneRequest(action=SceneAction.DETACH, name="part"))
        move("up", pose_goal(place), LINE)
        move("home", NamedGoal(name="home"), FreeMotion())
    finally:
        edit("as it was", SceneRequest(action=SceneAction.REPLACE, scene=found))
