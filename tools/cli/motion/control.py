"""`gemelo control`: becoming the only one who may move an arm, giving that back, and who it is."""

from __future__ import annotations

import getpass
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.api import control_file
from gemelo.libraries.runtime.process.ending import EndedBySignal, ended_by_signals
from gemelo.schemas.control import ControlState
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.parser import Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Arm


def take_options(parser: Parser) -> None:
    """Adds name, --force and a command."""
    parser.add_argument("--as", dest="name", metavar="NAME", default="", help="what others are told; your user name")
    parser.add_argument("--force", action="store_true", help="also from another holder, who slows to rest first")
    parser.add_argument("program", nargs="*", metavar="-- COMMAND", help="run it, and give control back at its end")


def run_take(options: Options) -> ExitCode:
    """Holds control until Ctrl-C, or until a command has ended."""
    with connect_arm() as arm:
        return take(arm, options.name or getpass.getuser(), options.force, options.program)


def run_give(options: Options) -> ExitCode:
    """Gives back what this user has taken on this host."""
    robot = load_robot()
    path = control_file.path_of(robot.description.name, robot.deployment)
    held = control_file.read(path)
    with connect_arm(robot) as arm:
        if held is None:
            raise CommandError(because("cli.control.none_shared", state_of(arm), path=str(path)))
        arm.control.give_with(held.secret)
        control_file.remove(path, held.secret)
        print(sentence(state_of(arm)))
    return ExitCode.OK


def run_who(options: Options) -> ExitCode:
    """Prints who holds control."""
    with connect_arm() as arm:
        if options.json:
            print(msgspec.json.encode(arm.control.state).decode())
        else:
            print(sentence(state_of(arm)))
    return ExitCode.OK


who_options = json_option


def take(arm: Arm, name: str, force: bool, program: Sequence[str]) -> ExitCode:
    """Takes control and lets this user's programs share it; raises `CommandError` where it is lost."""
    path = control_file.path_of(arm.name, arm.deployment)
    with ended_by_signals():
        secret = arm.control.take(name, force=force)
        try:
            control_file.write(path, secret, name)
            if program:
                return _run(arm, program)
            print(f"{sentence(state_of(arm))}\n{sentence(because('cli.control.shared'))}", flush=True)
            arm.wait_for(lambda: not arm.control.is_mine)
        except KeyboardInterrupt:
            print(f"\n{sentence(because('cli.control.giving'))}")
            return ExitCode.OK
        finally:
            control_file.remove(path, secret)
            if is_mine := arm.control.is_mine:
                with suppress(gemelo.Error):
                    arm.control.give()
    if not is_mine and not arm.control.state.given:
        raise CommandError(because("cli.control.lost", state_of(arm)))
    print(sentence(state_of(arm)))
    return ExitCode.OK


def state_of(arm: Arm) -> Reason:
    """Who holds control."""
    return describe(arm.control.state, arm.name, time.time())


def describe(state: ControlState, robot: str, now: float) -> Reason:
    """The state in a sentence; `now` [s] UNIX."""
    if not state.held:
        return because("cli.control.free", robot=robot)
    found = because(
        "cli.control.held",
        name=state.name, robot=robot, clock=time.strftime("%H:%M:%S", time.localtime(state.since * 1e-9)),
        age=max(0.0, now - state.since * 1e-9), node=state.node, host=state.host,
    )  # fmt: skip
    if shared := state.members[1:]:  # the first is the holder itself
        found = because("cli.control.held.shared", found, members=", ".join(shared))
    return because("cli.control.held.pending", found, state.why or plain(state.pending)) if state.pending else found


def _run(arm: Arm, program: Sequence[str]) -> ExitCode:
    """Runs a command under control; Ctrl-C is the command's own."""
    try:
        process = subprocess.Popen(program)
    except OSError as error:
        raise CommandError(because("cli.control.program", program=program[0], error=str(error.strerror))) from error
    while (code := process.poll()) is None:
        try:
            process.wait()
        except EndedBySignal:
            process.terminate()
        except KeyboardInterrupt:  # the terminal has told the command too
            continue
    if not arm.control.is_mine:
        raise CommandError(because("cli.control.lost_before", state_of(arm), program=Path(program[0]).name))
    if code:
        raise CommandError(because("cli.control.ended", program=Path(program[0]).name, code=code))
    return ExitCode.OK
