"""Every answer of the planner and every jog, recorded on a bus, is the same again; one bit of any is found, by name."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from gemelo.libraries.recordings.channels import Entry
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message
from gemelo.schemas.planning import (
    FkRequest,
    IkRequest,
    JogCommand,
    JogTaken,
    JogTick,
    PlanCode,
    PoseGoal,
    ValidityRequest,
)
from gemelo.schemas.scene import BoxShape, SceneAdd, SceneAttach, SceneMove, SceneObject, SceneRemove, SceneRequest
from gemelo.schemas.topics import FK, IK, JOG, JOINT_STATES, JOINT_TARGETS, SCENE_EDIT, STATE_VALIDITY
from gemelo.services.planner.jog.jog import SILENCE
from gemelo.tools.replay import planner_jog
from gemelo.tools.replay.main import Replayed, replay, text_of
from gemelo.tools.replay.planner_answers import UNKNOWN
from gemelo.tools.replay.planner_jog import EARLIER, PERIODS
from tests.replay.recorded_bus import PATIENCE, Recorder

NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")
READY = (0.3, 0.4, 0.05)
TURN = JogCommand(name=("brazo_joint",), velocity=(0.4,))
PUSH = JogCommand(linear=(0.0, 0.06, 0.0))


class Person:
    """Asks, edits and jogs; an arm that follows its targets at once."""

    def __init__(self, node) -> None:
        self.node = node
        self.place, self.followed = READY, 0
        self._states, self._jog = node.publisher(JOINT_STATES), node.publisher(JOG)
        node.subscribe(JOINT_TARGETS, self._follow)

    def _follow(self, targets) -> None:
        self.place, self.followed = targets.position, self.followed + 1

    def stand(self) -> None:
        self._states.put(JointState(stamp=self.node.now(), name=NAMES, position=self.place, velocity=(0.0,) * 3))

    def ask(self, request, question):
        for _ in range(
            3
        ):  # a loaded machine's planner may hear the question before a state that was said just before it
            self.stand()
            self.node.wait(0.05)
        return self.node.call(request, question, timeout=PATIENCE)

    def jog(self, command: JogCommand, targets: int) -> None:
        """Until so many targets have come, then silence until a new jog would begin."""
        wanted, end = self.followed + targets, time.monotonic() + PATIENCE
        while self.followed < wanted:
            assert time.monotonic() < end
            self._jog.put(command)
            self.stand()
            self.node.wait(0.02)
        quiet, last = time.monotonic(), self.followed
        while time.monotonic() - quiet < 1.5 * SILENCE:
            self.stand()
            self.node.wait(0.02)
            if self.followed > last:
                quiet, last = time.monotonic(), self.followed


@pytest.fixture
def life(planner, tmp_path: Path) -> Recorder:
    """A recording of all that a planner answers but plans."""
    recorder, person = Recorder(planner, tmp_path / "life.mcap"), Person(planner)
    until(planner, lambda: any(entry.topic.key == "scene" for entry in recorder.entries))
    all_there = dict(zip(NAMES, READY, strict=True))
    pose = person.ask(FK, FkRequest(name=NAMES, position=READY)).poses[0]
    box = SceneObject(name="box", shape=BoxShape(size=(0.3, 0.02, 0.3)), pose=Transform(translation=pose.translation))
    assert person.ask(FK, FkRequest(name=("brazo_joint",), position=(0.1,))).code is PlanCode.SUCCESS
    assert person.ask(FK, FkRequest(links=("nowhere",))).refusal is not None
    assert person.ask(IK, IkRequest(goal=PoseGoal(position=pose.translation), solutions=4)).solutions
    assert person.ask(SCENE_EDIT, SceneRequest(edit=SceneAdd(object=box))).accepted
    assert person.ask(STATE_VALIDITY, ValidityRequest(name=tuple(all_there), position=READY)).refusal is not None
    assert not person.ask(SCENE_EDIT, SceneRequest(edit=SceneRemove(name="nothing"))).accepted
    away = Transform(translation=(pose.translation[0], pose.translation[1] + 0.12, pose.translation[2]))
    assert person.ask(SCENE_EDIT, SceneRequest(edit=SceneMove(name="box", pose=away))).accepted
    assert person.ask(STATE_VALIDITY, ValidityRequest(name=NAMES, position=READY)).code is PlanCode.SUCCESS
    person.jog(PUSH, 80)
    assert person.ask(SCENE_EDIT, SceneRequest(edit=SceneAttach(name="box", link="antebrazo_link"))).version == 3
    person.jog(TURN, 30)
    planner.wait(0.3)
    return recorder


def until(node, is_done: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not is_done():
        assert time.monotonic() < end
        node.wait(0.02)


def altered(recorder: Recorder, key: str, alter: Callable[[Message], Message | None]) -> Replayed:
    """The replay with the first message of `key` that `alter` changes, which returns None for the others."""
    entries, is_done = list[Entry](), False
    for entry in recorder.entries:
        other = None if is_done or entry.topic.key != key else alter(entry.message)
        is_done = is_done or other is not None
        entries.append(entry if other is None else replace_message(entry, other))
    assert is_done
    before, recorder.entries = recorder.entries, entries
    try:
        return replay(recorder.write(), "planner")
    finally:
        recorder.entries = before


def replace_message(entry: Entry, message: Message) -> Entry:
    return Entry(entry.topic, message, entry.arrival)


def test_one_bit_of_anything_is_found(life: Recorder):
    replayed = replay(life.write(), "planner")
    assert replayed.difference is None, text_of(replayed)
    kinds = {"@request/fk": 3, "@request/ik": 1, "@request/state_validity": 2, "@request/scene/edit": 4, "scene": 3}
    assert {key: replayed.alike[key] for key in kinds} == kinds
    assert replayed.alike[PERIODS] >= 110
    assert replayed.alike["joint_targets"] >= 100
    assert replayed.alike["jog_status"] > 10

    for key, path, alter in CHANGES:
        found = altered(life, key, alter).difference
        assert found is not None, key
        said = {"answer/inputs": "@request/fk", "jog/inputs": "joint_targets"}.get(key, key)
        assert found.topic == said, found
        assert path in found.path, found


def _answer(alter: Callable[[dict], bool]) -> Callable[[Message], Message | None]:
    """A change of the first answer in which there is something to change."""

    def change(exchange):
        answer = msgspec.json.decode(msgspec.json.encode(exchange.answer))
        if not alter(answer):
            return None
        return replace(exchange, answer=msgspec.convert(answer, type(exchange.answer)))

    return change


def _moved_solution(answer: dict) -> bool:
    answer["solutions"][0]["position"][1] += 1e-12
    return True


def _moved_pose(answer: dict) -> bool:
    if answer["poses"]:
        answer["poses"][0]["translation"][0] += 1e-15
    return bool(answer["poses"])


def _other_reason(answer: dict) -> bool:
    answer["reason"] += "." * (not answer["accepted"])
    return not answer["accepted"]


def _nearer_contact(answer: dict) -> bool:
    if answer["contacts"]:
        answer["contacts"][0]["distance"] += 1e-12
    return bool(answer["contacts"])


def _moved_object(scene):
    if scene.version != 3:  # in which nothing is asked any more
        return None
    box = scene.objects[0]
    x, y, z = box.pose.translation
    return replace(scene, objects=(replace(box, pose=replace(box.pose, translation=(x, y, z + 1e-12))),))


def _moved_target(targets):
    first, *others = targets.position
    return replace(targets, position=(first + 1e-15, *others))


def _other_scale(status):
    return replace(status, scale=status.scale - 1e-15) if 0.0 < status.scale < 1.0 else None


def _moved_arm(inputs):
    if inputs.request != "fk" or inputs.number != 2:
        return None
    return replace(inputs, present=replace(inputs.present, position=(0.0, 0.40001, 0.05)))


def _other_direction(inputs):
    """Of one command, the last one for a while."""
    taken, *others = inputs.inputs
    if len(others) < 20 or not isinstance(taken, JogTaken):
        return None
    aside = replace(taken, command=replace(taken.command, linear=(1e-6, 0.06, 0.0)))
    return replace(inputs, inputs=(aside, *[each for each in others if isinstance(each, JogTick)]))


CHANGES = [
    ("@request/fk", "poses[0].translation[0]", _answer(_moved_pose)),
    ("@request/ik", "solutions[0].position[1]", _answer(_moved_solution)),
    ("@request/state_validity", "contacts[0].distance", _answer(_nearer_contact)),
    ("@request/scene/edit", "reason", _answer(_other_reason)),
    ("scene", "objects[0].pose.translation[2]", _moved_object),
    ("joint_targets", "position[0]", _moved_target),
    ("jog_status", "scale", _other_scale),
    ("answer/inputs", "poses[0]", _moved_arm),
    ("jog/inputs", "position[", _other_direction),
]


def test_a_jog_that_brakes_otherwise_is_found_by_its_checksum(life: Recorder, monkeypatch: pytest.MonkeyPatch):
    """Targets that no recorder was given count as well."""
    life.entries = [each for each in life.entries if each.topic.key not in ("joint_targets", "jog_status")]
    assert replay(life.write(), "planner").difference is None
    monkeypatch.setattr(planner_jog, "signed", lambda output, client, told_to: (None, None))
    found = replay(life.write(), "planner").difference
    assert (found.topic, found.replayed) == (PERIODS, "(nothing)")


def test_answers_and_jogs_whose_inputs_are_not_recorded_are_set_aside_and_said(life: Recorder):
    jogs = [each for each in life.entries if each.topic.key == "jog/inputs"]
    gone = {"answer/inputs": lambda each: each.message.request != "ik", "jog/inputs": lambda each: each is not jogs[0]}
    life.entries = [each for each in life.entries if gone.get(each.topic.key, lambda _: True)(each)]
    replayed = replay(life.write(), "planner")
    assert replayed.difference is None, text_of(replayed)
    assert replayed.aside[UNKNOWN] == 1
    assert replayed.aside[EARLIER] > 0
    assert replayed.alike[PERIODS] >= 30  # of the second jog
