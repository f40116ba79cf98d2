"""Goals that were recorded and are sent again: refused or without any effect, in five settings."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from random import Random

import gemelo
from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.schemas.actions import GoalRequest, GoalResponse
from gemelo.schemas.message import decode, encode
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY
from gemelo.tools.chaos.causes import cause_of
from gemelo.tools.chaos.invariants import STEPS, is_starved
from gemelo.tools.chaos.site import ChaosSite
from gemelo.tools.stack.stack import StackError

Send = Callable[[ChaosSite, GoalRequest], str]  # again; how it was answered

GOAL = keys.goal_request(FOLLOW_JOINT_TRAJECTORY)
TRIES = 3  # times that it is sent again, one after the other
WATCHED = 0.7  # [s] for which no step may come of it
STOPPED = 3.0  # [s] from the end of a move to rest
TO_END = 25.0  # [s] beyond a move's own time
TO_ANSWER = 3.0  # [s]
READY = 20.0  # [s]


def by_the_same_client(site: ChaosSite, request: GoalRequest) -> str:
    """From the session that has sent it before."""
    try:
        return _words(site.arm.node.call(GOAL, request, TO_ANSWER))
    except (RequestRefused, NoAnswer) as error:
        return f"refused: {error}"


def by_another_client(site: ChaosSite, request: GoalRequest) -> str:
    """From the session of a stranger, who has read it on the bus."""
    answer = site.bus.ask(GOAL.key, GoalRequest.__name__, encode(request), TO_ANSWER)
    if answer is None or not answer.ok:
        return "refused, or not answered"
    return _words(decode(GoalResponse, answer.payload))


def _words(answer: GoalResponse) -> str:
    return "accepted" if answer.accepted else f"refused: {answer.reason}"


def replayed_later(send: Send) -> Callable[[ChaosSite, Random], str]:
    """After its move has ended."""

    def begin(site: ChaosSite, random: Random) -> str:
        request = site.recorded_goal()
        _end(site.motion)
        return f"the goal again after its end: {_sent_at_rest(site, send, request)}"

    return begin


def replayed_after_a_restart(site: ChaosSite, random: Random) -> str:
    """Of the gateway, whose memory of goals has gone with it."""
    request = site.recorded_goal()
    site.restart("stepper_gateway")
    site.stack.wait_ready(READY, ("stepper_gateway",))
    send = random.choice((by_the_same_client, by_another_client))
    return f"the goal again after a restart of the gateway: {_sent_at_rest(site, send, request)}"


def replayed_after_a_stop(site: ChaosSite, random: Random) -> str:
    """Which has ended it, and refused what was asked for before."""
    request = site.recorded_goal()
    site.arm.stop()
    send = random.choice((by_the_same_client, by_another_client))
    return f"the goal again after a stop: {_sent_at_rest(site, send, request)}"


def replayed_during_another_move(site: ChaosSite, random: Random) -> str:
    """The other one arrives where it was sent, as if nothing had come."""
    request = site.recorded_goal()
    site.arm.stop()
    _end(site.motion)
    site.stands_within(STOPPED)
    other = site.person.start(random)
    send, answers = random.choice((by_the_same_client, by_another_client)), list[str]()
    for _ in range(TRIES):
        site.arm.wait_for(lambda: other.is_over or other.progress > random.random(), other.plan.duration)
        answers.append(send(site, request))
    site.found += disturbed(site, other)
    return f"the goal again during another move: {', '.join(sorted(set(answers)))}"


def disturbed(site: ChaosSite, motion: gemelo.Motion) -> list[Reason]:
    """What is wrong about the end of a move during which a goal of before was sent again."""
    try:
        motion.wait(motion.plan.duration + TO_END)
    except (gemelo.Error, TimeoutError) as error:
        why = cause_of(error)
        return [] if is_starved(why) else [because("chaos.replay.ended", why)]
    goal, at = motion.plan.end, motion.stopped_at
    away = [
        joint.name
        for joint in site.arm.description.joints
        if abs(at[joint.name] - goal[joint.name]) * abs(joint.steps.per_unit) > STEPS
    ]
    return [because("chaos.replay.elsewhere", joint=name) for name in away]


def _sent_at_rest(site: ChaosSite, send: Send, request: GoalRequest) -> str:
    """Sends it to an arm that stands; reports every step that comes of it."""
    if not site.stands_within(STOPPED):
        raise StackError(because("chaos.not_standing", time=STOPPED))
    answers = list[str]()
    for _ in range(TRIES):
        before = site.slots.size
        answers.append(send(site, request))
        site.pause(WATCHED)
        if steps := site.steps_since(before):
            site.found.append(because("chaos.replay.moved", answer=answers[-1], slots=steps))
    return ", ".join(sorted(set(answers)))


def _end(motion: gemelo.Motion) -> None:
    """Waits for it, however it ends: the campaign judges that."""
    with suppress(gemelo.Error, TimeoutError):
        motion.wait(motion.plan.duration + TO_END)
