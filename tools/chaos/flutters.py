"""Stops, holds and resumes in quick turns, and a goal and a stop in one breath: each by the arm's own client."""

from __future__ import annotations

from contextlib import suppress
from random import Random

import msgspec

import gemelo
from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.schemas.actions import GoalRequest, GoalStatusCode, ResultRequest
from gemelo.schemas.device import DeviceStopRequest
from gemelo.schemas.message import encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import DEVICE_STOP, FOLLOW_JOINT_TRAJECTORY
from gemelo.tools.chaos.invariants import is_starved
from gemelo.tools.chaos.person import random_goal
from gemelo.tools.chaos.site import ChaosSite

HOLDS, STOPS, BREATHS = (8, 30), (4, 8), (2, 5)  # how many, from and to
TURN, RUN, BREATH = 0.06, 0.4, 0.03  # [s] at most: between hold and resume; of a move; between a goal and its stop
SLOWLY = 0.1  # of the planned speed: a goal that were carried out would move for long
LONG = 6.0  # [s] such a goal takes at least
STOPPED = 3.0  # [s] from a stop's answer to rest, on a busy machine
TO_ANSWER = 3.0  # [s]
TO_END = 10.0  # [s] for a stopped motion to be over


def fluttering_holds(site: ChaosSite, random: Random) -> str:
    """Many holds and resumes; the last one is a resume. What ended the move meanwhile resumes nothing."""
    count = random.randint(*HOLDS)
    for _ in range(count):
        site.arm.hold()
        site.pause(random.uniform(0.0, TURN))
        with suppress(gemelo.Refused):
            site.arm.resume()
        site.pause(random.uniform(0.0, TURN))
    return f"{count} holds and resumes in quick turns"


def fluttering_stops(site: ChaosSite, random: Random) -> str:
    """Many moves, each stopped soon after it began; every one of them ends, and none as if it had arrived."""
    count = random.randint(*STOPS)
    site.arm.stop()
    for _ in range(count):
        site.stands_within(STOPPED)
        motion = site.person.start(random)
        site.pause(random.uniform(0.0, RUN))
        site.arm.stop()
        site.found += unended(motion)
    return f"{count} moves, each stopped at once"


def unended(motion: gemelo.Motion) -> list[Reason]:
    """What is wrong about the end of a motion that was stopped soon after its begin."""
    try:
        motion.wait(TO_END)
    except TimeoutError:
        return [because("chaos.stop.unended", time=TO_END)]
    except gemelo.Error:
        return []
    is_early = motion.status is GoalStatusCode.SUCCEEDED and motion.elapsed < motion.plan.duration / 2.0
    return [because("chaos.stop.succeeded", time=motion.elapsed)] if is_early else []


def goal_and_stop(site: ChaosSite, random: Random) -> str:
    """A goal and, before it is answered, a stop of the same client: the arm stands, and the goal does not succeed."""
    count = random.randint(*BREATHS)
    for _ in range(count):
        site.arm.stop()
        if not site.stands_within(STOPPED):
            site.found.append(because("chaos.stop.goes_on", time=STOPPED))
        _breath(site, random, long_goal(site, random))
    return f"a goal and a stop in one breath, {count} times"


def long_goal(site: ChaosSite, random: Random) -> FollowJointTrajectoryGoal:
    """A goal that would take longer than a stop; raises `gemelo.Error` where none of some can be planned."""
    error: gemelo.Error | None = None
    for _ in range(20):
        try:
            plan = site.arm.plan(joints=random_goal(site.arm.description, random), speed=SLOWLY)
        except gemelo.Refused as refused:
            error = refused
            continue
        if plan.duration > LONG:
            return FollowJointTrajectoryGoal(trajectory=plan.trajectory)
    raise error or gemelo.Error(because("chaos.no_long_plan", time=LONG))


def _breath(site: ChaosSite, random: Random, goal: FollowJointTrajectoryGoal) -> None:
    node, goal_id = site.arm.node, f"{random.getrandbits(64):016x}"
    question = GoalRequest(goal_id=goal_id, client=node.token, goal=msgspec.Raw(encode(goal)))
    node.ask(keys.goal_request(FOLLOW_JOINT_TRAJECTORY), question, TO_ANSWER, _nothing)
    if random.random() < 0.5:
        site.pause(random.uniform(0.0, BREATH))
    try:
        node.call(DEVICE_STOP, DeviceStopRequest(), TO_ANSWER)
    except (RequestRefused, NoAnswer) as error:
        site.found += [] if is_starved(error.reason) else [because("chaos.breath.unanswered", error.reason)]
    if not site.stands_within(STOPPED):
        site.found.append(because("chaos.breath.goes_on", time=STOPPED))
    with suppress(RequestRefused, NoAnswer):
        asked = ResultRequest(goal_id=goal_id, wait=1.0)
        if node.call(keys.result_request(FOLLOW_JOINT_TRAJECTORY), asked).status is GoalStatusCode.SUCCEEDED:
            site.found.append(because("chaos.breath.succeeded"))


def _nothing() -> None: ...
