"""`gemelo jog`: move by hand, with keys or for a given time; what is not said again stops the arm."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable

import msgspec

from schemas.planning import JogCommand, JogLimit, JogStatus
from schemas.topics import JOG, JOG_STATUS, JOINT_STATES
from services.arm.kinematics import Kinematics
from services.cli.exits import CommandError, ExitCode
from services.cli.interrupt import two_stage_interrupt
from services.cli.jog_commands import HELP
from services.cli.jog_keys import JogKeys
from services.cli.keyboard import keyboard
from services.cli.live import LiveBlock
from services.cli.session import Session
from services.cli.units import show

PERIOD = 0.02  # [s] between two commands
ANSWER = 3.0  # [s] that the planner may take to its first word
REST = 5.0  # [s] that the arm may take to come to rest
FIRST_STATE = 1.0  # [s]
DRAWN = 0.1  # [s]


class Jogging:
    """One client's commands, and what the planner says to them."""

    def __init__(self, session: Session) -> None:
        self.node, self.arm = session.node, session.arm
        self._commands = self.node.publisher(JOG)
        self._states = self.node.latest(JOINT_STATES)
        self.status: JogStatus | None = None
        self.limits: dict[tuple[str, str], JogLimit] = {}  # all that did, as it was last
        self._kinematics = Kinematics(self.arm)
        self.node.subscribe(JOG_STATUS, self._on_status)

    def say(self, command: JogCommand) -> None:
        self._commands.put(msgspec.structs.replace(command, stamp=self.node.now()))

    @property
    def place(self) -> str:
        """Where the arm stands, for a person."""
        state = self._states.message
        found = {} if state is None else dict(zip(state.name, state.position, strict=False))
        if any(name not in found for name in self.arm.joint_names):
            return "no joint_states: is the stepper_gateway running?"
        x, y, z = (1e3 * value for value in self._kinematics.tool([found[n] for n in self.arm.joint_names]).position)
        joints = ", ".join(f"{joint.name} {show(found[joint.name], joint.unit, 2)}" for joint in self.arm.joints)
        return f"tool x {x:z.1f}  y {y:z.1f}  z {z:z.1f} mm; {joints}"

    def await_state(self) -> None:
        """Until it is known where the arm stands; not for long, for without the stack it never will be."""
        end = self.node.monotonic() + FIRST_STATE
        while self._states.message is None and self.node.monotonic() < end:
            self.node.wait(PERIOD)

    def _on_status(self, status: JogStatus) -> None:
        self.status = status
        self.limits |= {(limit.check, limit.subject): limit for limit in status.limits}


def jog_for(session: Session, command: JogCommand, seconds: float) -> ExitCode:
    """Says `command` for so long, waits until the arm rests, and tells where; a refusal is raised with its reason."""
    jogging = Jogging(session)
    with two_stage_interrupt() as interrupt:
        began = jogging.node.monotonic()
        while jogging.node.monotonic() - began < seconds and not interrupt.is_set:
            jogging.say(command)
            jogging.node.wait(PERIOD)
            _require_answer(jogging, jogging.node.monotonic() - began)
        _rest(jogging)
    print(jogging.place)
    for limit in jogging.limits.values():
        print(f"limited by {limit.message}")
    return ExitCode.CANCELLED if interrupt.is_set else ExitCode.OK


def jog_by_hand(session: Session) -> ExitCode:
    """Follows the keys until one that leaves; letting go stops."""
    with keyboard() as typed, two_stage_interrupt() as interrupt:
        jogging, keys, block = Jogging(session), JogKeys(session.arm.joints, session.arm.tool_frame), LiveBlock()
        block.say(HELP)
        jogging.await_state()
        drawn = 0.0
        while not (keys.wants_to_leave or interrupt.is_set):
            now = jogging.node.monotonic()
            keys.press(typed(), now)
            command = keys.command(now)
            if command is not None:
                jogging.say(command)
            if now - drawn >= DRAWN:
                drawn = now
                block.draw(_folded([keys.line, jogging.place, *words_of(jogging.status)]))
            jogging.node.wait(PERIOD)
        _rest(jogging)
        block.say(jogging.place)
    return ExitCode.OK


def words_of(status: JogStatus | None) -> list[str]:
    """The newest word of the planner, a line each."""
    if status is None or not (status.active or status.limited_by):
        return ["at rest"]
    if not status.active:
        return [f"refused: {status.limited_by}"]
    share = f"{100.0 * status.scale:.0f} % of the asked speed"
    if not status.limits:
        return [share]
    return [f"{share}, limited by", *(f"  {limit.message}" for limit in status.limits)]


def _folded(lines: Iterable[str]) -> str:
    """No line longer than the terminal is wide: a sentence that says what to do is not to be cut off."""
    width = max(20, shutil.get_terminal_size().columns - 1)
    return "\n".join(part for line in lines for part in textwrap.wrap(line, width, subsequent_indent="  "))


def _require_answer(jogging: Jogging, waited: float) -> None:
    status = jogging.status
    if status is None and waited > ANSWER:
        raise CommandError("the planner does not answer: is it running? (`gemelo node list`)", ExitCode.NO_STACK)
    if status is not None and not status.active and status.limited_by:
        raise CommandError(f"refused: {status.limited_by}")


def _rest(jogging: Jogging) -> None:
    """Waits until the planner leads no more."""
    end = jogging.node.monotonic() + REST
    while jogging.status is not None and jogging.status.active and jogging.node.monotonic() < end:
        jogging.node.wait(PERIOD)
