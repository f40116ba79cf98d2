"""`gemelo device press`: what a hand could do to a virtual device, or an accident."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.device import PressKind, PressRequest
from schemas.topics import DEVICE_PRESS
from services.cli.device_names import joint_of, require_name
from services.cli.device_view import DeviceView
from services.cli.exits import CommandError, ExitCode, usage
from services.cli.names import unknown

if TYPE_CHECKING:
    from services.arm.description import Arm
    from services.cli.session import Session

TIMEOUT = 3.0  # [s]
HELD = {"on": 1.0, "off": 0.0, "auto": -1.0}


@dataclass(frozen=True)
class Press:
    """One word of the command: what follows it, what it does, and the request it becomes."""

    follows: tuple[str, ...]
    about: str
    request: Callable[[Arm, Sequence[str]], PressRequest]


def request_of(arm: Arm, word: str, rest: Sequence[str]) -> PressRequest:
    """The request that the words ask for; raises with what would be right."""
    if word not in PRESSES:
        raise unknown("thing to press", word, PRESSES)
    press = PRESSES[word]
    if len(rest) != len(press.follows):
        raise usage(f"write it as: gemelo device press {' '.join([word, *press.follows])}")
    return press.request(arm, rest)


def press(session: Session, word: str, rest: Sequence[str]) -> ExitCode:
    """Presses, and says what the virtual device answered."""
    request = request_of(session.arm, word, rest)
    status = DeviceView(session).require_status()
    if status.online and not status.virtual:
        raise CommandError(f"{status.device} is a real device: press it by hand; only a virtual one takes requests")
    answer = session.node.call(DEVICE_PRESS, request, timeout=TIMEOUT)
    if not answer.accepted:
        raise CommandError(f"press refused: {answer.reason}")
    print(f"{' '.join([word, *rest])}: done")
    return ExitCode.OK


def number(text: str, what: str) -> float:
    """A finite number; raises naming `what`."""
    try:
        value = float(text)
    except ValueError:
        raise usage(f'"{text}" is not a number of {what}') from None
    if not math.isfinite(value):
        raise usage(f"{text} {what} is not finite")
    return value


def seconds(text: str) -> float:
    """A time that is not negative."""
    value = number(text, "s")
    if value < 0.0:
        raise usage(f"{text} s is negative")
    return value


def _switch(arm: Arm, rest: Sequence[str]) -> PressRequest:
    name = require_name("input", rest[0], arm.inputs)
    if rest[1] not in HELD:
        raise usage(f'a switch is held on, held off, or left on auto, not "{rest[1]}"')
    return PressRequest(press=PressKind.SWITCH, target=name, value=HELD[rest[1]])


def _joint(kind: PressKind, value: float) -> Callable[[Arm, Sequence[str]], PressRequest]:
    return lambda arm, rest: PressRequest(press=kind, target=joint_of(arm, rest[0]).name, value=value)


def _slip(arm: Arm, rest: Sequence[str]) -> PressRequest:
    return PressRequest(press=PressKind.SLIP, target=joint_of(arm, rest[0]).name, value=number(rest[1], "steps"))


def _sensor(arm: Arm, rest: Sequence[str]) -> PressRequest:
    name = require_name("sensor", rest[0], arm.sensors)
    return PressRequest(press=PressKind.SENSOR, target=name, value=number(rest[1], f"sensor {name}"))


def _timed(kind: PressKind) -> Callable[[Arm, Sequence[str]], PressRequest]:
    return lambda arm, rest: PressRequest(press=kind, value=seconds(rest[0]))


PRESSES = {
    "estop": Press((), "press the emergency stop", lambda arm, rest: PressRequest(press=PressKind.ESTOP, value=1.0)),
    "release": Press((), "release it", lambda arm, rest: PressRequest(press=PressKind.ESTOP, value=0.0)),
    "block": Press(("JOINT",), "hold the joint's shaft fast", _joint(PressKind.BLOCK, 1.0)),
    "free": Press(("JOINT",), "let it go", _joint(PressKind.BLOCK, 0.0)),
    "slip": Press(("JOINT", "STEPS"), "push the shaft on by steps that the counter does not see", _slip),
    "switch": Press(("INPUT", "on|off|auto"), "hold a switch pressed, or open, or leave it to the arm", _switch),
    "sensor": Press(("SENSOR", "VALUE"), "give a sensor its reading", _sensor),
    "reboot": Press((), "restart the device", lambda arm, rest: PressRequest(press=PressKind.REBOOT)),
    "offline": Press(("SECONDS",), "take its network away for so long", _timed(PressKind.OFFLINE)),
    "freeze": Press(("SECONDS",), "let its path task hang for so long", _timed(PressKind.FREEZE)),
    "drift": Press(
        ("PPM",),
        "make its clock fast by so many parts per million",
        lambda arm, rest: PressRequest(press=PressKind.DRIFT, value=number(rest[0], "ppm")),
    ),
}


def listing() -> str:
    """Everything that can be pressed."""
    lines = [(" ".join([word, *press.follows]), press.about) for word, press in PRESSES.items()]
    width = max(len(words) for words, _ in lines)
    return "\n".join(f"  {words:<{width}}  {about}" for words, about in lines)
