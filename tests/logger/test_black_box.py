"""The black box: what it is saved for, what it holds, what it tells; and what it does where the disk is full."""

from __future__ import annotations

import resource
import signal
from pathlib import Path

import pytest
from mcap.reader import make_reader
from msgspec import Raw
from msgspec.structs import replace

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.incidents import (
    LONGEST,
    Incident,
    IncidentKind,
    black_boxes,
    in_language,
    one_line,
    read_incident,
)
from gemelo.libraries.recordings.reader import BadRecording
from gemelo.libraries.recordings.table import action_topics, exchanges_of, goal_request_of
from gemelo.schemas.actions import GoalResponse, GoalStatusCode
from gemelo.schemas.device import (
    DeviceCommandResponse,
    DeviceEvent,
    DeviceFault,
    DeviceMode,
    DeviceState,
    InjectKind,
    InjectRequest,
    InjectResponse,
)
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.message import Message
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryResult
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest, PlanResponse, Refusal
from gemelo.schemas.reasons import Reason, because, plain, remedy
from gemelo.schemas.roles import SERVICES
from gemelo.schemas.system import (
    Failure,
    LogLevel,
    LogRecord,
    NodeStatistics,
    Parameter,
    ParameterChange,
)
from gemelo.schemas.topics import (
    DESCRIPTION,
    DEVICE_EVENTS,
    DEVICE_INJECT,
    DEVICE_STATE,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_COMMANDS,
    JOINT_STATES,
    LOG,
    PARAMETER_CHANGES,
    PLAN,
    STATE_VALIDITY,
    STATISTICS,
    STEP_ERRORS,
    STEP_LEDGER,
    STOPPING_DISTANCE,
)
from gemelo.services.logger.black_box import MOST, MOST_BYTES, BlackBox, BlackBoxWriter
from gemelo.services.logger.incident_story import brief
from gemelo.services.planner.request.refusals import refusal_of
from gemelo.services.state_publisher.main import describe

SECOND = 1_000_000_000
START = 1_795_000_000 * SECOND
ROOT = Path(__file__).parents[2]
ENDED = action_topics(FOLLOW_JOINT_TRAJECTORY)[3]
GOAL = exchanges_of(goal_request_of(FOLLOW_JOINT_TRAJECTORY))


def require_one_sentence(incident: Incident) -> None:
    """The English sentences are those of the reasons beside them."""
    assert incident.sentence == str(incident.why)
    assert incident.margins == tuple(one_line(str(why)) for why in incident.margins_why)
    assert [each.text for each in incident.story] == [one_line(str(each.why)) for each in incident.story]


class Rig:
    """A black box whose clock is moved by hand."""

    def __init__(self, seconds: float = 60.0) -> None:
        self.box = BlackBox(seconds)
        self.now = START
        self.router = ""
        self.saved: list[tuple[Incident, tuple]] = []

    def say(self, topic, *messages: Message) -> None:
        for message in messages:
            self.box.on_message(topic, message, self.now)

    def state(self, mode: DeviceMode, **fields) -> None:
        self.say(DEVICE_STATE, DeviceState(mode=mode, **fields))

    def wait(self, seconds: float) -> None:
        """In steps of 0.5 s, as the logger's."""
        end = self.now + int(seconds * SECOND)
        while self.now < end:
            self.now = min(self.now + SECOND // 2, end)
            told = self.box.step(self.now, self.router)
            if told is not None:
                require_one_sentence(told[0])
                self.saved.append(told)

    def exchange(self, request, question, answer, **fields) -> None:
        topic = exchanges_of(request)
        self.say(topic, topic.message(question=question, answer=answer, **fields))

    def goal(self, goal_id: str, accepted: bool = True, why: Reason | None = None) -> None:
        question = GOAL.message.__annotations__["question"].__args__[0](goal_id=goal_id)
        reason = "" if accepted else str(why or "the device is not referenced")
        answer = GoalResponse(accepted=accepted, reason=reason, why=why)
        self.say(GOAL, GOAL.message(question=question, answer=answer))

    def end(self, goal_id: str, status: GoalStatusCode, reason: str = "", why: Reason | None = None) -> None:
        result = FollowJointTrajectoryResult(error_code=FollowErrorCode.DEVICE_FAILED, error_string=reason, why=why)
        self.say(ENDED, ENDED.message(goal_id=goal_id, status=status, result=result))

    @property
    def incident(self) -> Incident:
        (told,) = self.saved
        return told[0]

    @property
    def story(self) -> list[str]:
        return [each.text for each in self.incident.story]


@pytest.fixture
def rig() -> Rig:
    return Rig()


def stop_in_a_goal(rig: Rig) -> Incident:
    """An emergency stop in the middle of a goal."""
    rig.say(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")))
    rig.state(DeviceMode.IDLE)
    rig.exchange(
        PLAN,
        PlanRequest(goal=NamedGoal(name="left"), request_id="41839bcedab5"),
        PlanResponse(code=PlanCode.SUCCESS, duration=4.1),
    )
    rig.wait(1.0)
    rig.goal("4a682f77aa")
    rig.state(DeviceMode.RUN, buffered=0.31, round_trip=0.004)
    rig.say(
        JOINT_STATES, JointState(name=("brazo_joint", "antebrazo_joint"), position=(0.5, 0.1), velocity=(0.3, 0.01))
    )
    rig.say(JOINT_COMMANDS, JointState(name=("brazo_joint",), position=(9.9,), velocity=(9.9,)))
    rig.say(STEP_ERRORS, StepErrors(name=("brazo_joint", "antebrazo_joint"), error=(0.25, -1.75)))
    rig.say(STEP_LEDGER, StepLedger(name=("brazo_joint",), arm_confidence=0.994, doubtful="antebrazo_joint"))
    rig.say(STOPPING_DISTANCE, StoppingDistance(is_known=True, distance=0.012, duration=0.4))
    rig.wait(2.0)
    rig.exchange(DEVICE_INJECT, InjectRequest(kind=InjectKind.ESTOP, value=1.0), InjectResponse(accepted=True))
    rig.wait(0.5)
    rig.state(DeviceMode.ESTOP, fault=DeviceFault.EMERGENCY_STOP)
    rig.wait(0.5)
    rig.end("4a682f77aa", GoalStatusCode.ABORTED, "the device went into ESTOP")
    assert not rig.saved
    rig.wait(3.0)
    return rig.incident


def test_an_emergency_stop_in_the_middle_of_a_goal_is_told_with_what_led_to_it_and_what_followed(rig):
    incident = stop_in_a_goal(rig)
    assert incident.kind is IncidentKind.EMERGENCY_STOP
    assert incident.stamp == START + int(3.5 * SECOND)
    assert incident.sentence == "2026-11-18 11:06:43.500 UTC: emergency stop, 2.50 s into goal 4a682f77"
    assert rig.story == [
        "plan: goal named (name left): planned, 4.10 s", "goal 4a682f77 for follow_joint_trajectory accepted",
        "device: IDLE -> RUN", "device/inject: kind estop, value 1: accepted", "device: RUN -> ESTOP",
        "goal 4a682f77 aborted: the device went into ESTOP",
    ]  # fmt: skip
    assert [each.at for each in incident.story] == [-3.5, -2.5, -2.5, -0.5, 0.0, 0.5]
    limit = next(joint for joint in load_arm(ROOT / "urdf/rm1").joints if joint.name == "brazo_joint")
    assert incident.margins[0].startswith("brazo_joint at 28.6 deg, at ")
    assert f"{57.29578 * (limit.upper - 0.5):.1f} deg from its nearer limit" in incident.margins[0]
    assert incident.margins[1:] == (
        "largest step error 1.75 steps, of antebrazo_joint",
        "99.4 % sure that no step was lost, least of antebrazo_joint",
        "the tool would have gone 12 mm further in 0.40 s",
        "0.31 s of the path in the device's queue, round trip 4.0 ms",
    )


def test_a_story_is_data_with_the_values_of_what_happened(rig):
    incident = stop_in_a_goal(rig)
    assert incident.why == because(
        "incident.at",
        because("incident.in_goal", because("incident.emergency_stop"), elapsed=2.5, goal="4a682f77"),
        time="2026-11-18 11:06:43.500 UTC",
    )
    goal, asked = "4a682f77", "goal named (name left)"
    assert [each.why for each in incident.story] == [
        because("story.request", because("story.planned", duration=4.1), request="plan", question=asked),
        because("story.goal.accepted", goal=goal, action="follow_joint_trajectory"),
        because("story.mode", before="IDLE", after="RUN"),
        because("story.request", because("story.accepted"), request="device/inject", question="kind estop, value 1"),
        because("story.mode", before="RUN", after="ESTOP"),
        because("story.goal.ended.why", plain("the device went into ESTOP"), goal=goal, status="ABORTED"),
    ]  # fmt: skip
    limit = next(joint for joint in load_arm(ROOT / "urdf/rm1").joints if joint.name == "brazo_joint")
    joint, *others = incident.margins_why
    assert joint.values == {"joint": "brazo_joint", "position": 0.5, "unit": "rad", "room": limit.upper - 0.5}
    assert [each.code for each in (joint, *joint.causes)] == ["incident.joint.limited", "incident.speed"]
    assert others == [
        because("incident.step_error", error=1.75, joint="antebrazo_joint"),
        because("incident.sure.least", confidence=0.994, joint="antebrazo_joint"),
        because("incident.further", distance=0.012, duration=0.4),
        because("incident.queue", buffered=0.31, round_trip=0.004),
    ]


def test_a_story_is_read_in_spanish(rig):
    incident = in_language(stop_in_a_goal(rig), "es")
    assert incident.sentence == (
        "2026-11-18 11:06:43.500 UTC: parada de emergencia, a los 2.50 s del movimiento 4a682f77"
    )
    assert [each.text for each in incident.story] == [
        "plan: goal named (name left): planificado, 4.10 s",
        "movimiento 4a682f77 de follow_joint_trajectory aceptado",
        "equipo: en reposo -> en movimiento",
        "device/inject: kind estop, value 1: aceptado",
        "equipo: en movimiento -> en parada de emergencia",
        "el movimiento 4a682f77 terminó (antes de su meta): the device went into ESTOP",
    ]
    assert incident.margins[0].startswith("brazo_joint en 28.6 deg, al ")
    assert incident.margins[0].endswith(" deg de su límite más cercano")
    assert incident.margins[1:] == (
        "el mayor error de pasos: 1.75, de antebrazo_joint",
        "99.4 % de certeza de que no se perdió ningún paso; la menor, la de antebrazo_joint",
        "la herramienta habría avanzado aún 12 mm en 0.40 s",
        "0.31 s de trayectoria en la cola del equipo; ida y vuelta 4.0 ms",
    )


def test_the_reasons_of_others_stand_in_a_story_as_they_were_sent(rig):
    beyond = because(
        "goal.limit.position", remedy("stay_within", lower=-2.0, upper=2.0, unit="rad"),
        joint="brazo_joint", value=3.0, limit=2.0, side="upper", unit="rad",
    )  # fmt: skip
    refusal = refusal_of(beyond, "joint limit")
    rig.exchange(PLAN, PlanRequest(goal=NamedGoal(name="left")), PlanResponse(refusal=refusal))
    busy = because("ended.unexplained")
    rig.exchange(PLAN, PlanRequest(), None, failure=Failure(message=str(busy), why=busy))
    rig.goal("123456789", accepted=False, why=beyond)
    silent = because("device.silent", device="rm1", time=2.0)
    rig.say(DEVICE_EVENTS, DeviceEvent(event="sensors_silent", detail=str(silent), why=silent))
    rig.say(LOG, LogRecord(node="planner", level=LogLevel.WARNING, text="out of memory"))
    rig.say(PARAMETER_CHANGES, ParameterChange(node="planner", parameter=Parameter(name="attempts", value=3)))
    rig.say(STEP_LEDGER, StepLedger(name=("brazo_joint",), reason=str(silent), why=silent))
    rig.end("4a682f77aa", GoalStatusCode.ABORTED, str(beyond), beyond)
    rig.wait(5.0)
    assert rig.incident.why.causes == (because("incident.aborted", beyond, goal="4a682f77"),)
    assert rig.incident.margins_why == (because("incident.sure.because", silent, confidence=0.0),)
    refused = because("story.refused", replace(beyond, remedies=()))
    assert [each.why for each in rig.incident.story] == [
        because("story.request", refused, request="plan", question="goal named (name left)"),
        because("story.request", busy, request="plan", question=""),
        because("story.goal.refused", beyond, goal="12345678", action="follow_joint_trajectory"),
        because("story.device", because("story.event.detail", silent, event="sensors_silent")),
        because("story.node", plain("out of memory"), node="planner"),
        because("story.node", because("story.parameter", parameter="attempts", value=3), node="planner"),
        because("story.goal.ended.why", beyond, goal="4a682f77", status="ABORTED"),
    ]  # fmt: skip
    assert rig.story[0] == f"plan: goal named (name left): refused: {refusal.message}"


def test_a_device_that_was_stopped_before_the_logger_heard_it_is_no_incident(rig):
    rig.state(DeviceMode.ESTOP, fault=DeviceFault.EMERGENCY_STOP)
    rig.state(DeviceMode.FAULT, fault=DeviceFault.LIMIT_SWITCH)
    rig.wait(20.0)
    assert not rig.saved


def test_a_fault_names_its_joint(rig):
    rig.say(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")))
    rig.say(JOINT_STATES, JointState(name=("brazo_joint", "antebrazo_joint"), position=(0.5, 0.1), velocity=(0.3, 0.0)))
    rig.state(DeviceMode.RUN)
    rig.state(DeviceMode.FAULT, fault=DeviceFault.LIMIT_SWITCH, fault_joint="antebrazo_joint")
    rig.wait(3.0)
    assert rig.incident.kind is IncidentKind.FAULT
    assert 'LIMIT_SWITCH at joint "antebrazo_joint"' in rig.incident.sentence
    assert rig.incident.margins[0].startswith("antebrazo_joint at 5.7 deg, at rest, ")


@pytest.mark.parametrize(
    ("status", "count"),
    [
        (GoalStatusCode.ABORTED, 1), (GoalStatusCode.CANCELED, 0), (GoalStatusCode.PREEMPTED, 0),
        (GoalStatusCode.SUCCEEDED, 0),
    ],
)  # fmt: skip
def test_only_a_goal_that_ended_against_everybodys_will_is_an_incident(rig, status, count):
    rig.goal("4a682f77aa")
    rig.wait(1.0)
    rig.end("4a682f77aa", status, "path tolerance of brazo_joint")
    rig.wait(5.0)
    assert len(rig.saved) == count
    if count:
        assert rig.incident.sentence.endswith(
            "goal 4a682f77 was aborted: path tolerance of brazo_joint, 1.00 s into goal 4a682f77"
        )


def test_an_abort_that_is_said_before_its_cause_is_told_as_that(rig):
    rig.state(DeviceMode.RUN)
    rig.goal("4a682f77aa")
    rig.wait(1.0)
    rig.end("4a682f77aa", GoalStatusCode.ABORTED, "the device stopped")
    rig.now += SECOND // 50
    rig.state(DeviceMode.ESTOP, fault=DeviceFault.EMERGENCY_STOP)
    rig.wait(4.0)
    assert rig.incident.kind is IncidentKind.EMERGENCY_STOP
    assert rig.incident.sentence.endswith("emergency stop, 1.00 s into goal 4a682f77")
    assert rig.incident.stamp == START + SECOND


def test_a_reboot_is_one_and_a_refused_goal_is_told(rig):
    rig.goal("123456789", accepted=False)
    rig.say(DEVICE_EVENTS, DeviceEvent(device="rm1", event="connected"))
    rig.say(DEVICE_EVENTS, DeviceEvent(device="rm1", event="rebooted", detail="watchdog"))
    rig.wait(4.0)
    assert rig.incident.kind is IncidentKind.REBOOT
    assert "the device has rebooted: watchdog" in rig.incident.sentence
    assert rig.story[0] == "goal 12345678 for follow_joint_trajectory refused: the device is not referenced"


def beat(rig: Rig, seconds: float, *nodes: str, started: int = START) -> None:
    for _ in range(int(seconds)):
        rig.say(STATISTICS, *(NodeStatistics(node=node, started=started) for node in nodes))
        rig.wait(1.0)


def test_a_service_that_falls_silent_is_one_and_a_script_that_ends_is_none(rig):
    beat(rig, 5, "planner", "stepper_gateway", "my_script")
    beat(rig, 8, "stepper_gateway")
    assert rig.incident.kind is IncidentKind.LOST
    assert "planner has not been heard for 4." in rig.incident.sentence


def test_a_silence_of_everybody_is_ours(rig):
    """A machine that slept, or a logger that was frozen: nobody else has failed."""
    beat(rig, 5, "planner", "stepper_gateway")
    rig.wait(30.0)
    beat(rig, 5, "planner", "stepper_gateway")
    assert not rig.saved


def test_a_service_that_is_back_within_a_second_has_failed_too(rig):
    beat(rig, 5, "planner", started=START - 50 * SECOND)
    beat(rig, 4, "planner", started=START + 3 * SECOND)
    assert rig.incident.kind is IncidentKind.LOST
    assert rig.incident.stamp == START + 3 * SECOND
    assert "planner had ended, and was started again" in rig.incident.sentence


def test_a_service_whose_silence_was_told_is_not_told_again_when_it_is_back(rig):
    beat(rig, 3, "planner", "stepper_gateway")
    beat(rig, 20, "stepper_gateway")
    assert len(rig.saved) == 1
    again = rig.now
    for _ in range(20):
        rig.say(STATISTICS, NodeStatistics(node="planner", started=again))
        beat(rig, 1, "stepper_gateway")
    assert len(rig.saved) == 1


@pytest.mark.parametrize("node", sorted(set(SERVICES) - {"logger", "stepper_gateway"}))
def test_every_service_is_missed_and_the_loggers_own_voice_hides_nobody_and_nothing(rig, node):
    beat(rig, 5, "logger", "stepper_gateway", node)
    beat(rig, 8, "logger")  # the router is away: it hears itself alone
    assert not rig.saved
    beat(rig, 8, "logger", "stepper_gateway")
    assert f"{node} has not been heard for 4." in rig.incident.sentence


def test_whoever_is_back_first_after_a_silence_of_everybody_accuses_nobody(rig):
    beat(rig, 5, "planner", "stepper_gateway")
    rig.wait(6.0)
    beat(rig, 3, "stepper_gateway")
    beat(rig, 9, "planner", "stepper_gateway")
    assert not rig.saved


def test_a_router_that_is_started_again_is_one_and_none_of_its_nodes(rig):
    rig.router = "first"
    beat(rig, 5, "planner", "stepper_gateway")
    rig.router = ""
    beat(rig, 6, "logger")
    rig.router = "second"
    beat(rig, 9, "planner", "stepper_gateway", "logger")
    assert rig.incident.kind is IncidentKind.LOST
    assert rig.incident.stamp == START + 5 * SECOND
    assert "the router had ended, and was started again: nothing was heard for up to 6.5 s" in rig.incident.sentence


def test_a_router_that_was_out_of_reach_has_not_failed(rig):
    rig.router = "first"
    beat(rig, 5, "planner")
    rig.router = ""
    rig.wait(6.0)
    rig.router = "first"
    beat(rig, 9, "planner")
    assert not rig.saved


@pytest.mark.parametrize("away", [1, 9])
def test_a_link_to_the_device_that_is_lost_at_rest_is_one_also_where_it_is_back_at_once(rig, away):
    beat(rig, 2, "stepper_gateway")
    rig.say(DEVICE_EVENTS, DeviceEvent(event="disconnected", detail="the MQTT broker is gone"))
    beat(rig, away, "stepper_gateway")
    rig.say(DEVICE_EVENTS, DeviceEvent(event="connected"))
    beat(rig, 20, "stepper_gateway")
    assert rig.incident.stamp == START + 2 * SECOND
    assert "has lost its link to the device: the MQTT broker is gone" in rig.incident.sentence


def test_a_link_that_is_lost_while_the_twin_ends_or_takes_a_goal_along_is_no_second_one(rig):
    beat(rig, 2, "stepper_gateway")
    rig.say(DEVICE_EVENTS, DeviceEvent(event="disconnected", detail="the MQTT broker is gone"))
    rig.wait(20.0)
    assert not rig.saved
    rig.goal("123456789")
    rig.end("123456789", GoalStatusCode.ABORTED, "no link to the device")
    beat(rig, 20, "stepper_gateway")
    assert rig.incident.kind is IncidentKind.ABORT


def test_what_follows_within_3_s_is_of_the_same_story_and_files_are_10_s_apart(rig):
    rig.state(DeviceMode.RUN)
    for _ in range(30):
        rig.state(DeviceMode.FAULT, fault=DeviceFault.LIMIT_SWITCH)
        rig.wait(1.0)
        rig.state(DeviceMode.IDLE)
    assert len(rig.saved) == 3
    assert [len([text for text in told[0].story if text.text.endswith("-> FAULT")]) for told in rig.saved] == [
        3,
        13,
        19,
    ]


def test_it_holds_the_last_seconds_and_the_latched_messages_of_before(rig):
    rig.say(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")))
    rig.state(DeviceMode.RUN)
    for index in range(200):
        rig.say(JOINT_STATES, JointState(name=("brazo_joint",), position=(float(index),)))
        rig.wait(0.5)
    rig.state(DeviceMode.FAULT, fault=DeviceFault.INTERNAL)
    rig.wait(3.0)
    ((_, entries),) = rig.saved
    assert entries[0].topic is DESCRIPTION
    positions = [entry.message.position[0] for entry in entries if entry.topic is JOINT_STATES]
    assert positions[0] >= 85.0  # 3 s after 100 s, less 60 s: from second 43 on
    assert positions[-1] == 199.0


def test_its_memory_is_bounded(rig):
    state = JointState(name=("brazo_joint",), position=(0.0,))
    rig.say(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")))
    for _ in range(MOST + 10):
        rig.box.on_message(JOINT_STATES, state, rig.now)
    rig.state(DeviceMode.RUN)
    rig.state(DeviceMode.FAULT, fault=DeviceFault.INTERNAL)
    rig.wait(3.0)
    ((_, entries),) = rig.saved
    assert len(entries) == MOST + 1
    assert entries[0].topic is DESCRIPTION


def test_large_messages_push_out_the_oldest_before_they_fill_the_memory(rig):
    large = DESCRIPTION.message(urdf="x" * (MOST_BYTES // 10))
    for _ in range(25):
        rig.say(DESCRIPTION, large)
        rig.wait(1.0)
    rig.state(DeviceMode.RUN)
    rig.state(DeviceMode.FAULT, fault=DeviceFault.INTERNAL)
    rig.wait(3.0)
    ((_, entries),) = rig.saved
    assert 9 <= sum(entry.topic is DESCRIPTION for entry in entries) <= 11


def test_a_story_is_bounded_repeats_nothing_and_leaves_questions_out(rig):
    rig.state(DeviceMode.RUN)
    validity = exchanges_of(STATE_VALIDITY)
    for index in range(100):
        rig.say(LOG, LogRecord(node="planner", level=LogLevel.WARNING, text="word " * 100 + str(index % 2)))
        rig.say(LOG, LogRecord(node="planner", level=LogLevel.INFO, text="nothing"))
        rig.say(validity, validity.message())
        rig.say(PARAMETER_CHANGES, ParameterChange(node="planner", parameter=Parameter(name="x", value=index)))
    rig.say(exchanges_of(PLAN), exchanges_of(PLAN).message(question=PlanRequest(), failure=Failure(message="too busy")))
    rig.state(DeviceMode.FAULT, fault=DeviceFault.INTERNAL)
    rig.wait(3.0)
    assert len(rig.story) == 20
    assert all(len(text) <= LONGEST for text in rig.story)
    assert rig.story[-2:] == ["plan: goal named (name ): too busy", "device: RUN -> FAULT"] or rig.story[-2].endswith(
        ": too busy"
    )
    assert "planner: x = 99" in rig.story
    assert not any("nothing" in text or "state_validity" in text for text in rig.story)


def test_a_message_of_a_users_own_request_is_told_as_it_is():
    assert brief({"value": 1.23456, "name": "cup"}) == "value 1.235, name cup"
    assert brief(tuple(range(20))).endswith("... 20]")
    assert brief(PlanResponse(refusal=Refusal(check="reach"))) == "refusal check reach"
    assert brief(DeviceCommandResponse(sent=True)) == "accepted False, sent True, mode 0"
    assert brief(Raw(b"\xc0"))


def box_of(rig: Rig) -> tuple[Incident, tuple]:
    rig.say(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")))
    for _ in range(50):
        rig.say(JOINT_STATES, JointState(stamp=rig.now, name=("brazo_joint",), position=(0.1,), velocity=(0.0,)))
        rig.wait(0.02)
    rig.state(DeviceMode.RUN)
    rig.state(DeviceMode.FAULT, fault=DeviceFault.INTERNAL)
    told = rig.box.finish(rig.now)
    assert told is not None  # a logger that ends waits for nothing
    return told


def test_a_file_is_read_by_another_reader_and_listed_by_its_story(rig, tmp_path):
    said: list[str] = []
    incident, entries = box_of(rig)
    writer = BlackBoxWriter("rm1", {"gemelo": {"robot": "rm1"}}, said.append)
    for late in range(4):
        writer.save(replace(incident, stamp=incident.stamp + late * SECOND), entries, tmp_path / "box", keep=3)
    writer.wait()
    found = black_boxes(tmp_path / "box", "rm1")
    assert [each.incident.stamp - incident.stamp for each in found] == [3 * SECOND, 2 * SECOND, SECOND]
    assert oct((tmp_path / "box").stat().st_mode & 0o777) == "0o700"
    assert {oct(path.stat().st_mode & 0o777) for path in (tmp_path / "box").glob("**/*.mcap")} == {"0o600"}
    assert not black_boxes(tmp_path / "box", "parol6")
    assert len(said) == 4
    assert "`gemelo blackbox open`" in said[0]
    with Path(found[0].path).open("rb") as file:
        reader = make_reader(file)
        topics = [channel.topic for _, channel, _ in reader.iter_messages()]
        names = {record.name for record in reader.iter_metadata()}
    assert topics.count("joint_states") == 50
    assert {"gemelo", "incident", "robot"} <= names
    (tmp_path / "other.mcap").write_bytes(b"")
    with pytest.raises(BadRecording, match="empty"):
        read_incident(tmp_path / "other.mcap")


def test_many_incidents_of_one_kind_push_out_none_of_another(rig, tmp_path):
    """Forged statistics made services seem lost, and pushed out the black box of a real fault."""
    incident, entries = box_of(rig)
    writer = BlackBoxWriter("rm1", {}, lambda text: None)
    writer.save(incident, entries, tmp_path, keep=3)
    for late in range(1, 6):
        lost = replace(incident, stamp=incident.stamp + late * SECOND, kind=IncidentKind.LOST)
        writer.save(lost, entries, tmp_path, keep=3)
    writer.wait()
    assert [each.incident.kind for each in black_boxes(tmp_path, "rm1")] == [IncidentKind.LOST] * 3 + [incident.kind]


def test_a_full_disk_is_said_and_leaves_no_half_file(rig, tmp_path):
    said: list[str] = []
    told = box_of(rig)
    writer = BlackBoxWriter("rm1", {}, said.append)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
        writer.save(*told, tmp_path, keep=3)
        writer.wait()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert "cannot be written" in said[0]
    assert not list(tmp_path.glob("*.mcap"))
