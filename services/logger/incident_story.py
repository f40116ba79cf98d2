"""The story of an incident, from the messages around it: what led to it, the joints then, what followed. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import msgspec
from msgspec.structs import replace

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.incidents import BLACK_BOX, Happening, Incident, one_line, time_of
from gemelo.libraries.runtime.actions import keys
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceEvent, DeviceMode, DeviceState
from gemelo.schemas.planning import PlanResponse, Refusal
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.system import LogLevel, LogRecord, ParameterChange
from gemelo.schemas.topics import EXCHANGES, FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND
from gemelo.services.logger.incident_margins import margins_of
from gemelo.services.logger.incident_watch import SHORT, Trigger, reason_of, why_of_end

SECOND = 1_000_000_000  # [ns]
BEFORE, AFTER = 20, 20  # happenings that are told at most
LONGEST_QUESTION = 90  # letters of a request
LATELY = 4  # happenings within which the same is not told again
TOLD_ELSEWHERE = ("goal ", BLACK_BOX)  # beginnings of lines of the log
SMALL = 5  # fields of a message that is told whole
NOTHING = ("", (), None)
UNTOLD = frozenset({"stamp", "request_id"})  # fields of a message that tell a person nothing
REASONS = frozenset({"why", "warning_why"})  # fields whose sentences stand in others
REPORTED = frozenset({"story.device", "story.node"})  # codes that name who has reported what
MANY = 8  # elements of a list that are written out
QUIET = frozenset({"state_validity", "ik", "fk", "device/echo"})  # questions that change nothing
GOALS = tuple(keys.goal_request(action).key for action in (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND))
ENDS = tuple(keys.ended_topic(action).key for action in (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND))


def incident_of(trigger: Trigger, entries: Sequence[Entry]) -> Incident:
    """The incident, told from `entries` in the order of their arrival: latched ones first, then the last minute."""
    before = [entry for entry in entries if entry.arrival <= trigger.stamp]
    at = [((arrival - trigger.stamp) / SECOND, what) for arrival, what in _story(entries)]
    led = [each for each in at if each[0] <= 0.0][-BEFORE:]
    followed = [each for each in at if each[0] > 0.0][:AFTER]
    why = because("incident.at", _in_goal(trigger, before), time=time_of(trigger.stamp))
    margins = tuple(margins_of(before, trigger.joint))
    return Incident(
        stamp=trigger.stamp,
        kind=trigger.kind,
        sentence=str(why),
        margins=tuple(one_line(str(each)) for each in margins),
        story=tuple(
            Happening(at=round(seconds, 3), text=one_line(str(what)), why=what) for seconds, what in (*led, *followed)
        ),
        why=why,
        margins_why=margins,
    )


def _story(entries: Iterable[Entry]) -> Iterator[tuple[int, Reason]]:
    """What a person would tell, with its arrival [ns]; a line that comes again at once is told once."""
    mode: DeviceMode | None = None
    told: list[str] = []
    for entry in entries:
        message = entry.message
        if isinstance(message, DeviceState):
            if mode is not None and message.mode is not mode:
                yield entry.arrival, because("story.mode", before=mode.name, after=message.mode.name)
            mode = message.mode
        elif (what := _told(entry)) is not None:
            text = str(what.causes[0] if what.code in REPORTED else what)
            if text not in told[-LATELY:]:
                told.append(text)
                yield entry.arrival, what


def _told(entry: Entry) -> Reason | None:
    """What happened; the gateway reports an event of the device in its log too, and the end of a goal."""
    key, message = entry.topic.key, entry.message
    if key.startswith(EXCHANGES):
        return _exchange(key.removeprefix(EXCHANGES), message)
    if key in ENDS:
        return _end(message)
    match message:
        case DeviceEvent():
            return because("story.device", _event(message))
        case LogRecord() if message.level >= LogLevel.WARNING and not message.text.startswith(TOLD_ELSEWHERE):
            return because("story.node", plain(one_line(message.text)), node=message.node)
        case ParameterChange():
            parameter = message.parameter
            change = because("story.parameter", parameter=parameter.name, value=parameter.value)
            return because("story.node", change, node=message.node)
    return None


def _event(event: DeviceEvent) -> Reason:
    detail = reason_of(event.detail, event.why)
    if detail is None:
        return because("story.event", event=event.event)
    return because("story.event.detail", detail, event=event.event)


def _exchange(key: str, exchange: Any) -> Reason | None:
    """A request and its answer; of a goal that was accepted its id, by which its end names it."""
    if key in QUIET:
        return None
    question, answer = exchange.question, exchange.answer
    if exchange.failure is not None:
        answered = reason_of(exchange.failure.message, exchange.failure.why) or because("ended.unexplained")
    elif key in GOALS and question is not None:
        goal, action = question.goal_id[:SHORT], key.removesuffix("/goal")
        if answer.accepted:
            return because("story.goal.accepted", goal=goal, action=action)
        return because("story.goal.refused", _why_not(answer), goal=goal, action=action)
    else:
        answered = _answer(answer)
    return because("story.request", answered, request=key, question=one_line(brief(question), LONGEST_QUESTION))


def _answer(answer: Any) -> Reason:
    if isinstance(answer, PlanResponse):
        if answer.refusal:
            return because("story.refused", _of_refusal(answer.refusal))
        return because("story.planned", duration=answer.duration)
    accepted = getattr(answer, "accepted", None)
    if accepted is None:
        return plain(one_line(brief(answer)))
    return because("story.accepted") if accepted else because("story.refused", _why_not(answer))


def _why_not(answer: Any) -> Reason:
    """Of an answer that is no."""
    found = reason_of(getattr(answer, "reason", ""), getattr(answer, "why", None))
    return found or because("ended.unexplained")


def _of_refusal(refusal: Refusal) -> Reason:
    """Of a plan, without what would do."""
    return replace(refusal.why, remedies=()) if refusal.why is not None else plain(refusal.message)


def _end(end: Any) -> Reason:
    goal, status = end.goal_id[:SHORT], GoalStatusCode(end.status).name
    why = why_of_end(end)
    if why is None:
        return because("story.goal.ended", goal=goal, status=status)
    return because("story.goal.ended.why", why, goal=goal, status=status)


def brief(value: object) -> str:
    """What a message says, on one line: of a large one only what is not as it is by default."""
    if isinstance(value, msgspec.Struct):
        fields = {each.name: each.default for each in msgspec.structs.fields(value) if each.name not in REASONS}
        is_small = len(fields) <= SMALL
        said = {name: getattr(value, name) for name in fields}
        said = {name: item for name, item in said.items() if item not in NOTHING and (is_small or item != fields[name])}
        named = ", ".join(f"{name} {brief(item)}" for name, item in said.items() if name not in UNTOLD)
        tag = type(value).__struct_config__.tag
        return " ".join(part for part in (str(tag) if tag else "", f"({named})" if tag and named else named) if part)
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, tuple | list):
        inner = ", ".join(brief(item) for item in value[:MANY])
        return f"[{inner}, ... {len(value)}]" if len(value) > MANY else f"[{inner}]"
    if isinstance(value, dict):
        return ", ".join(f"{name} {brief(item)}" for name, item in list(value.items())[:MANY])
    return str(value)


def _in_goal(trigger: Trigger, before: Sequence[Entry]) -> Reason:
    """What happened, and in what goal, where one was under way."""
    begun: dict[str, int] = {}
    for entry in before:
        message: Any = entry.message
        if entry.topic.key == EXCHANGES + GOALS[0] and message.answer is not None and message.answer.accepted:
            begun[message.question.goal_id] = entry.arrival
        elif entry.topic.key == ENDS[0] and entry.arrival < trigger.stamp:  # one that ends now is what this is about
            begun.pop(message.goal_id, None)
    if not begun:
        return trigger.what
    goal, since = next(reversed(begun.items()))
    elapsed = (trigger.stamp - since) / SECOND
    return because("incident.in_goal", trigger.what, elapsed=elapsed, goal=goal[:SHORT])
