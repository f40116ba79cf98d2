"""The story of an incident, from the messages around it: what led to it, the joints then, what followed. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import msgspec

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint, urdf_of
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.incidents import BLACK_BOX, Happening, Incident, time_of
from gemelo.libraries.runtime.actions import keys
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceEvent, DeviceMode, DeviceState
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.message import Message
from gemelo.schemas.planning import PlanResponse
from gemelo.schemas.system import LogLevel, LogRecord, ParameterChange
from gemelo.schemas.topics import EXCHANGES, FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND, JOINT_STATES
from gemelo.services.logger.incident_watch import STOPPED, Trigger

SECOND = 1_000_000_000  # [ns]
BEFORE, AFTER = 20, 20  # happenings that are told at most
LONGEST = 160  # letters of one
LONGEST_QUESTION = 90  # letters of what was asked
LATELY = 4  # happenings within which the same is not told again
TOLD_ELSEWHERE = ("goal ", BLACK_BOX)  # beginnings of lines of the log
SMALL = 5  # fields of a message that is told whole
NOTHING = ("", (), None)
UNTOLD = frozenset({"stamp", "request_id"})  # fields of a message that tell a person nothing
REASONS = frozenset({"why", "warning_why"})  # fields whose sentences stand in others
MANY = 8  # elements of a list that are written out
QUIET = frozenset({"state_validity", "ik", "fk", "device/echo"})  # questions that change nothing
GOALS = tuple(keys.goal_request(action).key for action in (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND))
ENDS = tuple(keys.ended_topic(action).key for action in (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND))
MOVING = 1e-3  # [rad/s] or [m/s]


def incident_of(trigger: Trigger, entries: Sequence[Entry]) -> Incident:
    """The incident, told from `entries` in the order of their arrival: latched ones first, then the last minute."""
    before = [entry for entry in entries if entry.arrival <= trigger.stamp]
    at = [((arrival - trigger.stamp) / SECOND, text) for arrival, text in _story(entries)]
    led = [each for each in at if each[0] <= 0.0][-BEFORE:]
    followed = [each for each in at if each[0] > 0.0][:AFTER]
    motion = _motion(before, trigger.stamp)
    return Incident(
        stamp=trigger.stamp,
        kind=trigger.kind,
        sentence=f"{time_of(trigger.stamp)}: {trigger.what}{f', {motion}' if motion else ''}",
        margins=tuple(_margins(before, trigger.joint)),
        story=tuple(Happening(at=round(seconds, 3), text=text) for seconds, text in (*led, *followed)),
    )


def _story(entries: Iterable[Entry]) -> Iterator[tuple[int, str]]:
    """What a person would tell, with its arrival [ns]; a line that is said again at once is told once."""
    mode: DeviceMode | None = None
    said: list[str] = []
    for entry in entries:
        message = entry.message
        if isinstance(message, DeviceState):
            if mode is not None and message.mode is not mode:
                yield entry.arrival, f"device: {mode.name} -> {message.mode.name}"
            mode = message.mode
        else:
            who, text = _told(entry)
            if text and text not in said[-LATELY:]:
                said.append(text)
                yield entry.arrival, _cut(f"{who}: {text}" if who else text)


def _told(entry: Entry) -> tuple[str, str]:
    """Who says it, and what; the gateway says an event of the device in its log too, and the end of a goal."""
    key, message = entry.topic.key, entry.message
    if key.startswith(EXCHANGES):
        return "", _exchange(key.removeprefix(EXCHANGES), message)
    if key in ENDS:
        return "", _end(message)
    match message:
        case DeviceEvent():
            return "device", message.event + (f": {message.detail}" if message.detail else "")
        case LogRecord() if message.level >= LogLevel.WARNING and not message.text.startswith(TOLD_ELSEWHERE):
            return message.node, message.text
        case ParameterChange():
            return message.node, f"{message.parameter.name} = {message.parameter.value}"
    return "", ""


def _exchange(key: str, exchange: Any) -> str:
    """A question and its answer; of a goal that was accepted its id, by which its end names it."""
    if key in QUIET:
        return ""
    question, answer = exchange.question, exchange.answer
    asked = f"{key}: {_cut(brief(question), LONGEST_QUESTION)}"
    if exchange.failure is not None:
        return f"{asked}: {exchange.failure.message}"
    if key in GOALS and question is not None:
        what = f"goal {question.goal_id[:8]} for {key.removesuffix('/goal')}"
        return f"{what} accepted" if answer.accepted else f"{what} refused: {answer.reason}"
    return f"{asked}: {_answer(answer)}"


def _answer(answer: Any) -> str:
    if isinstance(answer, PlanResponse):
        return f"refused: {answer.refusal.message}" if answer.refusal else f"planned, {answer.duration:.2f} s"
    accepted = getattr(answer, "accepted", None)
    if accepted is None:
        return brief(answer)
    return "accepted" if accepted else f"refused: {getattr(answer, 'reason', '') or 'no reason was given'}"


def _end(end: Any) -> str:
    reason = getattr(end.result, "error_string", "")
    status = GoalStatusCode(end.status).name.lower()
    return f"goal {end.goal_id[:8]} {status}" + (f": {reason}" if reason else "")


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


def _motion(before: Sequence[Entry], stamp: int) -> str:
    """In what goal it happened; empty where none was under way."""
    begun: dict[str, int] = {}
    for entry in before:
        message: Any = entry.message
        if entry.topic.key == EXCHANGES + GOALS[0] and message.answer is not None and message.answer.accepted:
            begun[message.question.goal_id] = entry.arrival
        elif entry.topic.key == ENDS[0] and entry.arrival < stamp:  # one that ends now is what this is about
            begun.pop(message.goal_id, None)
    if not begun:
        return ""
    goal, since = next(reversed(begun.items()))
    return f"{(stamp - since) / SECOND:.2f} s into goal {goal[:8]}"


def _margins(before: Sequence[Entry], joint: str) -> Iterator[str]:
    """A sentence on the joint concerned or the fastest one, and one each on steps, tool and queue."""
    newest: dict[type[Message], Any] = {}
    for entry in before:
        is_other = isinstance(entry.message, JointState) and entry.topic.key != JOINT_STATES.key
        is_after = isinstance(entry.message, DeviceState) and entry.message.mode in STOPPED
        if not is_other and not is_after:
            newest[type(entry.message)] = entry.message
    limits = _limits(newest.get(RobotDescription))
    if JointState in newest:
        yield from _joint_margin(newest[JointState], limits, joint)
    if StepErrors in newest and newest[StepErrors].error:
        errors: StepErrors = newest[StepErrors]
        worst, name = max((abs(error), name) for error, name in zip(errors.error, errors.name, strict=False))
        yield f"largest step error {worst:.2f} steps, of {name}"
    if StepLedger in newest and newest[StepLedger].name:
        ledger: StepLedger = newest[StepLedger]
        why = ledger.reason or (f"least of {ledger.doubtful}" if ledger.doubtful else "")
        sure = f"{ledger.arm_confidence:.1%} sure that no step was lost".replace("%", " %")
        yield _cut(f"{sure}, {why}" if why else sure)
    if StoppingDistance in newest and newest[StoppingDistance].is_known:
        stopping: StoppingDistance = newest[StoppingDistance]
        yield f"the tool would have gone {1e3 * stopping.distance:.0f} mm further in {stopping.duration:.2f} s"
    if DeviceState in newest:
        state: DeviceState = newest[DeviceState]
        yield f"{state.buffered:.2f} s of the path in the device's queue, round trip {1e3 * state.round_trip:.1f} ms"


def _joint_margin(state: JointState, limits: dict[str, UrdfJoint], joint: str) -> Iterator[str]:
    speeds = dict(zip(state.name, state.velocity, strict=False))
    values = dict(zip(state.name, state.position, strict=False))
    shares = {
        name: abs(speed) / limits[name].limit.velocity  # type: ignore[union-attr]
        for name, speed in speeds.items() if name in limits
    }  # fmt: skip
    fastest = max(shares, key=lambda name: shares[name], default="")
    chosen = joint if joint in values else fastest
    if chosen not in values or chosen not in limits:
        return
    drive = limits[chosen]
    limit = drive.limit
    assert limit is not None  # `_limits` takes no other
    factor, unit = (1e3, "mm") if drive.kind is JointKind.PRISMATIC else (math.degrees(1.0), "deg")
    value, speed = values[chosen], speeds.get(chosen, 0.0)
    how = f"at {shares.get(chosen, 0.0):.0%} of its top speed".replace("%", " %") if abs(speed) > MOVING else "at rest"
    text = f"{chosen} at {factor * value:.1f} {unit}, {how}"
    if drive.kind is not JointKind.CONTINUOUS:
        text += f", {factor * min(value - limit.lower, limit.upper - value):.1f} {unit} from its nearer limit"
    yield text


def _limits(description: RobotDescription | None) -> dict[str, UrdfJoint]:
    """The joints of the URDF that have a limit of speed."""
    if description is None:
        return {}
    try:
        model, _ = urdf_of(description.urdf)
    except DescriptionError:
        return {}
    return {each.name: each for each in model.joints if each.limit is not None and each.limit.velocity > 0.0}


def _cut(text: str, longest: int = LONGEST) -> str:
    line = " ".join(text.split())
    return line if len(line) <= longest else line[: longest - 4] + " ..."
