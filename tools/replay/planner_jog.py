"""Jogging again: every command and period that the planner's jog was given, and what it says of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planning import JogTaken, JogTick
from gemelo.schemas.reasons import plain
from gemelo.schemas.topics import JOG_INPUTS, JOG_STATUS, JOINT_TARGETS, SCENE
from gemelo.services.planner.jog.jog import Jog, signed
from gemelo.services.planner.jog.jog_log import digest_of
from gemelo.tools.replay.comparison import ABSENT, Comparison
from gemelo.tools.replay.recorded import Heard, Recorded
from gemelo.tools.replay.scenes import Scenes

TOPICS = (JOG_INPUTS, JOINT_TARGETS, JOG_STATUS, SCENE)
PERIODS = "targets and statuses of one period of a jog"
EARLIER = "periods of a jog whose beginning is not in the recording"
CHECKSUMS = f"{PERIODS} with another checksum, which knows no tolerance"
OTHERS = "targets and statuses of others than the jog"


class JogAgain:
    """The jog, and the recorded messages beside which its own are held; `compare` goes through all of them."""

    def __init__(self, recorded: Recorded, comparison: Comparison, arm: ArmDescription, scenes: Scenes) -> None:
        self._recorded, self._comparison, self._arm, self._scenes = recorded, comparison, arm, scenes
        self._kinematics = Kinematics(arm)
        self._jog: Jog | None = None
        self._waiting: list[JogTaken] = []  # until the jog is made, in the world of its first period
        self._client = ""
        self._said: dict[str, dict[int, Heard[Any]]] = {
            topic.key: {heard.stamp: heard for heard in recorded.of(topic)} for topic in (JOINT_TARGETS, JOG_STATUS)
        }

    def compare(self) -> None:
        """Until the first difference."""
        for number, given in enumerate(self._inputs()):
            if isinstance(given, JogTaken):
                self._take(given)
            elif not self._tick(number, self._recorded.at(given.stamp), given):
                return
        self._comparison.aside[OTHERS] += sum(map(len, self._said.values()))

    def _inputs(self) -> Iterator[JogTaken | JogTick]:
        """Those of jogs whose beginning is recorded, and of which nothing is missing since."""
        expected, is_whole = -1, False
        for heard in self._recorded.of(JOG_INPUTS):
            is_whole = is_whole and heard.message.number == expected
            expected = heard.message.number + 1
            for given in heard.message.inputs:
                is_whole = is_whole or (isinstance(given, JogTaken) and given.begins)
                if is_whole:
                    yield given
                else:
                    self._comparison.aside[EARLIER] += isinstance(given, JogTick)

    def _take(self, taken: JogTaken) -> None:
        self._client = taken.client
        if taken.begins:
            self._jog, self._waiting = None, []
        if self._jog is None:
            self._waiting.append(taken)
        else:
            self._jog.on_command(taken.command, taken.now)

    def _tick(self, number: int, at: float, tick: JogTick) -> bool:
        """False at a difference."""
        jog = self._in_its_world(at, tick)
        not_ready = tick.why or (plain(tick.not_ready) if tick.not_ready else None)
        output = jog.step(tick.now, tick.stamp, tick.present, tick.age, tick.goal_is_active, not_ready)
        said = signed(output, self._client, tick.told_to)
        for topic, message in zip((JOINT_TARGETS, JOG_STATUS), said, strict=True):
            heard = self._said[topic.key].pop(tick.stamp, None)
            if heard is not None and not self._comparison.hold(topic.key, heard, heard.message, message):
                return False
        digest = digest_of(*said)
        if digest == tick.said:
            self._comparison.alike[PERIODS] += bool(digest)
        elif self._comparison.tolerance:
            self._comparison.aside[CHECKSUMS] += 1
        else:
            now = ", ".join(repr(each) for each in said if each is not None) or ABSENT
            was = f"others (BLAKE2 {tick.said})" if tick.said else ABSENT
            self._comparison.differ(PERIODS, number, at, "", was, now)
            return False
        return True

    def _in_its_world(self, at: float, tick: JogTick) -> Jog:
        world = None if tick.scene is None else self._scenes.world(tick.scene, f"the jog at {at:.3f} s")
        if self._jog is None:
            assert world is not None  # the first period of a jog names its scene
            self._jog = Jog(self._arm, self._kinematics, world)
            for taken in self._waiting:
                self._jog.on_command(taken.command, taken.now)
            self._waiting = []
        elif world is not None:
            self._jog.set_world(world)
        return self._jog
