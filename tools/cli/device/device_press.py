"""`gemelo device press`: a person's hand on a virtual device, or an accident."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import gemelo
from gemelo.schemas.device import InjectKind, InjectRequest
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, joint_of, require_name, unknown, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.units import LENGTH, TIME, parse_quantity
from gemelo.tools.cli.parser import Choices, Options, Parser

if TYPE_CHECKING:
    from gemelo import Arm, Robot
    from gemelo.libraries.arm.model.description import ArmDescription

HELD = {"on": 1.0, "off": 0.0, "auto": -1.0}


def add_options(parser: Parser) -> None:
    """Adds the words, and a list of all ways of pressing."""
    parser.add_argument("what", metavar="WHAT", help="see below")
    parser.add_argument("rest", metavar="VALUE", nargs="*", default=[], help="what it is done to, and how much")
    parser.epilog = f"what:\n{listing()}\n\n{parser.epilog}"


def run(options: Options) -> ExitCode:
    """Presses; wrong words are refused before the stack is asked."""
    robot = load_robot()
    request_of(robot.description, options.what, options.rest)
    with connect_arm(robot) as arm:
        return press(arm, options.what, options.rest)


def choices(robot: Robot | None) -> Choices:
    """The ways of pressing, then the parts of the robot that they are for."""
    words: dict[str, list[str]] = {"": list(PRESSES)}
    if robot is None:
        return words
    arm = robot.description
    parts = {
        "JOINT": arm.joint_names,
        "INPUT": tuple(each.name for each in arm.inputs),
        "SENSOR": tuple(each.name for each in arm.sensors),
    }
    for word, press in PRESSES.items():
        names = parts.get(press.follows[0], ()) if press.follows else ()
        words |= {word: list(names)} if names else {}
    words |= {f"switch {name}": list(HELD) for name in parts["INPUT"]}
    return words


@dataclass(frozen=True)
class Press:
    """One way of pressing: its arguments, its meaning, and the request it becomes."""

    follows: tuple[str, ...]
    about: str
    request: Callable[[ArmDescription, Sequence[str]], InjectRequest]


def request_of(arm: ArmDescription, word: str, rest: Sequence[str]) -> InjectRequest:
    """The request that the words ask for; raises `CommandError` with the right form."""
    if word not in PRESSES:
        raise unknown("thing to press", word, PRESSES)
    press = PRESSES[word]
    if len(rest) != len(press.follows):
        raise usage(because("press.form", words=" ".join([word, *press.follows])))
    return press.request(arm, rest)


def press(arm: Arm, word: str, rest: Sequence[str]) -> ExitCode:
    """Presses and prints that it is done; raises `CommandError` for a refusal, and a device that is not virtual."""
    request = request_of(arm.description, word, rest)
    try:
        arm.device.inject(request.kind.value, request.target, request.value)
    except gemelo.Refused as error:
        raise CommandError(error if error.check == "virtual" else because("press.refused", error.reason)) from error
    print(sentence(because("press.done", words=" ".join([word, *rest]))))
    return ExitCode.OK


def number(text: str, what: str) -> float:
    """A finite number of `what`, a word of the catalogue or a sensor, in its unit; raises `CommandError` otherwise."""
    try:
        value = float(text)
    except ValueError:
        raise usage(because("press.not_a_number", text=text, what=what)) from None
    if not math.isfinite(value):
        raise usage(because("press.not_finite", text=text, what=what))
    return value


def seconds(text: str) -> float:
    """A time [s] that is not negative; raises `CommandError` otherwise."""
    value = parse_quantity(text, TIME)
    if value < 0.0:
        raise usage(because("press.negative", text=text))
    return value


def _switch(arm: ArmDescription, rest: Sequence[str]) -> InjectRequest:
    name = require_name("input", rest[0], arm.inputs)
    if rest[1] not in HELD:
        raise usage(because("press.held", text=rest[1]))
    return InjectRequest(kind=InjectKind.SWITCH, target=name, value=HELD[rest[1]])


def _joint(kind: InjectKind, value: float) -> Callable[[ArmDescription, Sequence[str]], InjectRequest]:
    return lambda arm, rest: InjectRequest(kind=kind, target=joint_of(arm, rest[0]).name, value=value)


def _slip(arm: ArmDescription, rest: Sequence[str]) -> InjectRequest:
    return InjectRequest(kind=InjectKind.SLIP, target=joint_of(arm, rest[0]).name, value=number(rest[1], "steps"))


def _sensor(arm: ArmDescription, rest: Sequence[str]) -> InjectRequest:
    name = require_name("sensor", rest[0], arm.sensors)
    return InjectRequest(kind=InjectKind.SENSOR, target=name, value=number(rest[1], name))


def _object(arm: ArmDescription, rest: Sequence[str]) -> InjectRequest:
    return InjectRequest(kind=InjectKind.OBJECT, value=parse_quantity(rest[0], LENGTH))


def _timed(kind: InjectKind) -> Callable[[ArmDescription, Sequence[str]], InjectRequest]:
    return lambda arm, rest: InjectRequest(kind=kind, value=seconds(rest[0]))


PRESSES = {
    "estop": Press((), "press the emergency stop", lambda arm, rest: InjectRequest(kind=InjectKind.ESTOP, value=1.0)),
    "release": Press((), "release it", lambda arm, rest: InjectRequest(kind=InjectKind.ESTOP, value=0.0)),
    "block": Press(("JOINT",), "hold the joint's shaft fast", _joint(InjectKind.BLOCK, 1.0)),
    "free": Press(("JOINT",), "let it go", _joint(InjectKind.BLOCK, 0.0)),
    "slip": Press(("JOINT", "STEPS"), "push the shaft on by steps that the counter does not see", _slip),
    "switch": Press(("INPUT", "on|off|auto"), "hold a switch pressed, or open, or leave it to the arm", _switch),
    "sensor": Press(("SENSOR", "VALUE"), "give a sensor its reading", _sensor),
    "object": Press(("WIDTH",), "put something so wide between the gripper's jaws, or 0: take it away", _object),
    "reboot": Press((), "restart the device", lambda arm, rest: InjectRequest(kind=InjectKind.REBOOT)),
    "offline": Press(("TIME",), "take its network away for so long", _timed(InjectKind.OFFLINE)),
    "freeze": Press(("TIME",), "let its path task hang for so long", _timed(InjectKind.FREEZE)),
    "drift": Press(
        ("PPM",),
        "make its clock fast by so many parts per million",
        lambda arm, rest: InjectRequest(kind=InjectKind.DRIFT, value=number(rest[0], "ppm")),
    ),
}


def listing() -> str:
    """All ways of pressing, a line each."""
    lines = [(" ".join([word, *press.follows]), press.about) for word, press in PRESSES.items()]
    width = max(len(words) for words, _ in lines)
    return "\n".join(f"  {words:<{width}}  {about}" for words, about in lines)
