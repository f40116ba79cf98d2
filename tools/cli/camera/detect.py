"""`gemelo detect`: the things of the cell file that cameras see."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.libraries.arm.cell.cell_file import deployed_cell
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.schemas.reasons import because, remedy
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Robot


def add_options(parser: Parser) -> None:
    """Adds the thing, the camera, --scene and --json."""
    parser.add_argument("thing", metavar="THING", nargs="?", default="", help="of the cell file; all that are seen")
    parser.add_argument("--camera", metavar="CAMERA", default="", help="only this one looks")
    parser.add_argument("--scene", action="store_true", help="make them boxes of the planning scene")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Prints a line for each thing; raises `CommandError` where what was asked for is not seen."""
    robot = load_robot()
    with connect_arm(robot) as arm:
        try:
            found = arm.detect(options.thing, camera=options.camera, scene=options.scene)
        except gemelo.Error as error:
            raise CommandError(error) from error
    if options.json:
        print(msgspec.json.encode([_fields(seen) for seen in found]).decode())
    else:
        lines = [sentence(seen.summary) for seen in found]
        print("\n".join(lines) or sentence(because("detect.nothing", remedy("view_camera"))))
    return ExitCode.OK


def choices(robot: Robot | None) -> Choices:
    """The things, places and cameras of the cell file."""
    if robot is None:
        return {}
    try:
        cell = deployed_cell(robot.deployment)
    except DescriptionError:
        return {}
    return {"": [each.name for each in (*cell.things, *cell.places)], "--camera": list(cell.camera_names)}


def _fields(seen: gemelo.Seen) -> dict[str, object]:
    return seen._asdict() | {"pose": seen.pose._asdict()}
