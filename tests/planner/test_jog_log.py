"""The inputs of a jog are published while they are wanted, and a gap in them shows in the numbers."""

from __future__ import annotations

from gemelo.schemas.joints import JointTargets
from gemelo.schemas.planning import JogCommand, JogInputs, JogStatus, JogTaken, JogTick, SceneVersion
from gemelo.services.planner.jog.jog_log import MOST, JogLog, digest_of

SCENE = SceneVersion(version=3, epoch=7)


def ticks(log: JogLog, count: int, first: int = 0, scene: SceneVersion = SCENE) -> None:
    for number in range(first, first + count):
        log.ticked(0.02 * number, number, None, float("inf"), False, "", scene, "", "")


def test_every_input_is_published_once_in_its_order():
    said: list[JogInputs] = []
    log = JogLog(said.append, lambda: True)
    log.taken(0.0, JogCommand(), "pad", True, 1)
    ticks(log, 2 * MOST)
    log.finish()
    log.finish()
    assert [message.number for message in said] == [0, 1, 2]
    first, *others = [each for message in said for each in message.inputs]
    assert first == JogTaken(now=0.0, command=JogCommand(), client="pad", begins=True)
    assert [each.stamp for each in others] == list(range(2 * MOST))


def test_a_scene_is_named_once_and_again_where_it_changes_or_a_jog_begins():
    said: list[JogInputs] = []
    log = JogLog(said.append, lambda: True)
    ticks(log, 2)
    ticks(log, 2, scene=SceneVersion(version=4, epoch=7))
    log.taken(1.0, JogCommand(), "pad", True, 1)
    ticks(log, 1, scene=SceneVersion(version=4, epoch=7))
    log.finish()
    named = [each.scene.version if each.scene else None for each in said[0].inputs if isinstance(each, JogTick)]
    assert named == [3, None, 4, None, 4]


def test_where_it_was_off_a_number_is_missing():
    said: list[JogInputs] = []
    is_on = True
    log = JogLog(said.append, lambda: is_on)
    ticks(log, MOST)
    is_on = False
    ticks(log, 3 * MOST)
    log.finish()
    is_on = True
    ticks(log, MOST)
    assert [message.number for message in said] == [0, 2]
    assert said[1].inputs[0].scene == SCENE  # what was named before may be what is missing


def test_a_checksum_tells_targets_from_statuses_and_either_from_nothing():
    targets, status = JointTargets(stamp=1), JogStatus(stamp=1)
    sums = {digest_of(None, None), digest_of(targets, None), digest_of(None, status), digest_of(targets, status)}
    assert len(sums) == 4
    assert digest_of(None, None) == ""
