"""Commands to the device: sent again until it answers, and never carried out twice or too late."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gemelo.schemas.device import DeviceCommandKind
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.links.frames import ANY_BOOT, NEVER_EXPIRES, CommandFrame, CommandReply, StateFrame
from gemelo.services.stepper_gateway.moment import Moment

RETRY = 0.1  # [s] chosen: five states, as an answer may just be late
REPEAT = (
    0.01  # [s] after which a stop that is asked for again is sent again at once; chosen: a flood costs 100 frames/s
)
REPEATS_AT_ONCE = 3  # which a stop is sent again without that pause; chosen: people, not floods
TIME_TO_LIVE = 500_000  # [us] chosen: a command that is later than a lost heartbeat's 0.5 s must not act
SHOWN_WITHIN = 0.2  # [s] that an answer waits for the state that shows it; chosen: ten states
INTERNAL = 0  # ticket of the gateway's own commands that nobody waits for; chosen: no client has it
EXCLUSIVE = (  # what a person has asked for would hit whatever is started before the answer
    DeviceCommandKind.STOP,
    DeviceCommandKind.RESET,
    DeviceCommandKind.REFERENCE,
    DeviceCommandKind.ARM,
    DeviceCommandKind.DISARM,
    DeviceCommandKind.HOME,
)


@dataclass(frozen=True, slots=True)
class Arguments:
    """What a command says besides its kind, as the frame has it."""

    positions: tuple[int, ...] = ()  # [1/256 step] of REFERENCE
    index: int = 0
    argument: int = 0


NO_ARGUMENTS = Arguments()
STOPPING = (DeviceCommandKind.STOP, DeviceCommandKind.HOLD, DeviceCommandKind.DISARM)
MOST_UNDER_WAY = 16  # commands that the device has not answered, but for stops; chosen: a person has one or two
MOST_TICKETS = 256  # of one command; chosen: who asks for the same again is answered with the others


@dataclass
class PendingCommand:
    """A command that the device has not answered yet."""

    cmd_id: int
    kind: DeviceCommandKind
    arguments: Arguments
    tickets: list[int]  # of all who have asked for it; none for the gateway's own
    deadline: float  # [s] monotonic
    is_own: bool = False  # the gateway itself wants it, whoever else does
    stream: int = 0  # that was played or sent when it was asked for
    sent: float = -1.0e9  # [s] monotonic, the last time; earlier where it is to be sent again before RETRY has passed
    last_sent: float = -1.0e9  # [s] monotonic
    times_sent: int = 0
    repeats: int = 0  # that have followed one another faster than REPEAT
    needs_clock: bool = True  # false once a device has called a stop late: then it is sent without an expiry
    needs_boot: bool = True  # false once a device was another boot: then a stop is sent to whatever boot is there
    answer: CommandReply | None = None  # that it is accepted; kept until a state shows what it did
    answered: float = 0.0  # [s] monotonic

    @property
    def is_stop(self) -> bool:
        """True if it ends a motion: then it is sent without a status, a clock or even a known boot."""
        return self.kind in STOPPING

    def repeat(self, moment: Moment) -> None:
        """Another caller wants it too: it is due again now, or REPEAT after it was sent where that is often enough."""
        is_early = moment.monotonic - self.last_sent < REPEAT
        self.repeats = self.repeats + 1 if is_early else 0
        may_wait = self.times_sent <= 1 or self.repeats > REPEATS_AT_ONCE
        self.sent = self.last_sent + REPEAT - RETRY if is_early and may_wait else -math.inf


class PendingCommands:
    """All commands under way to one boot of the device."""

    def __init__(self, first_id: int) -> None:
        self._next_id = first_id
        self._pending: list[PendingCommand] = []

    def ask(
        self, kind: DeviceCommandKind, moment: Moment, timeout: float, ticket: int = INTERNAL,
        arguments: Arguments = NO_ARGUMENTS, stream: int = 0,
    ) -> None:  # fmt: skip
        """Have `kind` sent with the next frames and given up after `timeout` [s].

        A stop of the same stream that is under way serves this caller too.
        """
        tickets = [] if ticket == INTERNAL else [ticket]
        under_way = self._stop_under_way(kind, stream)
        if under_way is not None:
            under_way.tickets += tickets
            under_way.is_own |= not tickets
            under_way.repeat(moment)
            return
        self._next_id = self._next_id % 0xFFFFFFFF + 1
        deadline = moment.monotonic + timeout
        command = PendingCommand(self._next_id, kind, arguments, tickets, deadline, not tickets, stream)
        self._pending.insert(self._place_of(command), command)

    @property
    def is_full(self) -> bool:
        """True if no command but a stop may be added until the device has answered others."""
        return sum(not command.is_stop for command in self._pending) >= MOST_UNDER_WAY

    @property
    def is_empty(self) -> bool:
        """True if no command is under way."""
        return not self._pending

    def is_pending(self, kind: DeviceCommandKind) -> bool:
        return bool(self._pending) and any(command.kind == kind for command in self._pending)

    def not_ready_reason(self) -> Reason | None:
        """Why nothing may be started now, None if it may."""
        if not self._pending:
            return None
        requested = [c.kind.name for c in self._pending if c.tickets and c.kind in EXCLUSIVE]
        return because("command.under_way", command=requested[0]) if requested else None

    def due(self, moment: Moment, clock: ClockSync, boot_id: int, is_reachable: bool) -> list[CommandFrame]:
        """The frames to send now; to a device that is not reachable, or not known, only those that stop it."""
        frames = []
        for command in self._pending:
            may_be_sent = command.answer is None and (is_reachable or command.is_stop)
            if may_be_sent and moment.monotonic - command.sent >= RETRY:
                command.sent = command.last_sent = moment.monotonic
                command.times_sent += 1
                command.needs_clock &= is_reachable  # one that is silent may read it whenever it wakes
                frames.append(
                    CommandFrame(
                        boot_id=boot_id if command.needs_boot else ANY_BOOT,
                        cmd_id=command.cmd_id,
                        expires_us=self._expiry(command, moment, clock),
                        cmd=command.kind,
                        index=command.arguments.index,
                        argument=command.arguments.argument,
                        positions=command.arguments.positions,
                    )
                )
        return frames

    def find(self, reply: CommandReply) -> PendingCommand | None:
        """The command under way that this reply belongs to and that was not answered before."""
        unanswered = (c for c in self._pending if c.answer is None)
        return next((c for c in unanswered if c.cmd_id == reply.cmd_id and c.kind == reply.cmd), None)

    def shown(self, state: StateFrame | None, moment: Moment) -> list[tuple[PendingCommand, CommandReply]]:
        """Accepted commands whose effect `state` shows, or that have waited for one long enough; they are over."""
        told = []
        for command in self._pending:
            reply = command.answer
            if reply is not None and (_is_since(state, reply) or moment.monotonic - command.answered >= SHOWN_WITHIN):
                told.append((command, reply))
        for command, _ in told:
            self._pending.remove(command)
        return told

    def remove(self, command: PendingCommand) -> None:
        self._pending.remove(command)

    def expired(self, moment: Moment) -> list[PendingCommand]:
        """Commands that the device has not answered in time; they are given up."""
        late = [c for c in self._pending if c.answer is None and moment.monotonic >= c.deadline]
        self._pending = [command for command in self._pending if command not in late]
        return late

    def drop_all_but_stops(self) -> list[PendingCommand]:
        """Gives up what is under way but the stops that somebody has asked for."""
        dropped = [command for command in self._pending if not (command.is_stop and command.tickets)]
        self._pending = [command for command in self._pending if command not in dropped]
        return dropped

    def _stop_under_way(self, kind: DeviceCommandKind, stream: int) -> PendingCommand | None:
        """One that is the same and has room for another caller."""
        alike = (c for c in self._pending if c.is_stop and c.kind == kind and c.stream == stream)
        return next((c for c in alike if len(c.tickets) < MOST_TICKETS), None)

    def _place_of(self, command: PendingCommand) -> int:
        """Stops go before everything that is under way."""
        return sum(each.is_stop for each in self._pending) if command.is_stop else len(self._pending)

    @staticmethod
    def _expiry(command: PendingCommand, moment: Moment, clock: ClockSync) -> int:
        """[us] of the device's clock after which the device refuses the command."""
        if command.is_stop and not (clock.is_synchronised and command.needs_clock):
            return NEVER_EXPIRES
        return clock.device_time(moment.monotonic) + TIME_TO_LIVE


def _is_since(state: StateFrame | None, reply: CommandReply) -> bool:
    """True if the device measured `state` after it had answered."""
    return state is not None and state.boot_id == reply.boot_id and state.t_us > reply.t_us
