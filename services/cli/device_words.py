"""What the shell may complete after the commands about the device: the names of robot.toml."""

from __future__ import annotations

from typing import TYPE_CHECKING

from services.cli.device_press import HELD, PRESSES
from services.cli.exits import CommandError
from services.cli.parser import Words

if TYPE_CHECKING:
    from services.arm.description import Arm


def arm() -> Arm | None:
    """The deployment's arm; None where it cannot be read, for a shell's start is no place to complain."""
    from services.cli.session import load

    try:
        return load()[1]
    except CommandError:
        return None


def joints() -> Words:
    """Those that can home."""
    known = arm()
    return {"": [joint.name for joint in known.joints if joint.drive.homing is not None]} if known else {}


def outputs() -> Words:
    """Their names, then on and off."""
    known = arm()
    names = [output.name for output in known.outputs] if known else []
    return {"": names, **dict.fromkeys(names, ("on", "off"))}


def presses() -> Words:
    """The words, then what they are done to."""
    words: dict[str, list[str]] = {"": list(PRESSES)}
    known = arm()
    if known is None:
        return words
    parts = {
        "JOINT": known.joint_names,
        "INPUT": tuple(each.name for each in known.inputs),
        "SENSOR": tuple(each.name for each in known.sensors),
    }
    for word, press in PRESSES.items():
        names = parts.get(press.follows[0], ()) if press.follows else ()
        words |= {word: list(names)} if names else {}
    words |= {f"switch {name}": list(HELD) for name in parts["INPUT"]}
    return words
