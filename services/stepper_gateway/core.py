"""The gateway without any wire or clock: inputs go in, outputs come out.

The process, the simulation and a replay give it everything by `GatewayCore.handle`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import ConfigureResponse, DeviceCommandKind
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.services.stepper_gateway.components import Components
from gemelo.services.stepper_gateway.control.clients import MotionCaller
from gemelo.services.stepper_gateway.device.command_arguments import STOPS, kind_of
from gemelo.services.stepper_gateway.device.frame_handler import FrameHandler
from gemelo.services.stepper_gateway.device.gateway_device import StatusWatch
from gemelo.services.stepper_gateway.device.other_writers import Strangers
from gemelo.services.stepper_gateway.goals.goal_executor import CancelVerdict, GoalVerdict
from gemelo.services.stepper_gateway.goals.scene_versions import SceneVersion
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
    LinkInput,
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
)
from gemelo.services.stepper_gateway.ledger.confidence import LedgerRecord
from gemelo.services.stepper_gateway.links.frames import BadFrame, CommandFrame, Heartbeat, NoFrame, Sync, encode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Answer, Output
from gemelo.services.stepper_gateway.parameters import GatewayParameters

REGULAR = {Heartbeat: Kind.HB, Sync: Kind.SYNC, CommandFrame: Kind.CMD}  # what the session sends by itself
BAD_FRAME_REPORT = 1.0  # [s] between two; chosen: a flood of bad frames must not flood the log
PAUSES = (  # commands that leave goals and targets as they are
    DeviceCommandKind.HOLD,
    DeviceCommandKind.RESUME,
    DeviceCommandKind.OUTPUT,
    DeviceCommandKind.SPEED,
    DeviceCommandKind.ARM,
)


class GatewayCore:
    """One arm, one device."""

    def __init__(
        self,
        arm: ArmDescription,
        session_id: int,
        parameters: GatewayParameters | None = None,
        kept: LedgerRecord | None = None,
    ) -> None:
        """`kept`: the step ledger of the gateway before, None where there is none."""
        self._components = Components(arm, session_id, parameters or GatewayParameters(), kept)
        self._frame_handler = FrameHandler(self._components)
        self.device, self.controller = self._components.device, self._components.controller
        self.bad_frames = 0
        self._bad_reported = -1.0e9  # [s] monotonic
        self._strangers = Strangers(arm.device.name)
        self._status = StatusWatch(self.device)
        self._stepped: float | None = None  # [s] monotonic

    def handle(self, given: Input, moment: Moment) -> tuple[Reply, list[Output]]:
        """One input, at the present moment; what is said at once, and the outputs in order.

        A request's answer comes as an `Answer` with its ticket, now or later.
        """
        parts = self._components
        reply: Reply = None
        match given:
            case StepInput(absences):
                self._step(absences, moment)
            case FrameInput():
                if not self._take_frame(given, moment):
                    return None, parts.out.take()
            case LinkInput():
                self._on_link(given, moment)
            case TargetsInput():
                self._take_targets(given, moment)
            case VerdictInput(verdict):
                parts.streaming.on_verdict(verdict, moment)
            case GoalInput():
                reply = self._accept_goal(given, moment)
            case CancelInput(goal_id):
                reply = CancelVerdict(parts.goals.cancel(goal_id, moment))
                parts.command_handler.send_due(moment)
            case GripInput(goal_id, goal, session):
                refusal = parts.control.verdict(MotionCaller(session), moment)
                reply = refusal or parts.gripper.accept(goal_id, goal, moment)
            case GripCancelInput(goal_id):
                reply = CancelVerdict(parts.gripper.cancel(goal_id, moment))
            case PlannerInput(instance, is_there):
                parts.goals.scenes.on_planner(instance, is_there)
            case NewcomerInput():
                self.device.resting.on_newcomer(moment)
                return None, []
            case CommandInput():
                self._command(given, moment)
            case StopInput():
                self._stop(given, moment)
            case ConfigureInput(ticket, session):
                self._configure(ticket, MotionCaller(session), moment)
            case InjectInput(ticket, request):
                parts.injections.ask(request, ticket, moment)
            case EchoInput(ticket):
                parts.echoes.ask(ticket, moment)
            case TakeControlInput(ticket, request, session):
                parts.control.take(request, session, ticket, moment)
            case JoinControlInput(ticket, request, session):
                parts.control.join(request, session, ticket)
            case GiveControlInput(ticket, request):
                parts.control.give(request, ticket)
            case SceneInput():
                return self._take_scene(given)
            case ParametersInput(parameters):
                self.device.parameters = parameters
                return None, []
            case BeganInput():
                raise ValueError("a core begins once: make another one")
        return reply, self._finish(moment)

    def not_ready(self, moment: Moment) -> Reason | None:
        """Why the gateway's state is not valid, None if it is."""
        device = self.device
        return device.unreachable_reason(moment) or (None if device.state is not None else device.not_ready_reason())

    def is_state_due(self, t_us: int, moment: Moment) -> bool:
        """True if something may come of a state of `t_us` [us] that repeats the one before."""
        return not self._components.is_idle(moment) or self._frame_handler.is_state_due(t_us, moment)

    def prepare_goal(self, goal: FollowJointTrajectoryGoal, moment: Moment) -> Iterator[None]:
        """Checks a long goal ahead, in pieces; no input: what `handle` then decides is the same without it."""
        return self._components.goals.prepare(goal, moment)

    @property
    def scenes_dropped(self) -> int:
        """How many scenes had a version that no planner gives, or came from another than the living one."""
        return self._components.goals.scenes.dropped

    @property
    def watched_clients(self) -> tuple[str, ...]:
        """Keys of the liveliness tokens whose absences a `StepInput` has."""
        return self._components.control.watched

    def ledger_record(self) -> LedgerRecord | None:
        """The step ledger as it is to be kept when the gateway ends; None while no device is known."""
        return self._components.ledger.record()

    def _step(self, absences: Mapping[str, float], moment: Moment) -> None:
        """One turn of the control loop, 50 times a second; sends the heartbeat.

        `absences` [s] of the tokens of `watched_clients`, by key: those that are not named are there.
        """
        device = self.device
        period = moment.monotonic - self._stepped if self._stepped is not None else 0.0
        self._stepped = moment.monotonic
        for frame in device.session.due(moment):
            self._components.out.send(REGULAR[type(frame)], encode(frame))
        unreachable_reason = device.unreachable_reason(moment)
        if unreachable_reason is not None:
            self._components.on_unreachable(unreachable_reason, moment)
        self._components.goals.step(moment, period)
        self._components.streaming.step(moment)
        self._components.stop_foreign_motion(moment)
        self._components.control.step(absences, moment)
        self._components.command_handler.step(moment)
        device.configuration.step(unreachable_reason, moment)
        self._components.injections.step(moment)
        self._components.echoes.step(moment)
        self._components.sensors.step(unreachable_reason, moment)
        self._components.gripper.step(moment)
        self._components.ledger.step(moment)
        self.controller.pump(moment)
        self._components.stopping.step(moment)

    def _on_link(self, link: LinkInput, moment: Moment) -> None:
        session, connected = self.device.session, link.connected
        reason = link.why or plain(link.reason)
        if connected != session.link_up:
            session.on_link(connected, reason)
            level = LogLevel.INFO if connected else LogLevel.WARNING
            self.device.event("connected" if connected else "disconnected", link.why or link.reason, moment, level)
        session.link_reason = reason

    def _take_frame(self, frame: FrameInput, moment: Moment) -> bool:
        """False for what is no frame of the device: it is counted, and reported now and then."""
        try:
            self._frame_handler.take(frame, moment)
        except BadFrame as error:
            self.bad_frames += 1
            if isinstance(error, NoFrame):
                self._strangers.on_message(frame.kind, error, moment.monotonic)
            if moment.monotonic - self._bad_reported >= BAD_FRAME_REPORT:
                self._bad_reported = moment.monotonic
                about = {"kind": frame.kind.value, "count": self.bad_frames}
                self.device.event("bad_frame", because("device.bad_frame", plain(str(error)), **about), moment)
            return False
        return True

    def _take_targets(self, given: TargetsInput, moment: Moment) -> None:
        """A target that is refused for control's sake neither keeps nor ends the holder's stream."""
        parts = self._components
        if parts.control.permits_targets(MotionCaller(node=given.node), moment):
            parts.streaming.on_targets(given.targets, parts.goals.is_active, moment, given.watched)

    def _accept_goal(self, given: GoalInput, moment: Moment) -> GoalVerdict:
        parts, caller = self._components, MotionCaller(given.session)
        verdict = parts.control.verdict(caller, moment) or parts.goals.accept(given.goal_id, given.goal, moment)
        if verdict.accepted:
            parts.control.note_mover(caller)
            parts.streaming.end_for_goal()
        return verdict

    def _take_scene(self, scene: SceneInput) -> tuple[Reply, list[Output]]:
        """Goals planned in another scene are refused from now on. The first that is dropped is logged at the next
        input."""
        scenes = self._components.goals.scenes
        objection = scenes.take(SceneVersion(scene.version, scene.epoch), scene.instance)
        if objection and scenes.dropped == 1:
            self._components.out.log(LogLevel.WARNING, f"scene: dropped: {objection} (further ones are only counted)")
        return None, []

    def _command(self, given: CommandInput, moment: Moment) -> None:
        parts, caller = self._components, MotionCaller(given.session)
        if not parts.control.permits_command(caller, given.ticket, moment):
            return
        parts.control.note_mover(caller)
        if parts.command_handler.ask(given.request, given.ticket, parts.goals.is_active, moment):
            self._make_way_for(kind_of(given.request), moment)
        parts.command_handler.send_due(moment)

    def _stop(self, given: StopInput, moment: Moment) -> None:
        parts, kind = self._components, STOPS[given.request.kind]
        if parts.command_handler.stop(kind, given.ticket, parts.goals.is_active, moment):
            self._make_way_for(kind, moment)
            parts.gripper.abort(because("ending.command", command=kind.name), moment)
        parts.command_handler.send_due(moment)

    def _configure(self, ticket: int, caller: MotionCaller, moment: Moment) -> None:
        if objection := self._components.control.objection(caller, moment):
            self._components.out.put(Answer(ticket, ConfigureResponse(reason=str(objection), why=objection)))
            return
        self.device.configuration.ask(ticket, self.device.unreachable_reason(moment), moment)

    def _make_way_for(self, kind: DeviceCommandKind, moment: Moment) -> None:
        """A person's command comes before goals and targets."""
        if kind in PAUSES:
            return
        self._components.streaming.interrupt()
        if self._components.goals.is_active:
            self._components.goals.stop(because("ending.command", command=kind.name), moment)
        elif kind == DeviceCommandKind.STOP:
            self.controller.stop(moment)
        else:
            self.controller.transmission.abandon()

    def _finish(self, moment: Moment) -> list[Output]:
        """Tell of the device's status where it has changed, and hand the outputs out."""
        self._components.command_handler.tell_listeners(moment)
        self._components.control.tell(moment)
        warning = self._components.goals.scenes.rivals or self._strangers.reason(moment.monotonic)
        if (status := self._status.changed(moment, warning)) is not None:
            self._components.out.publish(DEVICE_STATUS, status)
        return self._components.out.take()
