"""Commands to the device: sent again until it answers, and never carried out twice or too late."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.device import DeviceCommandKind
from services.stepper_gateway.clock import ClockSync
from services.stepper_gateway.links.frames import Command, CommandReply
from services.stepper_gateway.moment import Moment

RETRY = 0.1  # [s]
TIME_TO_LIVE = 500_000  # [us]
INTERNAL = 0  # ticket of the gateway's own commands
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


@dataclass
class PendingCommand:
    """A command that the device has not answered yet."""

    cmd_id: int
    kind: DeviceCommandKind
    arguments: Arguments
    ticket: int
    deadline: float  # [s] monotonic
    sent: float = -1.0e9  # [s] monotonic, the last time


class Commands:
    """All commands under way to one boot of the device."""

    def __init__(self, first_id: int) -> None:
        self._next_id = first_id
        self._pending: list[PendingCommand] = []

    def ask(
        self, kind: DeviceCommandKind, moment: Moment, timeout: float, ticket: int = INTERNAL,
        arguments: Arguments = NO_ARGUMENTS,
    ) -> None:  # fmt: skip
        """Have `kind` sent with the next frames."""
        self._next_id = self._next_id % 0xFFFFFFFF + 1
        deadline = moment.monotonic + timeout
        self._pending.append(PendingCommand(self._next_id, kind, arguments, ticket, deadline))

    def is_pending(self, kind: DeviceCommandKind) -> bool:
        return any(command.kind == kind for command in self._pending)

    def hindrance(self) -> str:
        """Why nothing may be started now, empty if it may."""
        asked = [c.kind.name for c in self._pending if c.ticket != INTERNAL and c.kind in EXCLUSIVE]
        return f"the device has not answered {asked[0]} yet: wait a moment" if asked else ""

    def due(self, moment: Moment, clock: ClockSync, boot_id: int) -> list[Command]:
        """The frames to send now."""
        frames = []
        for command in self._pending:
            if moment.monotonic - command.sent >= RETRY:
                command.sent = moment.monotonic
                expires = clock.device_time(moment.monotonic) + TIME_TO_LIVE
                frames.append(
                    Command(
                        boot_id=boot_id,
                        cmd_id=command.cmd_id,
                        expires_us=expires,
                        cmd=command.kind,
                        index=command.arguments.index,
                        argument=command.arguments.argument,
                        positions=command.arguments.positions,
                    )
                )
        return frames

    def answered(self, reply: CommandReply) -> PendingCommand | None:
        """The command that this reply belongs to, once."""
        for command in self._pending:
            if command.cmd_id == reply.cmd_id and command.kind == reply.cmd:
                self._pending.remove(command)
                return command
        return None

    def expired(self, moment: Moment) -> list[PendingCommand]:
        """Commands that the device has not answered in time; they are given up."""
        late = [command for command in self._pending if moment.monotonic >= command.deadline]
        self._pending = [command for command in self._pending if command not in late]
        return late

    def drop_all(self) -> list[PendingCommand]:
        """Everything under way, given up."""
        dropped, self._pending = self._pending, []
        return dropped
