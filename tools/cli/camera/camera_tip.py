"""The tip with which an arm touches or points at what a camera sees: its length, and how far beside it is said."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

import gemelo
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.units import LENGTH, parse_quantity
from gemelo.tools.cli.parser import Parser

if TYPE_CHECKING:
    from gemelo import Arm


def tip_option(parser: Parser) -> None:
    """Adds the length of what touches or points."""
    said = "of what touches or points, beyond the tool's frame along its z (the length of the jaws)"
    parser.add_argument("--tip", metavar="LENGTH", default="", help=said)


def tip_length(text: str, robot: gemelo.Robot) -> float:
    """[m] what the option says, else the jaws' length; raises `CommandError`."""
    if text:
        return parse_quantity(text, LENGTH, "--tip")
    gripper = robot.description.gripper
    return gripper.jaw[2] if gripper is not None and gripper.jaw is not None else 0.0


def ask_offset(question: Reason) -> tuple[float, float]:
    """[m] x and y of the base, as a person says them; Enter alone is none. Raises `CommandError` if nobody is there."""
    while True:
        print(sentence(question), flush=True)
        line = sys.stdin.readline()
        if not line:
            raise CommandError(because("camera.nobody_to_look"))
        words = line.split()
        if not words:
            return 0.0, 0.0
        try:
            x, y = (parse_quantity(word, LENGTH) for word in words)
        except CommandError as error:
            print(sentence(because("camera.two_lengths.not_one", error.reason)))
            continue
        except ValueError:  # one word, or more than two
            print(sentence(because("camera.two_lengths")))
            continue
        return x, y


def step_floor(arm: Arm) -> float:
    """[m] by which the tool may be off as it stands now, with half a step of every joint: root of the squares."""
    joints = {name: arm.joints[name] for name in arm.joint_names}
    here = np.array(arm.fk(joints).position)
    moved = []
    for joint in arm.description.joints:
        half = 0.5 / joint.steps.per_unit
        moved.append(np.array(arm.fk({**joints, joint.name: joints[joint.name] + half}).position) - here)
    return float(np.sqrt(np.sum(np.square(moved))))
