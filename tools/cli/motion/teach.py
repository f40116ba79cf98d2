"""`gemelo teach`: keeps what somebody shows with the arm under a name, and plays it back."""

from __future__ import annotations

import json
import signal
import threading
from types import FrameType

import gemelo
from gemelo.programs.demonstrations import Demonstrations, play_demonstration, record_demonstration
from gemelo.programs.folder import programs_folder
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.language import columns, sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot, reported
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import SHARE, parse_quantity, positive_seconds
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option


def name_option(parser: Parser) -> None:
    """Adds the demonstration's name."""
    parser.add_argument("name", metavar="NAME", help="of the demonstration")


def record_options(parser: Parser) -> None:
    """Adds name, duration and --overwrite."""
    name_option(parser)
    parser.add_argument("--duration", type=positive_seconds, metavar="TIME", help="end after it, as 10 or 10s")
    parser.add_argument("--overwrite", action="store_true", help="in place of one of that name")


def play_options(parser: Parser) -> None:
    """Adds name, speed and --json."""
    name_option(parser)
    parser.add_argument("--speed", default="100%", metavar="SHARE", help="of that at which it was shown [100%%]")
    json_option(parser)


def choices(robot: gemelo.Robot | None) -> Choices:
    """The names of the demonstrations."""
    return {} if robot is None else {"": list(_demonstrations(robot))}


def run_list(options: Options) -> ExitCode:
    """Every demonstration with its duration."""
    robot = load_robot()
    with reported(robot):
        kept = _demonstrations(robot)
        rows = [(name, kept[name].duration, len(kept[name].gripper)) for name in kept]
    if options.json:
        fields = ({"name": name, "duration": duration, "grips": grips} for name, duration, grips in rows)
        print(json.dumps({"folder": str(kept.folder), "demonstrations": list(fields)}))
    elif not rows:
        print(sentence(because("demonstration.none", folder=str(kept.folder))))
    else:
        print(table(columns("demonstration", "duration"), [(name, f"{time:.2f} s") for name, time, _ in rows]))
    return ExitCode.OK


def run_record(options: Options) -> ExitCode:
    """Records until Ctrl-C or for the duration; nothing is moved by it."""
    robot = load_robot()
    with reported(robot):
        kept = _demonstrations(robot)
        kept.require_new(options.name, overwrite=options.overwrite)
    with connect_arm(robot) as arm:
        ended = threading.Event()

        def end(_number: int, _frame: FrameType | None) -> None:
            ended.set()
            arm.wake()

        before = signal.signal(signal.SIGINT, end)
        try:
            print(sentence(because("demonstration.recording")), flush=True)
            shown = record_demonstration(arm, ended.is_set, options.duration)
        finally:
            signal.signal(signal.SIGINT, before)
        kept.save(options.name, shown, overwrite=options.overwrite)
    grips = len(shown.gripper)
    print(sentence(because("demonstration.kept", name=options.name, time=shown.duration, count=grips)))
    return ExitCode.OK


def run_play(options: Options) -> ExitCode:
    """Goes to where it begins, and does it again; at Ctrl-C the arm decelerates."""
    robot = load_robot()
    with reported(robot):
        shown = _demonstrations(robot).require(options.name)
    speed = parse_quantity(options.speed, SHARE, "--speed")
    with connect_arm(robot) as arm:
        motion = play_demonstration(arm, shown, speed)
        joints = arm.joints
    if options.json:
        print(json.dumps({"name": options.name, "status": motion.status.name, "joints": joints}))
    else:
        print(sentence(because("demonstration.played", name=options.name, time=shown.duration / speed)))
    return ExitCode.OK


def _demonstrations(robot: gemelo.Robot) -> Demonstrations:
    return Demonstrations(programs_folder(robot.deployment), robot.description)
