"""Joins the core to the node and the link: carries things in and out, decides nothing."""

from __future__ import annotations

import itertools
import threading
from typing import Any

from msgspec.structs import replace

from gemelo.libraries.runtime.actions.server import ActionServer, GoalDecision, accept, refuse
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.parameters import ParameterSet
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.control import ControlAnswer, ControlGive, ControlJoin, ControlTake
from gemelo.schemas.device import (
    ConfigureRequest,
    ConfigureResponse,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceStopRequest,
    EchoRequest,
    EchoResponse,
    InjectRequest,
    InjectResponse,
)
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
)
from gemelo.schemas.planning import StreamVerdict
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import (
    CONTROL_GIVE,
    CONTROL_JOIN,
    CONTROL_TAKE,
    DEVICE_COMMAND,
    DEVICE_CONFIGURE,
    DEVICE_ECHO,
    DEVICE_INJECT,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    GATEWAY_INPUTS,
    GRIPPER_COMMAND,
    JOINT_TARGETS,
    SCENE,
    STREAM_VERDICTS,
)
from gemelo.services.stepper_gateway.control.control import seal
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.goals.goal_executor import CancelVerdict, GoalVerdict
from gemelo.services.stepper_gateway.goals.goal_reading import read_goal
from gemelo.services.stepper_gateway.goals.pieces import Pieces
from gemelo.services.stepper_gateway.input_log import InputLog
from gemelo.services.stepper_gateway.inputs import (
    BeganInput,
    CancelInput,
    CommandInput,
    ConfigureInput,
    EchoInput,
    FrameInput,
    GiveControlInput,
    GoalInput,
    GripCancelInput,
    GripInput,
    InjectInput,
    Input,
    JoinControlInput,
    NewcomerInput,
    ParametersInput,
    PlannerInput,
    Reply,
    SceneInput,
    StepInput,
    StopInput,
    TakeControlInput,
    TargetsInput,
    VerdictInput,
    link_input,
)
from gemelo.services.stepper_gateway.ledger.ledger_file import LedgerFile
from gemelo.services.stepper_gateway.links import link as links
from gemelo.services.stepper_gateway.links.repeated_states import StateSieve
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import (
    Answer,
    GoalExecuting,
    GoalFinished,
    GoalProgress,
    GripperExecuting,
    GripperFinished,
    GripperProgress,
    KeepLedger,
    LogLine,
    Output,
    Publish,
    SendFrame,
)
from gemelo.services.stepper_gateway.parameters import GatewayParameters

PLANNER = "planner"  # the node whose scene counts, and which streams targets for others
AT_ONCE = 16  # payloads handled before the loop looks at its deadline and for stops; chosen: about 1 ms

WAS_STOPPED = because("gateway.was_stopped")

Server = ActionServer[FollowJointTrajectoryGoal, FollowJointTrajectoryFeedback, FollowJointTrajectoryResult]

Gripper = ActionServer[GripperCommandGoal, GripperCommandFeedback, GripperCommandResult]


class Shell:
    """Everything here runs in the thread of logic, but `wake`."""

    def __init__(
        self,
        node: Node,
        core: GatewayCore,
        began: BeganInput,
        parameters: ParameterSet[GatewayParameters],
        ledger: LedgerFile,
    ) -> None:
        self._node, self._core, self._parameters, self._ledger = node, core, parameters, ledger
        self._inputs = InputLog(core, began, self._moment(), node.publisher(GATEWAY_INPUTS).put)
        self._told = began.parameters
        self._link: links.Link | None = None
        self._sieve = StateSieve()
        self._link_told: tuple[bool, Reason | None] | None = None  # what the core was given of it last
        self._silent = False
        self._is_woken = threading.Event()
        self._callers: dict[int, Pending[Any]] = {}  # by ticket: who waits for the device's answer
        self._tickets = itertools.count(1)
        self._server: Server = node.serve_action(
            FOLLOW_JOINT_TRAJECTORY, self._on_goal, self._on_cancel, self._read_goal
        )
        self._gripper: Gripper = node.serve_action(GRIPPER_COMMAND, self._on_grip, self._on_grip_cancel)
        self._absences = node.absences()
        node.subscribe_signed(JOINT_TARGETS, self._on_targets)
        node.subscribe_signed(STREAM_VERDICTS, self._on_verdict)
        node.watch_service(PLANNER, self._on_planner)
        node.watch_newcomers(self._on_newcomer)
        node.subscribe_signed(SCENE, lambda scene, by: self._handle(SceneInput(scene.version, scene.epoch, by)))
        self._commands = node.serve_later(DEVICE_COMMAND, self._on_command)
        node.serve_later(DEVICE_STOP, self._on_stop)
        node.serve_later(DEVICE_CONFIGURE, self._on_configure)
        node.serve_later(DEVICE_INJECT, self._on_inject)
        node.serve_later(DEVICE_ECHO, self._on_echo)
        node.serve_later(CONTROL_TAKE, self._on_take_control)
        node.serve_later(CONTROL_JOIN, self._on_join_control)
        node.serve_later(CONTROL_GIVE, self._on_give_control)

    def use(self, link: links.Link) -> None:
        self._link = link
        self.wake()

    def wake(self) -> None:
        """Something has happened on the link; from any thread."""
        if not self._is_woken.is_set():
            self._is_woken.set()
            self._node.post(self._on_link)

    def step(self, _now: int) -> None:
        """One turn of the control loop; none while another gateway may have taken this one's place."""
        if self._is_silent():
            return self._node.set_ready(False, WAS_STOPPED)
        if self._parameters.value is not self._told:
            self._told = self._parameters.value
            self._handle(ParametersInput(self._told))
        moment = self._moment()
        self._handle(StepInput(self._absences.seconds(self._core.watched_clients, moment.monotonic)))
        self._on_link()  # which is not woken for each state
        moment = self._moment()
        for held in self._sieve.release(round(moment.monotonic * 1e9)):
            self._handle(FrameInput(*held))
        reason = self._core.not_ready(moment)
        self._node.set_ready(reason is None, reason or "")
        self._inputs.step(moment, self._told.record_inputs)

    def finish(self) -> None:
        """The last word of the inputs; the loop has ended."""
        self._inputs.finish()

    def _moment(self) -> Moment:
        clock = self._node.clock
        return Moment(clock.unix(), clock.monotonic())

    def _on_link(self) -> None:
        self._is_woken.clear()
        link = self._link
        if link is None or self._is_silent():  # what came stays where it is until the loop goes on
            return
        if self._link_told != (present := (link.connected, link.reason)):
            self._link_told = present
            self._handle(link_input(*present))
        received = link.take(AT_ONCE)
        for payload in received:
            for given in self._sieve.sift(payload, lambda t_us: self._core.is_state_due(t_us, self._moment())):
                self._handle(FrameInput(*given))
        if len(received) == AT_ONCE:
            self.wake()

    def _is_silent(self) -> bool:
        """True after this process was stopped, until it is certain that no other gateway was started meanwhile.

        Only what stops the arm is sent then: see `_carry_out`.
        """
        was_silent, self._silent = self._silent, not self._node.holds_name()
        if was_silent and not self._silent:
            self.wake()
        return self._silent

    def _read_goal(self, payload: bytes) -> Pieces[FollowJointTrajectoryGoal]:
        """A long one is read and checked while the loop goes on; raises `BadMessage`."""
        goal = yield from read_goal(payload)
        yield from self._core.prepare_goal(goal, self._moment())
        return goal

    def _on_goal(self, goal_id: str, goal: FollowJointTrajectoryGoal) -> GoalDecision:
        if self._is_silent():
            return refuse(FollowErrorCode.DEVICE_FAILED, str(WAS_STOPPED), WAS_STOPPED)
        try:
            return _decision(self._handle(GoalInput(goal_id, goal, self._server.session_of(goal_id))))
        except Exception:
            self._handle(CancelInput(goal_id))  # it is refused, so the arm must not follow it
            raise

    def _on_cancel(self, goal_id: str) -> Reason | None:
        return _objection(self._handle(CancelInput(goal_id)))

    def _on_grip(self, goal_id: str, goal: GripperCommandGoal) -> GoalDecision:
        if self._is_silent():
            return refuse(FollowErrorCode.DEVICE_FAILED, str(WAS_STOPPED), WAS_STOPPED)
        try:
            return _decision(self._handle(GripInput(goal_id, goal, self._gripper.session_of(goal_id))))
        except Exception:
            self._handle(GripCancelInput(goal_id))
            raise

    def _on_grip_cancel(self, goal_id: str) -> Reason | None:
        return _objection(self._handle(GripCancelInput(goal_id)))

    def _on_targets(self, targets: JointTargets, writer: str) -> None:
        """The planner's are those of whom it jogs for; of anybody else it does not count what they say of that."""
        if self._is_silent():
            return
        if writer == PLANNER:
            self._handle(TargetsInput(targets, targets.client or writer, watched=not targets.to_watch))
        else:
            self._handle(TargetsInput(targets, writer))

    def _on_verdict(self, verdict: StreamVerdict, writer: str) -> None:
        if writer == PLANNER and not self._is_silent():
            self._handle(VerdictInput(verdict))

    def _on_newcomer(self) -> None:
        self._handle(NewcomerInput())

    def _on_planner(self, instance: str, is_there: bool) -> None:
        self._handle(PlannerInput(instance, is_there))

    def _on_command(self, request: DeviceCommandRequest, pending: Pending[DeviceCommandResponse]) -> None:
        self._handle(CommandInput(self._ticket(pending), request, pending.client))

    def _on_stop(self, request: DeviceStopRequest, pending: Pending[DeviceCommandResponse]) -> None:
        """What was asked for before a stop must not move the arm after it."""
        reason = because("command.overtaken", stop=request.kind.value)
        for server in (self._server, self._gripper, self._commands):
            server.refuse_waiting(reason, pending.asked)
        self._handle(StopInput(self._ticket(pending), request))

    def _on_configure(self, _request: ConfigureRequest, pending: Pending[ConfigureResponse]) -> None:
        self._handle(ConfigureInput(self._ticket(pending), pending.client))

    def _on_inject(self, request: InjectRequest, pending: Pending[InjectResponse]) -> None:
        self._handle(InjectInput(self._ticket(pending), request))

    def _on_echo(self, _request: EchoRequest, pending: Pending[EchoResponse]) -> None:
        self._handle(EchoInput(self._ticket(pending)))

    def _handle(self, given: Input) -> Reply:
        """Has the core handle one input now, carries out what comes of it, and returns what it says at once."""
        self._is_silent()
        reply, outputs = self._inputs.handle(given, self._moment())
        self._carry_out(outputs)
        return reply

    def _on_take_control(self, request: ControlTake, pending: Pending[ControlAnswer]) -> None:
        sealed = replace(request, secret=seal(request.secret))
        self._handle(TakeControlInput(self._ticket(pending), sealed, pending.client))

    def _on_join_control(self, request: ControlJoin, pending: Pending[ControlAnswer]) -> None:
        sealed = replace(request, secret=seal(request.secret))
        self._handle(JoinControlInput(self._ticket(pending), sealed, pending.client))

    def _on_give_control(self, request: ControlGive, pending: Pending[ControlAnswer]) -> None:
        self._handle(GiveControlInput(self._ticket(pending), replace(request, secret=seal(request.secret))))

    def _ticket(self, pending: Pending[Any]) -> int:
        ticket = next(self._tickets)
        self._callers[ticket] = pending
        return ticket

    def _carry_out(self, outputs: list[Output]) -> None:
        """All of them, in order, whatever becomes of one: the core counts each as done. The first error is raised."""
        failures = []
        for output in outputs:
            try:
                self._carry_out_one(output)
            except Exception as error:
                failures.append(error)
        if failures:
            raise failures[0]

    def _carry_out_one(self, output: Output) -> None:
        match output:
            case SendFrame(kind, payload, urgent):
                if self._link is not None and (urgent or not self._silent):
                    self._link.send(kind, payload, urgent)
            case Publish(topic, message):
                self._node.publisher(topic).put(message)
            case GoalExecuting(goal_id):
                self._server.executing(goal_id)
            case GoalProgress(goal_id, feedback):
                self._server.feedback(goal_id, feedback)
            case GoalFinished(goal_id, status, result):
                self._server.finish(goal_id, status, result)
            case GripperExecuting(goal_id):
                self._gripper.executing(goal_id)
            case GripperProgress(goal_id, told):
                self._gripper.feedback(goal_id, told)
            case GripperFinished(goal_id, status, gripped):
                self._gripper.finish(goal_id, status, gripped)
            case Answer(ticket, response):
                self._callers.pop(ticket).reply(response)
            case KeepLedger(record):
                self._ledger.keep(record)
            case LogLine(level, text):
                self._node.log.log(level, "%s", text)


def _decision(reply: Reply) -> GoalDecision:
    """A verdict as the action's server says it."""
    assert isinstance(reply, GoalVerdict)
    return accept() if reply.accepted else refuse(reply.code, reply.reason, reply.why)


def _objection(reply: Reply) -> Reason | None:
    """Why a goal is not cancelled; None where it is."""
    assert isinstance(reply, CancelVerdict)
    return reply.why
