"""The gateway without any wire or clock: what arrives goes in, what is to be done comes out.

Every public method takes the present `Moment` and returns outputs in order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.control import ControlGive, ControlJoin, ControlTake
from gemelo.schemas.device import (
    ConfigureResponse,
    DeviceCommandKind,
    DeviceCommandRequest,
    DeviceStatus,
    DeviceStopRequest,
    InjectRequest,
)
from gemelo.schemas.gripper import GripperCommandGoal
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.services.stepper_gateway.components import Components
from gemelo.services.stepper_gateway.control.clients import MotionCaller
from gemelo.services.stepper_gateway.control.control_handler import NOBODY
from gemelo.services.stepper_gateway.device.command_arguments import STOPS, kind_of
from gemelo.services.stepper_gateway.device.frame_handler import FrameHandler
from gemelo.services.stepper_gateway.device.gateway_device import status_of
from gemelo.services.stepper_gateway.device.other_writers import Strangers
from gemelo.services.stepper_gateway.goals.goal_executor import GoalVerdict
from gemelo.services.stepper_gateway.ledger.record import LedgerRecord
from gemelo.services.stepper_gateway.links.frames import BadFrame, CommandFrame, Heartbeat, NoFrame, Sync, encode
from gemelo.services.stepper_gateway.links.link import Kind, Received
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
        self._told: DeviceStatus | None = None
        self._stepped: float | None = None  # [s] monotonic

    def set_parameters(self, parameters: GatewayParameters) -> None:
        self.device.parameters = parameters

    def not_ready(self, moment: Moment) -> str:
        """Why the gateway's state is not valid, empty if it is."""
        device = self.device
        return device.unreachable_reason(moment) or ("" if device.state is not None else device.not_ready_reason())

    def on_link(self, connected: bool, reason: str, moment: Moment) -> list[Output]:
        """The wire has come or gone."""
        session = self.device.session
        if connected != session.link_up:
            session.on_link(connected, reason)
            level = LogLevel.INFO if connected else LogLevel.WARNING
            self.device.event("connected" if connected else "disconnected", reason, moment, level)
        session.link_reason = reason
        return self._finish(moment)

    def on_received(self, received: Received, moment: Moment) -> list[Output]:
        """One payload from the device; one that is no frame is counted, and reported now and then."""
        try:
            self._frame_handler.take(received, moment)
        except BadFrame as error:
            self.bad_frames += 1
            if isinstance(error, NoFrame):
                self._strangers.on_message(received.kind, str(error), moment.monotonic)
            if moment.monotonic - self._bad_reported >= BAD_FRAME_REPORT:
                self._bad_reported = moment.monotonic
                self.device.event("bad_frame", f"{received.kind}: {error} ({self.bad_frames} so far)", moment)
            return self._components.out.take()
        return self._finish(moment)

    def prepare_goal(self, goal: FollowJointTrajectoryGoal, moment: Moment) -> Iterator[None]:
        """Checks a long goal ahead, in pieces; no input: what `on_goal` then decides is the same without it."""
        return self._components.goals.prepare(goal, moment)

    def on_goal(
        self, goal_id: str, goal: FollowJointTrajectoryGoal, moment: Moment, caller: MotionCaller = NOBODY
    ) -> tuple[GoalVerdict, list[Output]]:
        """A goal, to be accepted or refused at once."""
        control = self._components.control
        verdict = control.verdict(caller, moment) or self._components.goals.accept(goal_id, goal, moment)
        if verdict.accepted:
            control.note_mover(caller)
            self._components.streaming.end_for_goal()
        return verdict, self._finish(moment)

    def on_cancel(self, goal_id: str, moment: Moment) -> tuple[str, list[Output]]:
        """Empty if the goal is being cancelled, else why not."""
        reason = self._components.goals.cancel(goal_id, moment)
        self._components.command_handler.send_due(moment)
        return reason, self._finish(moment)

    def on_grip(
        self, goal_id: str, goal: GripperCommandGoal, moment: Moment, caller: MotionCaller = NOBODY
    ) -> tuple[GoalVerdict, list[Output]]:
        """A goal of the gripper, to be accepted or refused at once."""
        control = self._components.control
        verdict = control.verdict(caller, moment) or self._components.gripper.accept(goal_id, goal, moment)
        return verdict, self._finish(moment)

    def on_grip_cancel(self, goal_id: str, moment: Moment) -> tuple[str, list[Output]]:
        """Empty if the gripper's goal is cancelled, else why not."""
        reason = self._components.gripper.cancel(goal_id, moment)
        return reason, self._finish(moment)

    def on_planner(self, instance: str, is_there: bool, moment: Moment) -> list[Output]:
        """A process that bears the planner's name has come or gone: the scene is that of the living one."""
        self._components.goals.scenes.on_planner(instance, is_there)
        return self._finish(moment)

    def on_scene(self, scene: PlanningScene, instance: str = "") -> None:
        """A planner's newest scene: goals planned in another are refused. One that is dropped is logged once."""
        scenes = self._components.goals.scenes
        objection = scenes.take(scene, instance)
        if objection and scenes.dropped == 1:
            self._components.out.log(LogLevel.WARNING, f"scene: dropped: {objection} (further ones are only counted)")

    @property
    def scenes_dropped(self) -> int:
        """How many scenes had a version that no planner gives, or came from another than the living one."""
        return self._components.goals.scenes.dropped

    def on_targets(self, targets: JointTargets, moment: Moment, caller: MotionCaller = NOBODY) -> list[Output]:
        """A streamed target; one that is refused for control's sake neither keeps nor ends the holder's stream."""
        if self._components.control.permits_targets(caller, moment):
            self._components.streaming.on_targets(targets, self._components.goals.is_active, moment)
        return self._finish(moment)

    def on_command(
        self, request: DeviceCommandRequest, ticket: int, moment: Moment, caller: MotionCaller = NOBODY
    ) -> list[Output]:
        """A person's command; its answer comes as an `Answer` with this ticket."""
        if not self._components.control.permits_command(caller, ticket, moment):
            return self._finish(moment)
        self._components.control.note_mover(caller)
        if self._components.command_handler.ask(request, ticket, self._components.goals.is_active, moment):
            self._make_way_for(kind_of(request), moment)
        self._components.command_handler.send_due(moment)
        return self._finish(moment)

    def on_stop(self, request: DeviceStopRequest, ticket: int, moment: Moment) -> list[Output]:
        """A person's STOP, HOLD or DISARM; its answer comes as an `Answer` with this ticket."""
        kind = STOPS[request.kind]
        if self._components.command_handler.stop(kind, ticket, self._components.goals.is_active, moment):
            self._make_way_for(kind, moment)
            self._components.gripper.abort(f"stopped by a device command ({kind.name})", moment)
        self._components.command_handler.send_due(moment)
        return self._finish(moment)

    def on_configure(self, ticket: int, moment: Moment, caller: MotionCaller = NOBODY) -> list[Output]:
        """A person wants the device configured; the answer comes as an `Answer` with this ticket."""
        if objection := self._components.control.objection(caller, moment):
            self._components.out.put(Answer(ticket, ConfigureResponse(accepted=False, reason=objection)))
            return self._finish(moment)
        self.device.configuration.ask(ticket, self.device.unreachable_reason(moment), moment)
        return self._finish(moment)

    def on_inject(self, request: InjectRequest, ticket: int, moment: Moment) -> list[Output]:
        """An injection into a virtual device; its answer comes as an `Answer` with this ticket."""
        self._components.injections.ask(request, ticket, moment)
        return self._finish(moment)

    def on_echo(self, ticket: int, moment: Moment) -> list[Output]:
        """Somebody measures the wire; the answer comes as an `Answer` with this ticket."""
        self._components.echoes.ask(ticket, moment)
        return self._finish(moment)

    def on_take_control(self, request: ControlTake, session: str, ticket: int, moment: Moment) -> list[Output]:
        """`session` asks for control; the answer comes as an `Answer` with this ticket, as those of the next two."""
        self._components.control.take(request, session, ticket, moment)
        return self._finish(moment)

    def on_join_control(self, request: ControlJoin, session: str, ticket: int, moment: Moment) -> list[Output]:
        """`session` knows the holder's secret, and wants to move the arm too."""
        self._components.control.join(request, session, ticket)
        return self._finish(moment)

    def on_give_control(self, request: ControlGive, ticket: int, moment: Moment) -> list[Output]:
        """The holder gives control back."""
        self._components.control.give(request, ticket)
        return self._finish(moment)

    @property
    def watched_clients(self) -> tuple[str, ...]:
        """Keys of the liveliness tokens whose absence `step` is to be told."""
        return self._components.control.watched

    def step(self, moment: Moment, absences: Mapping[str, float] | None = None) -> list[Output]:
        """One turn of the control loop, 50 times a second; sends the heartbeat.

        `absences` [s] of the tokens of `watched_clients`, by key: none are missing if not said otherwise.
        """
        device = self.device
        period = moment.monotonic - self._stepped if self._stepped is not None else 0.0
        self._stepped = moment.monotonic
        for frame in device.session.due(moment):
            self._components.out.send(REGULAR[type(frame)], encode(frame))
        unreachable_reason = device.unreachable_reason(moment)
        if unreachable_reason:
            self._components.on_unreachable(unreachable_reason, moment)
        self._components.goals.step(moment, period)
        self._components.streaming.step(moment)
        self._components.stop_foreign_motion(moment)
        self._components.control.step(absences or {}, moment)
        self._components.command_handler.step(moment)
        device.configuration.step(unreachable_reason, moment)
        self._components.injections.step(moment)
        self._components.echoes.step(moment)
        self._components.sensors.step(unreachable_reason, moment)
        self._components.gripper.step(moment)
        self._components.ledger.step(moment)
        self.controller.pump(moment)
        self._components.stopping.step(moment)
        return self._finish(moment)

    def ledger_record(self) -> LedgerRecord | None:
        """The step ledger as it is to be kept when the gateway ends; None while no device is known."""
        return self._components.ledger.record()

    def _make_way_for(self, kind: DeviceCommandKind, moment: Moment) -> None:
        """A person's command comes before goals and targets."""
        if kind in PAUSES:
            return
        self._components.streaming.interrupt()
        if self._components.goals.is_active:
            self._components.goals.stop(f"stopped by a device command ({kind.name})", moment)
        elif kind == DeviceCommandKind.STOP:
            self.controller.stop(moment)
        else:
            self.controller.transmission.abandon()

    def _finish(self, moment: Moment) -> list[Output]:
        """Tell of the device's status where it has changed, and hand the outputs out."""
        self._components.command_handler.tell_listeners(moment)
        self._components.control.tell(moment)
        warning = self._components.goals.scenes.rivals or self._strangers.text(moment.monotonic)
        status = status_of(self.device, moment, warning)
        if status != self._told:
            self._told = status
            self._components.out.publish(DEVICE_STATUS, replace(status, stamp=moment.unix))
        return self._components.out.take()
