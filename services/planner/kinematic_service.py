"""`ik`, `fk` and `state_validity` on the bus: answered in the node's worker thread, each with what it was made from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message
from gemelo.schemas.topics import FK, IK, STATE_VALIDITY, Request
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.kinematics.kinematic_requests import KinematicRequests
from gemelo.services.planner.scene.answer_log import AnswerLog
from gemelo.services.planner.scene.standing import version_of

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
Answer = Callable[[Q, JointState | None, float, World], R]  # of a question; [s] the age of the joint state


class KinematicService:
    """Serves the three requests; `newest` gives the world of the scene as it is."""

    def __init__(
        self, node: Node, arm: ArmDescription, states: Latest[JointState], newest: Callable[[], World], log: AnswerLog
    ) -> None:
        self._node, self._states, self._newest, self._log = node, states, newest, log
        requests = KinematicRequests(arm)
        self._serve(IK, requests.ik)
        self._serve(FK, lambda question, present, age, _world: requests.fk(question, present, age))
        self._serve(STATE_VALIDITY, requests.validity)

    def _serve(self, request: Request[Q, R], answer: Answer[Q, R]) -> None:
        def answered(question: Q) -> R:
            present, age, world = self._states.message, self._states.age(), self._newest()
            response = answer(question, present, age, world)
            self._log.tell(request, self._node.now(), present, age, version_of(world.scene))
            return response

        self._node.serve(request, answered, worker=True)
