"""The core has no clock and no chance of its own: the same inputs at the same moments give the same outputs.

Wires lose, double and reorder frames; goals, cancels, stops, targets and gripper come by chance; the device reboots.
"""

from __future__ import annotations

import random
from typing import Any

import msgspec
import pytest

from gemelo.schemas.device import DeviceCommandKind, StopKind
from gemelo.schemas.scene import PlanningScene
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import (
    BeganInput,
    CancelInput,
    CommandInput,
    ConfigureInput,
    EchoInput,
    FrameInput,
    Given,
    GoalInput,
    GripCancelInput,
    GripInput,
    Input,
    LinkInput,
    SceneInput,
    StepInput,
    StopInput,
    TargetsInput,
    give,
    packed,
    unpacked,
)
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.gateway_driver import MotionCaller
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.stepper_gateway.harness import move

WAYS: dict[str, Any] = {  # of the core's methods: the input that stands for a call
    "step": lambda: StepInput(),
    "on_link": LinkInput,
    "on_received": lambda received: FrameInput(*received),
    "on_goal": GoalInput,
    "on_cancel": CancelInput,
    "on_grip": GripInput,
    "on_grip_cancel": GripCancelInput,
    "on_targets": TargetsInput,
    "on_command": lambda request, ticket: CommandInput(ticket, request),
    "on_stop": lambda request, ticket: StopInput(ticket, request),
    "on_configure": ConfigureInput,
    "on_echo": EchoInput,
}


class Watched(VirtualArm):
    """Keeps every call of the core with what it returned."""

    def start_core(self, arm, session_id, parameters=None):
        super().start_core(arm, session_id, parameters)
        self.calls: list[tuple[Input, Moment, Any]] = []
        self.began = BeganInput(session_id, parameters or GatewayParameters())
        for name, way in WAYS.items():
            setattr(self.core, name, self._watched(getattr(self.core, name), way))

    def _watched(self, method, way):
        def call(*arguments):
            [moment] = [each for each in arguments if isinstance(each, Moment)]
            given = [
                each for each in arguments if not isinstance(each, Moment | MotionCaller)
            ]  # nobody says who he is here
            returned = method(*arguments)
            self.calls.append((way(*given), moment, returned))
            return returned

        return call


def lived(seed: int) -> Watched:
    """Half a minute of a life that the seed decides."""
    chance = random.Random(seed)
    arm = Watched(VirtualWire(delay=0.002, jitter=0.006, loss=0.01, duplicates=0.02), seed=seed)
    arm.ready()
    for number in range(8):
        match chance.randrange(7):
            case 0 | 1:
                arm.goal(move(arm.position, tuple(chance.uniform(0.0, 0.3) for _ in range(3))), f"goal-{number}")
            case 2:
                arm.cancel(f"goal-{number - 1}")
            case 3:
                arm.target(brazo_joint=arm.position[0] + chance.uniform(-0.05, 0.05))
            case 4:
                arm.ask(chance.choice(list(StopKind)), 100 + number)
            case 5:
                arm.command(DeviceCommandKind.RESUME, 200 + number)
            case 6:
                arm.grip(chance.uniform(0.0, 0.05), goal_id=f"grip-{number}")
        arm.run(chance.uniform(0.05, 1.5))
    arm.reboot(78)
    arm.run(1.0)
    return arm


@pytest.mark.parametrize("seed", range(6))
def test_the_same_inputs_give_the_same_outputs(seed):
    arm = lived(seed)
    again = GatewayCore(rm1(), arm.began.session, arm.began.parameters, arm.began.kept)
    encoded = [msgspec.msgpack.encode(Given(m.unix, m.monotonic, 0, given)) for given, m, _ in arm.calls]
    for given, (_, _, was) in zip(unpacked(packed(encoded)), arm.calls, strict=True):
        reply, outputs = give(again, given.input, given.moment)
        assert (outputs if reply is None else (reply, outputs)) == was
    assert len(arm.calls) > 500


def test_a_scene_is_given_by_its_version_alone():
    """The gateway looks at nothing else of it, so nothing else is recorded."""
    cores = [GatewayCore(rm1(), 7, GatewayParameters()) for _ in range(2)]
    moment = Moment(1, 1.0)
    cores[0].on_scene(PlanningScene(version=-3, epoch=4))
    give(cores[1], SceneInput(-3, 4), moment)
    assert cores[0].scenes_dropped == cores[1].scenes_dropped == 1
    assert cores[0].step(moment) == cores[1].step(moment)
