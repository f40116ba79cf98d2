"""Failures inside the handlers of services: who asked is answered, the service goes on, and its state is as before.

Every handler of every service of the simulated twin, cameras included, is made to fail: where it begins, and at each
message that it encodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.libraries.runtime.actions.keys import result_request
from gemelo.libraries.runtime.bus import wire
from gemelo.libraries.runtime.endpoints import info_request, parameter_request, parameters_request
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.schemas.device import DeviceCommandRequest, DeviceStopRequest, InjectRequest, StopKind
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Message
from gemelo.schemas.planning import JogCommand, NamedGoal, PlanRequest
from gemelo.schemas.scene import BoxShape, SceneAdd, SceneObject, SceneRequest
from gemelo.schemas.system import Empty, SetParameter
from gemelo.schemas.topics import (
    CONTROL,
    DEVICE_COMMAND,
    DEVICE_INJECT,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    JOG,
    JOINT_TARGETS,
    PLAN,
    REQUESTS,
    SCENE,
    SCENE_EDIT,
    Request,
)
from gemelo.tools.simulation import twin
from gemelo.tools.simulation.twin import ServiceNode

ROOT = Path(__file__).parents[2]
AT_ONCE = -1  # fails where it begins; 0, 1, ...: at the first, second ... message that it encodes
PLANNER, GATEWAY = "planner", "stepper_gateway"
QUESTIONS: dict[str, Message] = {
    PLAN.key: PlanRequest(goal=NamedGoal(name="left")),
    SCENE_EDIT.key: SceneRequest(
        edit=SceneAdd(
            object=SceneObject(
                name="post", shape=BoxShape(size=(0.1, 0.1, 0.1)), pose=Transform(translation=(3.0, 0.0, 0.0))
            )
        )
    ),
    DEVICE_STOP.key: DeviceStopRequest(kind=StopKind.HOLD),
    DEVICE_COMMAND.key: DeviceCommandRequest(),
    DEVICE_INJECT.key: InjectRequest(kind="estop", value=0.0),
}


@dataclass
class Trouble:
    """The one handler that fails, and where in it."""

    where: tuple[str, str] = ("", "")  # the node, and the key
    after: int = AT_ONCE
    hits: int = 0
    served: set[tuple[str, str]] = field(default_factory=set)
    subscribed: set[tuple[str, str]] = field(default_factory=set)
    _left: int | None = None  # messages that may be encoded; None: outside of the handler

    def within(self, node: str, key: str, handler: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            if self.where != (node, key):
                return handler(*arguments)
            self.hits += 1
            if self.after == AT_ONCE:
                raise ZeroDivisionError("oh")
            self._left = self.after
            try:
                return handler(*arguments)
            finally:
                self._left = None

        return call

    def on_encoding(self) -> None:
        if self._left is not None:
            if self._left == 0:
                raise ZeroDivisionError("oh")
            self._left -= 1

    def begin(self, where: tuple[str, str], after: int) -> None:
        self.where, self.after, self.hits = where, after, 0

    def end(self) -> None:
        self.where = ("", "")


TROUBLE = Trouble()


class TroubledNode(ServiceNode):
    """A service's node whose handlers `TROUBLE` may make fail."""

    def subscribe(self, topic: Any, on_message: Any, own: bool = False, batch: float | None = None) -> Any:
        TROUBLE.subscribed.add((self.name, topic.key))
        return super().subscribe(topic, TROUBLE.within(self.name, topic.key, on_message), own, batch)

    def subscribe_signed(self, topic: Any, on_message: Any) -> Any:
        TROUBLE.subscribed.add((self.name, topic.key))
        return super().subscribe_signed(topic, TROUBLE.within(self.name, topic.key, on_message))

    def serve(self, request: Any, handler: Any, worker: bool = False) -> None:
        TROUBLE.served.add((self.name, request.key))
        super().serve(request, TROUBLE.within(self.name, request.key, handler), worker)

    def serve_later(self, request: Any, handler: Any) -> Any:
        TROUBLE.served.add((self.name, request.key))
        return super().serve_later(request, TROUBLE.within(self.name, request.key, handler))

    def serve_action(self, action: Any, on_goal: Any, on_cancel: Any, read: Any = None) -> Any:
        goal = TROUBLE.within(self.name, f"{action.key}/goal", on_goal)
        return super().serve_action(action, goal, TROUBLE.within(self.name, f"{action.key}/cancel", on_cancel), read)


@pytest.fixture(scope="module")
def arm() -> Iterator[SimulatedArm]:
    real = wire.to_payload

    def to_payload(message: Message) -> bytes:
        TROUBLE.on_encoding()
        return real(message)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(twin, "ServiceNode", TroubledNode)
        patch.setattr(wire, "to_payload", to_payload)
        with gemelo.simulate("rm1", cell=ROOT / "urdf/rm1/cell.toml") as arm:
            yield arm


@pytest.fixture(autouse=True)
def quiet(arm: SimulatedArm) -> Iterator[None]:
    yield
    TROUBLE.end()
    assert arm.wait_for(lambda: arm.device.mode is not gemelo.DeviceMode.RUN, 20.0)


def state_of(arm: SimulatedArm) -> tuple[object, ...]:
    """What anybody can know of the twin's state, while the arm rests."""
    arm.sim.sleep(0.3)
    latest = arm.node.latest(CONTROL)
    assert arm.wait_for(lambda: latest.message is not None, 5.0)
    parameters = tuple(arm.node.call(parameters_request(name), Empty()) for name in (PLANNER, GATEWAY))
    rounded = tuple(round(value, 4) for value in arm.joints.values())
    return arm.scene.present, arm.device.mode, rounded, latest.message, parameters


def ask(arm: SimulatedArm, request: Request[Any, Any], question: Message) -> str:
    """What is wrong, by the answer; empty where it is a good one."""
    try:
        arm.node.call(request, question, timeout=5.0)
    except RequestRefused as refused:
        return str(refused)
    return ""


def question_of(request: Request[Any, Any]) -> Message:
    return QUESTIONS.get(request.key) or request.request()


def test_every_request_of_the_table_is_served_by_the_twin(arm: SimulatedArm) -> None:
    served = {key for _, key in TROUBLE.served}
    assert {request.key for request in REQUESTS} <= served


def test_a_request_whose_handler_fails_is_answered_with_an_error_and_changes_nothing(arm: SimulatedArm) -> None:
    arm.scene.clear()
    before = state_of(arm)
    for request in REQUESTS:
        TROUBLE.begin((request.server, request.key), AT_ONCE)
        said = ask(arm, request, question_of(request))
        assert said == f"{request.server} failed: ZeroDivisionError: oh", request.key
        TROUBLE.end()
        assert state_of(arm) == before, request.key
    assert arm.move(named="left").status.name == "SUCCEEDED"


@pytest.mark.parametrize("after", [0, 1, 2, 3])
def test_what_the_planner_cannot_encode_is_an_error_and_changes_nothing(arm: SimulatedArm, after: int) -> None:
    arm.scene.clear()
    for request in (each for each in REQUESTS if each.server == PLANNER):
        before = state_of(arm)
        TROUBLE.begin((PLANNER, request.key), after)
        said = ask(arm, request, question_of(request))
        TROUBLE.end()
        assert said in ("", "planner failed: ZeroDivisionError: oh"), request.key
        if said:
            assert state_of(arm) == before, request.key
        else:
            assert ask(arm, request, question_of(request)) == "", request.key
            arm.scene.clear()


@pytest.mark.parametrize("after", [AT_ONCE, 0, 1, 2])
def test_a_parameter_whose_change_cannot_be_encoded_keeps_its_value(arm: SimulatedArm, after: int) -> None:
    for name in (PLANNER, GATEWAY):
        before = arm.node.call(parameters_request(name), Empty())
        request, wanted = parameter_request(name), SetParameter(name="record_inputs", value=True)
        TROUBLE.begin((name, request.key), after)
        said = ask(arm, request, wanted)
        TROUBLE.end()
        after_it = arm.node.call(parameters_request(name), Empty())
        assert (after_it == before) == bool(said), name
        assert ask(arm, request, SetParameter(name="record_inputs", value=False)) == ""


@pytest.mark.parametrize("after", [0, 1])
def test_the_gateway_answers_and_goes_on_where_it_cannot_encode(arm: SimulatedArm, after: int) -> None:
    for request in (each for each in REQUESTS if each.server == GATEWAY and each is not DEVICE_STOP):
        TROUBLE.begin((GATEWAY, request.key), after)
        said = ask(arm, request, question_of(request))
        TROUBLE.end()
        assert said != "" or arm.node.call(info_request(GATEWAY), Empty()).ready, request.key
        arm.sim.sleep(0.5)
    assert arm.node.call(info_request(GATEWAY), Empty()).ready
    assert arm.move(named="ready").status.name == "SUCCEEDED"


@pytest.mark.parametrize("after", [AT_ONCE, 0, 1])
def test_a_goal_whose_handler_fails_is_refused_and_not_followed(arm: SimulatedArm, after: int) -> None:
    arm.move(named="ready")
    plan = arm.plan(named="left")
    before = state_of(arm)
    TROUBLE.begin((GATEWAY, f"{FOLLOW_JOINT_TRAJECTORY.key}/goal"), after)
    try:
        with pytest.raises(gemelo.Refused, match="stepper_gateway failed: ZeroDivisionError: oh"):
            arm.start(plan)
        assert TROUBLE.hits == 1
    finally:
        TROUBLE.end()
    arm.sim.sleep(2.0)
    joints = state_of(arm)[2]
    assert joints == before[2] or after != AT_ONCE
    assert arm.device.mode is not gemelo.DeviceMode.RUN
    assert arm.node.call(result_request(FOLLOW_JOINT_TRAJECTORY), result_request(FOLLOW_JOINT_TRAJECTORY).request())
    assert arm.move(named="left").status.name == "SUCCEEDED"
    arm.move(named="ready")


def stir(arm: SimulatedArm) -> None:
    """Something of everything that the services subscribe to."""
    arm.node.publisher(JOG).put(JogCommand(stamp=arm.node.now(), name=arm.joint_names[:1], velocity=(0.05,)))
    arm.node.publisher(JOINT_TARGETS).put(JointTargets())
    arm.scene.add_sphere("ball", 0.1, at=(3.0, 0.0, 0.0))
    arm.scene.clear()
    arm.sim.sleep(0.3)


def test_a_subscription_whose_handler_fails_loses_its_message_and_nothing_else(arm: SimulatedArm) -> None:
    hit = set()
    for where in sorted(TROUBLE.subscribed):
        for after in (AT_ONCE, 0):
            TROUBLE.begin(where, after)
            stir(arm)
            if TROUBLE.hits:
                hit.add(where)
            TROUBLE.end()
    arm.sim.sleep(1.0)
    for name in {node for node, _ in TROUBLE.served}:
        assert arm.node.call(info_request(name), Empty()).node == name
    assert arm.wait_for(lambda: not arm.device.status.reason, 5.0)
    assert arm.move(named="left").status.name == "SUCCEEDED"
    assert {key for _, key in hit} >= {JOG.key, JOINT_TARGETS.key, SCENE.key, "joint_states"}
