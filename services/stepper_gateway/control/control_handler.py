"""Holds every motion against who holds control, and brings the arm to rest before control changes hands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from msgspec.structs import replace

from gemelo.schemas.control import ControlAnswer, ControlGive, ControlJoin, ControlState, ControlTake
from gemelo.schemas.device import DeviceCommandKind, DeviceCommandResponse, DeviceMode
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import CONTROL
from gemelo.services.stepper_gateway.control.clients import MotionCaller
from gemelo.services.stepper_gateway.control.control import ControlHolder
from gemelo.services.stepper_gateway.device.command_handler import CommandHandler
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.goals.goal_executor import GoalExecutor, GoalVerdict
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected
from gemelo.services.stepper_gateway.gripper.gripper_executor import GripperExecutor
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.target_follower import TargetFollower
from gemelo.services.stepper_gateway.outputs import Answer

STOP_AGAIN = 0.5  # [s] between two stops for an arm that does not come to rest; chosen: as the motion controller's
COMPLAINT = 1.0  # [s] between two words on streamed targets that are refused; chosen: the log stays readable
IN_MOTION = (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING)
STARTING = (DeviceCommandKind.HOME, DeviceCommandKind.RESUME)  # what they start begins with the device's answer
NOBODY = MotionCaller()


class Movers(Protocol):
    """What moves the arm."""

    device: GatewayDevice
    controller: MotionController
    goals: GoalExecutor
    streaming: TargetFollower
    gripper: GripperExecutor
    command_handler: CommandHandler


class ControlHandler:
    """Answers what is asked of control, and refuses the motions of others by name."""

    def __init__(self, movers: Movers, robot: str, epoch: int) -> None:
        self._movers, self._device = movers, movers.device
        self._control = ControlHolder(robot, epoch)
        self._epoch = epoch
        self._mover = NOBODY  # who has moved the arm last
        self._stopped = -1.0e9  # [s] monotonic, when the arm was stopped last for a change of control
        self._complained = -1.0e9  # [s] monotonic
        self._told: ControlState | None = None

    @property
    def watched(self) -> tuple[str, ...]:
        """Keys of the liveliness tokens whose absence counts."""
        return self._control.watched

    def objection(self, caller: MotionCaller, moment: Moment) -> Reason | None:
        """Why `caller` may not move the arm, nor change how it moves; None if it may."""
        return self._control.objection(caller, moment)

    def verdict(self, caller: MotionCaller, moment: Moment) -> GoalVerdict | None:
        """The refusal of a goal of `caller`; None if it may move the arm."""
        objection = self._control.objection(caller, moment)
        return None if objection is None else GoalVerdict.refused(FollowErrorCode.NOT_IN_CONTROL, objection)

    def permits_targets(self, caller: MotionCaller, moment: Moment) -> bool:
        """True if `caller` may stream targets; else it is told why, once a second at most."""
        objection = self._control.objection(caller, moment)
        if objection is None:
            self._mover = caller
        elif moment.monotonic - self._complained >= COMPLAINT:
            self._complained = moment.monotonic
            self._device.event("target_refused", objection, moment, client=caller.node)
        return objection is None

    def permits_command(self, caller: MotionCaller, ticket: int, moment: Moment) -> bool:
        """True if `caller` may command the device; else the answer is given."""
        objection = self._control.objection(caller, moment)
        if objection is not None:
            mode = self._device.session.mode
            response = DeviceCommandResponse(reason=str(objection), mode=mode, check="control", why=objection)
            self._device.out.put(Answer(ticket, response))
        return objection is None

    def note_mover(self, caller: MotionCaller) -> None:
        """`caller` moves the arm from now on."""
        self._mover = caller

    def take(self, request: ControlTake, session: str, ticket: int, moment: Moment) -> None:
        """Asks for control; the answer comes when the arm rests, where another moves it."""
        try:
            claim = self._control.take(request, session, ticket, moment)
        except GoalRejected as rejected:
            return self._answer(ticket, rejected.reason)
        self._answer_claims()
        if claim is None:
            return self._answer(ticket)
        self._stopped = -1.0e9
        self._change(moment)
        self.step({}, moment)

    def join(self, request: ControlJoin, session: str, ticket: int) -> None:
        """One more node of the holder's."""
        try:
            self._control.join(request, session)
        except GoalRejected as rejected:
            return self._answer(ticket, rejected.reason)
        self._answer(ticket)

    def give(self, request: ControlGive, ticket: int) -> None:
        """The holder gives control back; what moves goes on, and everybody may stop it."""
        try:
            self._control.give(request)
        except GoalRejected as rejected:
            return self._answer(ticket, rejected.reason)
        self._answer(ticket)

    def step(self, absences: Mapping[str, float], moment: Moment) -> None:
        """`absences` [s] by key of a liveliness token."""
        grace = self._device.parameters.control_grace
        self._control.step(absences, self._is_at_rest(moment), grace, moment)
        self._answer_claims()
        self._change(moment)

    def tell(self, moment: Moment) -> None:
        """Publishes who holds control where that has changed, and writes it to the log."""
        if not self._control.has_changed():
            return
        for level, text in self._control.take_notes():
            self._device.out.log(level, text)
        state = self._control.state()
        if state != self._told:
            self._told = state
            self._device.out.publish(CONTROL, replace(state, stamp=moment.unix))

    def _change(self, moment: Moment) -> None:
        """Brings the arm to rest where control is to change hands."""
        reason = self._control.must_rest
        if reason is None:
            self._stopped = -1.0e9
        elif not self._is_at_rest(moment) and moment.monotonic - self._stopped >= STOP_AGAIN:
            self._stopped = moment.monotonic
            self._bring_to_rest(because("ending.control", reason), moment)

    def _bring_to_rest(self, reason: Reason, moment: Moment) -> None:
        movers = self._movers
        movers.streaming.interrupt()
        movers.gripper.stop(reason, moment)
        if movers.goals.is_active:
            movers.goals.stop(reason, moment)
        else:
            movers.controller.stop(moment)
        movers.command_handler.send_due(moment)

    def _is_at_rest(self, moment: Moment) -> bool:
        """True if nothing moves the arm, or only whom control goes to; a device that is not reached holds by itself."""
        if self._control.is_claimed_by(self._mover):
            return True
        movers, device = self._movers, self._device
        if movers.goals.is_active or movers.streaming.is_active or movers.gripper.is_active:
            return False
        if device.unreachable_reason(moment) or device.session.latest is None:
            return True
        if any(device.commands.is_pending(kind) for kind in STARTING):
            return False
        return device.session.mode not in IN_MOTION and movers.controller.is_still()

    def _answer_claims(self) -> None:
        control = self._control
        for ticket in control.granted:
            self._answer(ticket)
        for ticket, reason in control.refused:
            self._answer(ticket, reason)
        control.granted.clear()
        control.refused.clear()

    def _answer(self, ticket: int, reason: Reason | None = None) -> None:
        text, number = str(reason or ""), self._control.number
        answer = ControlAnswer(accepted=reason is None, reason=text, epoch=self._epoch, number=number, why=reason)
        self._device.out.put(Answer(ticket, answer))
