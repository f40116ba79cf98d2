"""`gemelo stop --ready`: connected beforehand, so that a stop needs no new connection; each Enter or space is one."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import gemelo
from gemelo.api.errors import reason_of
from gemelo.schemas.device import StopKind
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.tools.cli.common.errors import CommandError, ExitCode, text_of
from gemelo.tools.cli.common.language import sentence

if TYPE_CHECKING:
    from gemelo import Arm

STOPS = (" ", "\n", "\r")
LEAVES = ("q", "\x04")
LOOK = 0.2  # [s] between two looks at the connection
Read = Callable[[float], str]


def wait_ready(arm: Arm) -> ExitCode:
    """Stops the arm at each key until q; raises `CommandError` where the connection has ended for good."""
    from gemelo.tools.cli.motion.jog_keys import keyboard, require_terminal  # for commands with keys

    require_terminal("stop_at_once")
    with keyboard() as read:
        return watch(arm, read)


def watch(arm: Arm, read: Read) -> ExitCode:
    """As `wait_ready`; `read(timeout [s])` gives what was typed, or nothing."""
    printed = None
    while True:
        if (now := standing(arm)) != printed:
            printed = now
            print(sentence(now), flush=True)
        typed = read(LOOK)
        if any(key in STOPS for key in typed):
            print(stopped(arm), flush=True)
        if any(key in LEAVES for key in typed):
            return ExitCode.OK


def standing(arm: Arm) -> Reason:
    """Whether a stop would reach the gateway now; raises `CommandError` where it never will again."""
    try:
        node = arm.node
    except gemelo.Lost as error:
        raise CommandError(because("cli.stop.again", reason_of(error)), ExitCode.NO_STACK) from error
    if not node.is_connected:
        return because("cli.stop.no_router")
    if not node.is_served(DEVICE_STOP):
        return because("cli.stop.no_server", node=DEVICE_STOP.server)
    return because("cli.stop.ready", robot=node.robot)


def stopped(arm: Arm) -> str:
    """Sends a stop and tells what became of it; one that fails does not end the waiting."""
    began = time.monotonic()
    try:
        answer = arm.device.send(StopKind.STOP)
    except gemelo.Error as error:
        print(f"stop: {text_of(error)}", file=sys.stderr, flush=True)
        return sentence(because("cli.stop.unconfirmed"))
    took = (time.monotonic() - began) * 1e3
    return sentence(because("cli.stop.done", time=took, mode=answer.mode.name))
