"""The core has no clock and no chance of its own: the same inputs at the same moments give the same outputs.

Wires lose, double and reorder frames; goals, cancels, stops, targets and gripper come by chance; the device reboots.
"""

from __future__ import annotations

import random
from typing import Any

import msgspec
import pytest

from gemelo.schemas.device import DeviceCommandKind, StopKind
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import (
    BeganInput,
    CancelInput,
    Given,
    Input,
    ParametersInput,
    SceneInput,
    StepInput,
    packed,
    unpacked,
)
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import LogLine
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.stepper_gateway.harness import move


class Watched(VirtualArm):
    """Keeps every input of the core with what the core returned."""

    def start_core(self, arm, session_id, parameters=None):
        super().start_core(arm, session_id, parameters)
        self.calls: list[tuple[Input, Moment, Any]] = []
        self.began = BeganInput(
            session_id, msgspec.structs.replace(parameters or GatewayParameters(), watch_streams=False)
        )
        self.core.handle = self._watched(self.core.handle)

    def _watched(self, handle):
        def watched(given, moment):
            returned = handle(given, moment)
            self.calls.append((given, moment, returned))
            return returned

        return watched


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
                arm.handle(CancelInput(f"goal-{number - 1}"))
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
        assert again.handle(given.input, given.moment) == was
    assert len(arm.calls) > 500


def test_a_scene_that_is_dropped_is_logged_with_the_next_input():
    """A recording has it there: neither a scene nor parameters have outputs of their own."""
    core, moment = GatewayCore(rm1(), 7), Moment(1, 1.0)
    assert core.handle(SceneInput(-3, 4), moment) == (None, [])
    assert core.handle(ParametersInput(GatewayParameters(control_grace=1.0)), moment) == (None, [])
    _, outputs = core.handle(StepInput(), moment)
    lines = [each.text for each in outputs if isinstance(each, LogLine)]
    assert lines == ["scene: dropped: version -3 is negative (further ones are only counted)"]


def test_a_core_begins_once():
    with pytest.raises(ValueError, match="a core begins once"):
        GatewayCore(rm1(), 7).handle(BeganInput(8, GatewayParameters()), Moment(1, 1.0))
