"""The examples, as a user runs them: processes of their own against a router and a scripted robot."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.actions.server import ActionServer, GoalDecision, accept
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from gemelo.schemas.planning import JointGoal, NamedGoal, PlanCode, PlanRequest
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, FRAMES, JOINT_STATES, PLAN, STATIC_FRAMES
from tests.runtime.support import ROOT, RouterProcess, programs, spinning, until
from tests.table import table

EXAMPLES = sorted(path.name for path in (ROOT / "examples").glob("*.py"))
LONGEST = {
    "09_pick_and_place.py": 40,
    "14_straight_planner.py": 29,
    "17_lead_by_hand.py": 33,
}  # lines that do something
LONGEST_OTHER = 20

ARMS = [load_arm(ROOT / "urdf" / name) for name in ("rm1", "parol6")]
ARM_WORDS = {word for arm in ARMS for word in (arm.name, *arm.joint_names, *arm.model.link_names)}

Start = Callable[[str], subprocess.Popen[str]]


@pytest.fixture(scope="module")
def router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RouterProcess]:
    process = RouterProcess(tmp_path_factory.mktemp("router"))
    yield process
    process.kill()


@pytest.fixture
def start(router: RouterProcess) -> Iterator[Start]:
    with programs(router) as run:
        yield lambda name: run(f"examples/{name}")


@pytest.fixture
def robot(router: RouterProcess) -> Iterator[Node]:
    """A node that says what the stack of rm1 would say."""
    with Node("stepper_gateway", router.deployment, robot="rm1") as node:
        yield node


@pytest.fixture
def state_publisher(router: RouterProcess) -> Iterator[Node]:
    """A node that says the frames of rm1."""
    with Node("state_publisher", router.deployment, robot="rm1") as node:
        yield node


def end(process: subprocess.Popen[str]) -> str:
    process.send_signal(signal.SIGTERM)
    output, errors = process.communicate(timeout=60.0)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    return output


def line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def test_joint_monitor_prints_the_joints_and_notices_silence(start: Start, robot: Node) -> None:
    process = start("10_joint_monitor.py")
    assert line(process) == "no joint states: is stepper_gateway running?\n"
    states = robot.publisher(JOINT_STATES)
    with spinning(robot, lambda now: states.put(JointState(stamp=now, name=("q1", "q2"), position=(0.5, -0.25)))):
        while "no joint" in (said := line(process)):
            pass
    assert said == "q1 +0.5000  q2 -0.2500\n"
    while "no joint" not in line(process):
        pass
    end(process)


def test_tool_pose_warns_while_the_frame_does_not_exist_and_then_prints_it(start: Start, state_publisher: Node) -> None:
    process = start("11_tool_pose.py")
    assert process.stderr is not None
    assert "tool_pose WARNING" in process.stderr.readline()
    fixed = FrameTransform(parent="brazo_link", child="efector_link", transform=Transform(translation=(0.2, 0.0, 0.1)))
    state_publisher.publisher(STATIC_FRAMES).put(FrameTransforms(transforms=(fixed,)))
    frames = state_publisher.publisher(FRAMES)

    def step(now: int) -> None:
        moving = FrameTransform(
            stamp=now, parent="base_link", child="brazo_link", transform=Transform(translation=(0.0, 0.0, 0.05))
        )
        frames.put(FrameTransforms(transforms=(moving,)))

    with spinning(state_publisher, step):
        assert line(process) == "x +0.2000  y +0.0000  z +0.1500 m\n"
    end(process)


class Follower:
    """Accepts every trajectory and 'follows' it in three steps."""

    def __init__(self, node: Node) -> None:
        self.goals: list[FollowJointTrajectoryGoal] = []
        self.running: dict[str, int] = {}
        self.states = node.publisher(JOINT_STATES)
        self.server: ActionServer[
            FollowJointTrajectoryGoal, FollowJointTrajectoryFeedback, FollowJointTrajectoryResult
        ] = node.serve_action(FOLLOW_JOINT_TRAJECTORY, self.on_goal, lambda goal_id: None)

    def on_goal(self, goal_id: str, goal: FollowJointTrajectoryGoal) -> GoalDecision:
        self.goals.append(goal)
        self.running[goal_id] = 0
        return accept()

    def step(self, now: int) -> None:
        self.states.put(JointState(stamp=now, name=("q1", "q2"), position=(0.5, -0.25)))
        for goal_id, index in list(self.running.items()):
            self.running[goal_id] = index + 1
            self.server.feedback(goal_id, FollowJointTrajectoryFeedback(index=index, points=3, duration=4.0))
            if index == 3:
                del self.running[goal_id]
                result = FollowJointTrajectoryResult(executed_steps=(100, -40))
                self.server.finish(goal_id, GoalStatusCode.SUCCEEDED, result)


def test_custom_planner_moves_the_arm_and_feedback_monitor_sees_it(
    start: Start, router: RouterProcess, robot: Node
) -> None:
    follower = Follower(robot)
    with spinning(robot, follower.step):
        monitor = start("12_feedback_monitor.py")
        with Node("observer", router.deployment, robot="rm1") as observer:
            assert until(lambda: "feedback_monitor" in observer.alive())
        time.sleep(0.3)
        planner = start("13_custom_planner.py")
        output, errors = planner.communicate(timeout=60.0)
        assert (planner.returncode, errors) == (0, "")
        assert output == "SUCCEEDED  (100, -40)\n"
        said = [line(monitor) for _ in range(3)]
    assert said[2] == "point 2 of 3, 0.00 of 4.00 s, error 0.00000\n"
    assert "SUCCEEDED" in end(monitor)
    points = follower.goals[0].trajectory.points
    assert [point.positions for point in points] == [(0.5, -0.25), (0.52, -0.23), (0.5, -0.25)]


def test_ctrl_c_in_custom_planner_cancels_its_move(start: Start, robot: Node) -> None:
    running: list[str] = []
    cancelled: list[str] = []
    states = robot.publisher(JOINT_STATES)

    def on_goal(goal_id: str, goal: FollowJointTrajectoryGoal) -> GoalDecision:
        running.append(goal_id)
        return accept()

    def on_cancel(goal_id: str) -> None:
        cancelled.append(goal_id)

    server = robot.serve_action(FOLLOW_JOINT_TRAJECTORY, on_goal, on_cancel)

    def step(now: int) -> None:
        states.put(JointState(stamp=now, name=("q1",), position=(0.5,)))
        while cancelled:
            server.finish(cancelled.pop(), GoalStatusCode.CANCELED, FollowJointTrajectoryResult(executed_steps=(3,)))

    with spinning(robot, step):
        planner = start("13_custom_planner.py")
        assert until(lambda: running, 60.0)
        time.sleep(0.3)
        planner.send_signal(signal.SIGINT)
        output, errors = planner.communicate(timeout=60.0)
    assert (planner.returncode, errors, output) == (0, "", "CANCELED  (3,)\n")


def test_straight_planner_takes_the_place_of_ours(start: Start, router: RouterProcess, robot: Node) -> None:
    states = robot.publisher(JOINT_STATES)
    joints = JointState(name=("q1", "q2"), position=(0.5, -0.25))
    with spinning(robot, lambda now: states.put(joints)):
        process = start("14_straight_planner.py")
        with Node("person", router.deployment, robot="rm1") as person:
            assert until(lambda: "planner" in person.alive(), 60.0)
            time.sleep(0.3)  # for its first joint state
            there = person.call(PLAN, PlanRequest(goal=JointGoal(name=("q2",), position=(0.1,))))
            refused = person.call(PLAN, PlanRequest(goal=NamedGoal(name="home")))
        end(process)
    assert (there.code, there.duration, there.scene_version) == (PlanCode.SUCCESS, 10.0, None)
    assert [point.positions for point in there.trajectory.points] == [(0.5, -0.25), (0.5, 0.1)]
    assert refused.refusal is not None
    assert "joint values alone" in refused.refusal.message


@table("name", EXAMPLES)
def test_an_example_is_short(name: str) -> None:
    text = (ROOT / "examples" / name).read_text(encoding="utf-8").splitlines()
    doing = [each for each in text if each.strip() and not each.startswith(("from ", "import ", '"""'))]
    assert len(doing) <= LONGEST.get(name, LONGEST_OTHER)


@table("name", EXAMPLES)
def test_an_example_says_what_it_shows_and_names_no_arm(name: str) -> None:
    text = (ROOT / "examples" / name).read_text(encoding="utf-8")
    assert text.startswith(('"""', "'"))
    assert not [word for word in ARM_WORDS if word in text]


def test_the_examples_are_numbered_and_those_that_are_promised_are_there() -> None:
    assert [int(name.split("_")[0]) for name in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
    nodes = {"joint_monitor", "custom_planner", "feedback_monitor", "tool_pose", "straight_planner"}
    assert {"pick_and_place", *nodes} <= {name.split("_", 1)[1].removesuffix(".py") for name in EXAMPLES}
