"""Every number on the command line: its units, a number without one, and what cannot be, option by option."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.tools.cli.commands import COMMANDS
from gemelo.tools.cli.common import units
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.units import (
    ACCELERATION,
    ANGLE,
    ANGULAR_SPEED,
    LENGTH,
    QUANTITIES,
    SHARE,
    SPEED,
    TIME,
    Quantity,
    parse_joints,
)
from gemelo.tools.cli.device.device import reference_request
from gemelo.tools.cli.device.device_press import request_of
from gemelo.tools.cli.main import parse
from gemelo.tools.cli.motion.jog import command_of
from gemelo.tools.cli.motion.move_request import ik_request_from, request_from
from gemelo.tools.cli.parser import Options, Parser, complete
from gemelo.tools.cli.robot.scene_object import object_of
from tests.table import table

ARM = load_arm(Path(__file__).parents[2] / "urdf/rm1")
SPELLINGS = {
    ANGLE.name: [("30deg", math.pi / 6), ("-30°", -math.pi / 6), ("0.5rad", 0.5)],
    ANGULAR_SPEED.name: [("10deg/s", math.pi / 18), ("0.2rad/s", 0.2)],
    LENGTH.name: [("40mm", 0.04), ("0.04m", 0.04), ("0.04", 0.04), ("4e1mm", 0.04)],
    SPEED.name: [("50mm/s", 0.05), ("0.05m/s", 0.05), ("0.05", 0.05)],
    ACCELERATION.name: [("200mm/s2", 0.2), ("0.2m/s^2", 0.2), ("0.2", 0.2)],
    TIME.name: [("500ms", 0.5), ("0.5s", 0.5), ("0.5", 0.5)],
    SHARE.name: [("50%", 0.5), ("0.5%", 0.005)],
}
FOREIGN = {
    ANGLE.name: "30deg", ANGULAR_SPEED.name: "10deg/s", LENGTH.name: "40mm", SPEED.name: "5mm/s",
    ACCELERATION.name: "5mm/s2", TIME.name: "3s", SHARE.name: "5%",
}  # fmt: skip
LINE = "--to 0.2 0.1 0.1 --line"


class Option(NamedTuple):
    """A line with a place for one number, its quantity, and the expression that finds the number in SI."""

    line: str
    quantity: Quantity
    found: str

    @property
    def name(self) -> str:
        before = self.line.split("{}")[0].split()
        option = next((word for word in reversed(before) if word.startswith("--")), "")
        return f"{' '.join(self.words)} {option}".strip()

    @property
    def words(self) -> tuple[str, ...]:
        return next(each.words for each in COMMANDS if self.line.split()[: len(each.words)] == list(each.words))


OPTIONS = (
    Option("move --to {} 0.1 0.1", LENGTH, "move.goal.position[0]"),
    Option("move --joints brazo_joint={}", ANGLE, "move.goal.position[0]"),
    Option("move --joints efector_joint={}", LENGTH, "move.goal.position[0]"),
    Option("move --to 0.2 0.1 0.1 --rpy {} 0 0", ANGLE, "turned(move.goal.orientation, 0)"),
    Option("move --to 0.2 0.1 0.1 --arc 0 {} 0", LENGTH, "move.motion.interim[1]"),
    Option("move --to 0.2 0.1 0.1 --center 0 {} 0", LENGTH, "move.motion.center[1]"),
    Option("move --to 0.2 0.1 0.1 --via 0 0 {}", LENGTH, "move.goal.points[0].position[2]"),
    Option("move --to 0.2 0.1 0.1 --via 0 0 0 --blend {}", LENGTH, "move.goal.blend"),
    Option(f"move {LINE} --tool-speed {{}}", SPEED, "move.motion.speed"),
    Option(f"move {LINE} --tool-acceleration {{}}", ACCELERATION, "move.motion.acceleration"),
    Option(f"move {LINE} --max-step {{}}", LENGTH, "move.motion.max_step"),
    Option(f"move {LINE} --jump {{}}", ANGLE, "move.motion.jump_threshold"),
    Option(f"move {LINE} --fraction {{}}", SHARE, "move.motion.least_fraction"),
    Option("move --named ready --speed {}", SHARE, "move.velocity_scaling"),
    Option("move --named ready --clearance {}", LENGTH, "move.clearance"),
    Option("move --named ready --time {}", TIME, "move.allowed_time"),
    Option("ik --to 0 {} 0", LENGTH, "ik.goal.position[1]"),
    Option("ik --to 0 0 0 --rpy 0 0 {}", ANGLE, "turned(ik.goal.orientation, 2)"),
    Option("ik --to 0 0 0 --tolerance {}", LENGTH, "ik.goal.position_tolerance"),
    Option("ik --to 0 0 0 --turn-tolerance {}", ANGLE, "ik.goal.orientation_tolerance"),
    Option("ik --to 0 0 0 --near q1={}", ANGLE, "ik.near.position[0]"),
    Option("ik --to 0 0 0 --near q3={}", LENGTH, "ik.near.position[0]"),
    Option("fk brazo_joint={}", ANGLE, 'joints["brazo_joint"]'),
    Option("fk efector_joint={}", LENGTH, 'joints["efector_joint"]'),
    Option("reference --joints q2={}", ANGLE, "reference.position[1]"),
    Option("reference --joints q3={}", LENGTH, "reference.position[2]"),
    Option("jog --joint q1={} --for 1", ANGULAR_SPEED, "jog.velocity[0]"),
    Option("jog --joint q3={} --for 1", SPEED, "jog.velocity[0]"),
    Option("jog --twist 0 {} 0 --for 1", SPEED, "jog.linear[1]"),
    Option("jog --turn 0 {} 0 --for 1", ANGULAR_SPEED, "jog.angular[1]"),
    Option("jog --joint q1=0 --for {}", TIME, "options.seconds"),
    Option("scene add it --box {} 1 1", LENGTH, "scene.shape.size[0]"),
    Option("scene add it --sphere {}", LENGTH, "scene.shape.radius"),
    Option("scene add it --cylinder 1 {}", LENGTH, "scene.shape.length"),
    Option("scene add it --plane --at 0 {} 0", LENGTH, "scene.pose.translation[1]"),
    Option("scene add it --plane --rpy 0 {} 0", ANGLE, "turned(scene.pose.rotation, 1)"),
    Option("scene add it --plane --padding {}", LENGTH, "scene.padding"),
    Option("speed {}", SHARE, "options.share"),
    Option("device press offline {}", TIME, "press.value"),
    Option("bag export a.mcap --lerobot out --task it --gap {}", TIME, "options.gap"),
    Option("teach record it --duration {}", TIME, "options.duration"),
    Option("device press freeze {}", TIME, "press.value"),
    Option("device monitor --duration {}", TIME, "options.duration"),
    Option("collision fit urdf/rm1 --bulge {}", LENGTH, "options.bulge"),
    Option("collision fit urdf/rm1 --meshes --within {}", LENGTH, "options.within"),
    Option("collision matrix urdf/rm1 --always-within {}", LENGTH, "options.always_within"),
    Option("plot joint_states.position[0] --window {}", TIME, "options.window"),
)


def turned(rotation: tuple[float, ...], axis: int) -> float:
    """[rad] about one axis of a rotation (x, y, z, w) about that axis alone."""
    return 2.0 * math.atan2(rotation[axis], rotation[3])


REQUESTS = {
    "move": lambda options: request_from(options, ARM),
    "ik": lambda options: ik_request_from(options, ARM),
    "fk": lambda options: parse_joints(options.joints, ARM.joints),
    "reference": lambda options: reference_request(ARM, options.joints),
    "jog": lambda options: command_of(ARM, options.joint, options.twist, options.turn, False),
    "scene": lambda options: object_of(options),
    "device": lambda options: request_of(ARM, options.what, options.rest) if hasattr(options, "what") else None,
}


def si_of(option: Option, text: str) -> float:
    """The number as the request has it."""
    options: Options = parse(option.line.replace("{}", text).split())
    word = option.words[0]
    request = REQUESTS[word](options) if word in REQUESTS else None
    names = {"fk": "joints", "device": "press"}
    return eval(option.found, {"turned": turned, "options": options, names.get(word, word): request})


def refusal_of(option: Option, text: str, capsys) -> str:
    """The sentence that `text` is refused with; the exit code is that of a usage error."""
    with pytest.raises((SystemExit, CommandError)) as ended:
        si_of(option, text)
    code = ended.value.code
    assert code == ExitCode.USAGE
    return capsys.readouterr().err if ended.type is SystemExit else str(ended.value)


each_option = pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.line)


@each_option
def test_every_spelling_of_a_number_is_the_same_in_si(option):
    for text, value in SPELLINGS[option.quantity.name]:
        if value > 0.0 or (option.quantity is ANGLE and "rpy" in option.line):
            assert si_of(option, text) == pytest.approx(value, rel=1e-12), text


@each_option
def test_a_number_without_a_unit_is_si_or_refused_with_its_readings(option, capsys):
    if option.quantity.bare:
        assert si_of(option, "0.03") == pytest.approx(0.03)
        return
    said = refusal_of(option, "0.25", capsys)
    readings = said.rstrip().rstrip("?").split("0.25 what: ")[1].split(" or ")
    assert len(readings) == 2
    for reading in readings:
        assert si_of(option, reading) != 0.25 or "rad" in reading or "25%" in reading


@each_option
def test_zero_needs_no_unit(option, capsys):
    try:
        assert si_of(option, "0") == 0.0
    except (CommandError, SystemExit) as error:
        said = capsys.readouterr().err or str(error)
        assert "what:" not in said
        assert "not above 0" in said or "not in (0" in said or "0mm is not from" in said


@each_option
def test_a_unit_of_another_quantity_is_refused(option, capsys):
    for quantity in QUANTITIES:
        if quantity is not option.quantity:
            assert f"{FOREIGN[quantity.name]} must be in {' or '.join(option.quantity.units)}" in refusal_of(
                option, FOREIGN[quantity.name], capsys
            )


@each_option
@table("text", ["nan", "inf", "1e999", "0x10", "1..2", "3furlongs", "far"])
def test_what_is_no_number_is_refused(option, text, capsys):
    assert text.split("furlongs")[0] in refusal_of(option, text, capsys)


@table("option", [each for each in OPTIONS if "--rpy" in each.line], ids=lambda option: option.line)
def test_more_than_a_turn_in_radians_means_degrees(option, capsys):
    assert "write 90deg for degrees" in refusal_of(option, "90rad", capsys)


@table("words", ["--axis 1mm 0 0", "--axis 0 0 1 --along 0 90deg 0", "--quaternion 1m 0 0 0"])
@table("command", ["move", "ik"])
def test_a_direction_has_no_unit(command, words, capsys):
    with pytest.raises(SystemExit):
        parse([command, "--to", "0", "0", "0", *words.split()])
    assert "directions and quaternions have no unit" in capsys.readouterr().err


def test_no_option_with_a_unit_is_missing_from_this_table():
    of_units = {getattr(units, name) for name in ("length", "speed", "acceleration", "angle", "angular_speed",
                "seconds", "share", "rotation", "positive_seconds", "positive_length")}  # fmt: skip
    found = set()
    for command in COMMANDS:
        parser = Parser(add_help=False)
        complete(parser, command)
        for action in parser._actions:
            if action.type in of_units:
                found.add(" ".join([*command.words, *action.option_strings[-1:]]))
    assert found
    assert found <= {option.name for option in OPTIONS}


def test_no_option_but_these_takes_a_bare_number():
    """Counts, rates, efforts, seeds and directions have no unit; `--scale` is metres for each unit of a file."""
    bare = set()
    for command in COMMANDS:
        parser = Parser(add_help=False)
        complete(parser, command)
        bare |= {
            " ".join([*command.words, *action.option_strings[-1:]])
            for action in parser._actions
            if getattr(action.type, "__name__", "") in ("finite_number", "positive_number", "int", "float")
        }
    assert bare == {
        "move --quat", "move --axis", "move --along", "move --free-axis", "move --seed", "move --attempts",
        "ik --quaternion",
        "ik --axis", "ik --along", "ik --free-axis", "topic pub --rate", "tf echo --rate", "link bench --rate",
        "grip --max-effort", "scene add --scale", "scene resize --scale", "bag record --duration",
        "bag export --fps", "bag record --max-minutes", "bag record --max-mb", "deploy keys --renew-within",
        "chaos --seed", "chaos --minutes", "chaos --episode", "soak --seed", "soak --hours",
        "replay --tolerance",
    }  # fmt: skip
