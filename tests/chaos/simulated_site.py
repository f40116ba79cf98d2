"""A site of chaos whose arm is simulated: what the injections look at, in virtual time."""

from __future__ import annotations

from typing import cast

import gemelo
from gemelo.libraries.runtime.actions.keys import goal_request
from gemelo.schemas.actions import GoalRequest
from gemelo.schemas.device import DeviceState
from gemelo.schemas.topics import DEVICE_STATE, FOLLOW_JOINT_TRAJECTORY, exchange_topic
from gemelo.tools.chaos.site import ChaosSite
from gemelo.tools.chaos.slots import SlotFile


class SeenSteps:
    """Where the counters have changed, as the device's states say: in the place of the record of slots."""

    def __init__(self) -> None:
        self.size = 0
        self._last: tuple[int, ...] = ()

    def on_state(self, state: DeviceState) -> None:
        self.size += bool(self._last) and state.steps != self._last
        self._last = state.steps


class SimulatedSite(ChaosSite):
    """Without a stack: `restart`, `bus` and the faults of processes and links are not there."""

    def __init__(self, arm: gemelo.Arm) -> None:
        self.arm, self.found = arm, []
        self.seen, self._goals = SeenSteps(), dict[str, GoalRequest]()
        self.slots = cast(SlotFile, self.seen)
        arm.node.subscribe(DEVICE_STATE, self.seen.on_state)
        arm.node.subscribe(exchange_topic(goal_request(FOLLOW_JOINT_TRAJECTORY)), self._note_goal)

    def steps_since(self, offset: int) -> int:
        return self.seen.size - offset
