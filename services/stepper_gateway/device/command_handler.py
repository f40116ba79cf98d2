"""The command_handler for device commands: a person's, each with an answer, and the gateway's own STOPs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

from gemelo.schemas.device import DeviceCommandKind, DeviceCommandRequest, DeviceCommandResponse, DeviceMode
from gemelo.schemas.reasons import Reason, Value, because, remedy
from gemelo.services.stepper_gateway.device.command_arguments import arguments_of, kind_of
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.device.pending_commands import STOPPING, Arguments, PendingCommand
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected, invalid
from gemelo.services.stepper_gateway.links.frames import Code, CommandReply, code_name, encode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.outputs import Answer

REMEDIES: dict[int, str] = {
    Code.NOT_READY: "other_mode",
    Code.POSITION_LIMIT: "within_soft_limits",
    Code.NOT_ARMED: "drivers_on",
    Code.ESTOP_PRESSED: "release_first",
    Code.NO_HOMING: "home_switch_or_reference",
    Code.UNKNOWN_CMD: "newer_firmware",
    Code.BAD_ARGUMENT: "known_argument",
}
NOT_NOW: dict[DeviceCommandKind, str] = {
    DeviceCommandKind.RESUME: "resume_holds_only",
    DeviceCommandKind.REFERENCE: "stand_or_reset",
    DeviceCommandKind.HOME: "stand_or_reset",
    DeviceCommandKind.DISARM: "stand_first",
    DeviceCommandKind.ARM: "reset_first",
}
TRUSTING = (  # commands that would move or mean something else with another configuration
    DeviceCommandKind.RESUME,
    DeviceCommandKind.REFERENCE,
    DeviceCommandKind.ARM,
    DeviceCommandKind.HOME,
    DeviceCommandKind.OUTPUT,
)
KNOWN = 3600.0  # [s] of the age of a state that is worth a word; chosen: one before a lost link has no age
OnAnswer = Callable[[DeviceCommandResponse, Moment], None]
OnReference = Callable[[int, tuple[int, ...], int, Moment], None]  # mask, [1/256 step], device time [us]
AT_REST = (DeviceCommandKind.REFERENCE, DeviceCommandKind.DISARM, DeviceCommandKind.HOME)  # steps count anew after them


class CommandHandler:
    """Takes commands, has them sent until the device answers, and hands the answers out."""

    def __init__(self, device: GatewayDevice, controller: MotionController, on_reference: OnReference) -> None:
        self._device, self._controller, self._on_reference = device, controller, on_reference
        self._own_tickets = itertools.count(-1, -1)  # of the gateway's own commands that it wants to hear of
        self._listeners: dict[int, OnAnswer] = {}  # by such a ticket
        self._heard: list[tuple[OnAnswer, DeviceCommandResponse]] = []

    def ask(self, request: DeviceCommandRequest, ticket: int, goal_is_active: bool, moment: Moment) -> bool:
        """Have it sent, or answer at once why not; true if it will be sent."""
        kind = kind_of(request)
        try:
            if reason := self._device.unreachable_reason(moment) or self._objection(kind, goal_is_active):
                raise invalid(reason)
            if self._device.commands.is_full:
                raise invalid(because("command.too_many"))
            arguments = arguments_of(request, self._device.arm)
        except GoalRejected as rejected:
            self._answer(ticket, rejected.reason)
            return False
        self._device.commands.ask(kind, moment, self._device.parameters.command_timeout, ticket, arguments)
        return True

    def have_sent(
        self, kind: DeviceCommandKind, arguments: Arguments, on_answer: OnAnswer | None, moment: Moment
    ) -> None:
        """Have a command of the gateway's own sent; `on_answer` hears what became of it."""
        ticket = next(self._own_tickets)
        if on_answer is not None:
            self._listeners[ticket] = on_answer
        self._device.commands.ask(kind, moment, self._device.parameters.command_timeout, ticket, arguments)
        self.send_due(moment)

    def stop(self, kind: DeviceCommandKind, ticket: int, goal_is_active: bool, moment: Moment) -> bool:
        """Have a stop sent, whatever is known of the device; true unless it is refused because the arm moves."""
        controller = self._controller
        if reason := self._objection(kind, goal_is_active):
            self._answer(ticket, reason)
            return False
        stream = controller.stream.id if controller.stream is not None else 0
        self._device.commands.ask(kind, moment, self._device.parameters.command_timeout, ticket, stream=stream)
        return True

    def on_reply(self, reply: CommandReply, moment: Moment) -> None:
        """The device has answered a command; a stop that it refused for form's sake is sent again without the form."""
        command = self._device.commands.find(reply)
        is_present = reply.boot_id == self._device.session.boot_id
        if command is None or not (is_present or command.is_stop):
            return
        if reply.code in (Code.EXPIRED, Code.WRONG_BOOT):
            return self._insist(command, Code(reply.code), moment)
        accepted = reply.code in (Code.OK, Code.DUPLICATE)
        if accepted and is_present:
            self._note(command, reply, moment)
            if not command.is_stop and command.tickets:
                command.answer, command.answered = reply, moment.monotonic
                return self.tell_shown(moment)
        self._device.commands.remove(command)
        reason = self._device.unreachable_reason(moment) if accepted else complaint(command.kind, reply)
        for ticket in command.tickets:
            self._answer(ticket, reason, reply.mode, accepted=accepted, sent=True)
        if not command.tickets and reason is not None and not accepted:
            self._device.event("command_refused", reason, moment)

    def tell_shown(self, moment: Moment) -> None:
        """Answer what the newest state shows, so that nobody who was answered is told of a time before.

        A stop is answered at once.
        """
        for command, reply in self._device.commands.shown(self._device.session.latest, moment):
            for ticket in command.tickets:
                reason = self._device.unreachable_reason(moment)
                self._answer(ticket, reason, reply.mode, accepted=True, sent=True)

    def tell_listeners(self, moment: Moment) -> None:
        """Hand the answers to the gateway's own commands to those who wait for them."""
        if not self._heard:
            return
        heard, self._heard = self._heard, []
        for listener, response in heard:
            listener(response, moment)

    def send_due(self, moment: Moment) -> None:
        """Send what is new or was not answered."""
        device, session = self._device, self._device.session
        if not session.link_up or device.commands.is_empty:
            return
        is_reachable = not device.unreachable_reason(moment)
        for frame in device.commands.due(moment, session.clock, session.boot_id, is_reachable):
            device.out.send(Kind.CMD, encode(frame), urgent=frame.cmd in STOPPING)

    def step(self, moment: Moment) -> None:
        """Give up what was not answered in time; a STOP of our own is asked for again."""
        if self._device.commands.is_empty:
            return
        for command in self._device.commands.expired(moment):
            state = self._device.session.latest
            if command.kind == DeviceCommandKind.HOLD and state is not None:
                self._controller.hold_answered(state.mode == DeviceMode.HOLD, state.t_us)
            for ticket in command.tickets:
                self._answer(ticket, self._silence(command, moment), sent=command.times_sent > 0)
            if command.is_own and command.kind == DeviceCommandKind.STOP:
                self._controller.stop(moment)
        self.tell_shown(moment)
        self.send_due(moment)

    def drop_all(self, reason: Reason) -> None:
        """The device these commands were for is gone; a person's stop is sent on, to whatever is there."""
        for command in self._device.commands.drop_all_but_stops():
            for ticket in command.tickets:
                self._answer(ticket, reason, sent=command.times_sent > 0)

    def _insist(self, command: PendingCommand, code: Code, moment: Moment) -> None:
        if not command.is_stop:
            return
        if code == Code.EXPIRED:
            command.needs_clock = False
        else:
            command.needs_boot = False
        command.sent = -math.inf
        self.send_due(moment)

    def _silence(self, command: PendingCommand, moment: Moment) -> Reason:
        """What is known of a command that was not answered in time."""
        name, unreachable = command.kind.name, self._device.unreachable_reason(moment)
        if not command.times_sent and unreachable is not None:
            return because("command.not_sent", unreachable, command=name)
        known: dict[str, Value] = {"command": name, "count": command.times_sent}
        if unreachable is not None:
            unanswered = because("command.unanswered.unreachable", unreachable, **known)
        else:
            unanswered = because("command.unanswered", **known)
        return self._with_last_state(unanswered, moment) if command.is_stop else unanswered

    def _with_last_state(self, unanswered: Reason, moment: Moment) -> Reason:
        """`unanswered`, and how the arm was by the newest state, where one has come."""
        session = self._device.session
        age = moment.monotonic - session.state_arrival
        if session.latest is None or age > KNOWN:
            return unanswered
        moves = any(session.latest.velocity)
        code = "command.last_state.moves" if moves else "command.last_state.stands"
        return because(code, unanswered, age=age, mode=session.mode.name)

    def _objection(self, kind: DeviceCommandKind, goal_is_active: bool) -> Reason | None:
        if goal_is_active and kind in AT_REST:
            return because("command.goal_active", command=kind.name)
        return self._device.configuration.mismatch_reason() if kind in TRUSTING else None

    def _note(self, command: PendingCommand, reply: CommandReply, moment: Moment) -> None:
        match command.kind:
            case DeviceCommandKind.STOP:
                self._controller.stop_answered(reply.t_us)
            case DeviceCommandKind.HOLD:
                self._controller.hold_answered(reply.mode == DeviceMode.HOLD, reply.t_us)
            case kind if kind in AT_REST:
                self._controller.transmission.forget()
                if kind == DeviceCommandKind.REFERENCE:
                    given = command.arguments
                    self._on_reference(given.argument, given.positions, reply.t_us, moment)

    def _answer(
        self, ticket: int, reason: Reason | None, mode: int | None = None, *, accepted: bool = False, sent: bool = False
    ) -> None:
        said = mode is not None and mode in DeviceMode._value2member_map_
        known = DeviceMode(mode or 0) if said else self._device.session.mode
        text = str(reason or "")
        response = DeviceCommandResponse(accepted=accepted, sent=sent, reason=text, mode=known, why=reason)
        if ticket < 0:
            if (listener := self._listeners.pop(ticket, None)) is not None:
                self._heard.append((listener, response))
            return
        self._device.out.put(Answer(ticket, response))


def complaint(kind: DeviceCommandKind, reply: CommandReply) -> Reason:
    """Why the device has refused a command, with the remedy where there is one."""
    mend = REMEDIES.get(reply.code)
    if reply.code == Code.NOT_READY:
        mend = NOT_NOW.get(kind, mend)
    mode = DeviceMode(reply.mode).name if reply.mode in DeviceMode._value2member_map_ else str(reply.mode)
    refused = {"command": kind.name, "mode": mode, "answer": code_name(reply.code)}
    if mend is None:
        return because("command.refused.unexplained", **refused)
    return because("command.refused", remedy(mend), **refused)
