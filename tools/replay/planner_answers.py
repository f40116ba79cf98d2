"""The planner's answers to `ik`, `fk`, `state_validity` and `scene/edit` again, and the scenes that edits have made."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.recordings.table import exchanges_of
from gemelo.schemas.message import Message
from gemelo.schemas.planning import AnswerInputs
from gemelo.schemas.scene import SceneResponse
from gemelo.schemas.scene_meshes import by_digest
from gemelo.schemas.topics import ANSWER_INPUTS, FK, IK, SCENE, SCENE_EDIT, STATE_VALIDITY
from gemelo.services.planner.kinematics.kinematic_requests import KinematicRequests
from gemelo.services.planner.scene.scene_store import SceneStore, changed
from gemelo.services.planner.scene.standing import link_poses, standing
from gemelo.tools.replay.comparison import Comparison
from gemelo.tools.replay.recorded import Heard, Recorded
from gemelo.tools.replay.scenes import Scenes

REQUESTS = (FK, IK, STATE_VALIDITY, SCENE_EDIT)
EXCHANGES = {request: exchanges_of(request) for request in REQUESTS}
TOPICS = (ANSWER_INPUTS, SCENE, *EXCHANGES.values())
UNKNOWN = "answers without their answer/inputs: from before the recording, or record_inputs was off"
UNANSWERED = "questions without an answer"
UNSEEN = "scenes of edits that are not in the recording"


class AnswersAgain:
    """What answers these requests in the planner; `compare` holds all recorded answers against it."""

    def __init__(self, recorded: Recorded, comparison: Comparison, arm: ArmDescription, scenes: Scenes) -> None:
        self._recorded, self._comparison, self._arm, self._scenes = recorded, comparison, arm, scenes
        self._kinematics = Kinematics(arm)
        self._requests = KinematicRequests(arm, self._kinematics)

    def compare(self) -> None:
        """Until the first difference."""
        for request, topic in EXCHANGES.items():
            for heard, inputs in self._pairs(request.key, self._recorded.of(topic)):
                is_same = self._hold_edit(heard, inputs) if request is SCENE_EDIT else self._hold(heard, inputs)
                if not is_same:
                    return

    def _pairs(self, key: str, exchanges: list[Heard[Any]]) -> Iterator[tuple[Heard[Any], AnswerInputs]]:
        """Each answer with its inputs: those that were made while its question was in hand."""
        inputs = [each.message for each in self._recorded.of(ANSWER_INPUTS) if each.message.request == key]
        stamps = [each.stamp for each in inputs]
        last = -1
        for heard in exchanges:
            exchange = heard.message
            if exchange.failure is not None:
                self._comparison.aside[UNANSWERED] += 1
                continue
            place = bisect_right(stamps, exchange.stamp) - 1
            if place <= last or stamps[place] < exchange.stamp - round(exchange.duration * 1e9):
                self._comparison.aside[UNKNOWN] += 1
                continue
            last = place
            yield heard, inputs[place]

    def _hold(self, heard: Heard[Any], inputs: AnswerInputs) -> bool:
        """True if the answer of the kinematics is the same again."""
        exchange = heard.message
        return self._comparison.hold(heard.topic.key, heard, exchange.answer, self._answer(heard, inputs))

    def _answer(self, heard: Heard[Any], inputs: AnswerInputs) -> Message:
        question, present, age = heard.message.question, inputs.present, inputs.age
        if inputs.request == FK.key:
            return self._requests.fk(question, present, age)
        if inputs.request == IK.key and not question.avoid_collisions:
            return self._requests.ik(question, present, age)
        world = self._scenes.world(inputs.scene, f"the answer to {inputs.request} at {heard.at:.3f} s")
        answer = self._requests.ik if inputs.request == IK.key else self._requests.validity
        return answer(question, present, age, world)

    def _hold_edit(self, heard: Heard[Any], inputs: AnswerInputs) -> bool:
        """True if answer and scene are the same again; an epoch is drawn by chance, and a full disk is none of ours."""
        before = self._scenes.scene(inputs.scene, f"the edit at {heard.at:.3f} s")
        store = SceneStore(self._arm, self._scenes.folders, before)
        store.meshes.learn(self._scenes.meshes)
        links = lambda: link_poses(self._kinematics, standing(self._arm, inputs.present, inputs.age))  # noqa: E731
        built = lambda scene: self._scenes.built(scene, inputs.scene)  # noqa: E731
        response, world = changed(store, heard.message.question, links, inputs.stamp, built)
        was = _diskless(heard.message.answer)
        if not self._comparison.hold(heard.topic.key, heard, was, response):
            return False
        if world is None:
            return True
        shown = next((each for each in self._scenes.heard.values() if each.message.stamp == inputs.stamp), None)
        if shown is None:
            self._comparison.aside[UNSEEN] += 1
            return True
        epoch = store.scene.epoch if before.epoch else shown.message.epoch
        return self._comparison.hold(
            SCENE.key, shown, by_digest(shown.message), replace(by_digest(store.scene), epoch=epoch)
        )


def _diskless(response: SceneResponse) -> SceneResponse:
    """Without what the disk has said of a scene that was taken."""
    return replace(response, reason="") if response.accepted else response
