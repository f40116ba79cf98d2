"""`gemelo pick`: takes a thing that a camera sees to a place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.libraries.arm.cell.cell_file import deployed_cell
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Robot
    from gemelo.schemas.reasons import Reason


def add_options(parser: Parser) -> None:
    """Adds the thing, the place, the camera and --json."""
    parser.add_argument("thing", metavar="THING", help="of the cell file")
    parser.add_argument("--to", metavar="PLACE", required=True, help="of the cell file")
    parser.add_argument("--camera", metavar="CAMERA", default="", help="only this one looks")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Picks it, with a line for each part; raises `CommandError` with the reason where it cannot."""

    def show(part: Reason) -> None:
        if not options.json:
            print(sentence(part), flush=True)

    with connect_arm(load_robot()) as arm:
        try:
            picked = arm.pick(options.thing, to=options.to, camera=options.camera, on_progress=show)
        except gemelo.Error as error:
            raise CommandError(error) from error
    fields = picked._asdict() | {"seen": picked.seen._asdict()}
    print(msgspec.json.encode(fields).decode() if options.json else sentence(picked.summary))
    return ExitCode.OK


def choices(robot: Robot | None) -> Choices:
    """The things, places and cameras of the cell file."""
    if robot is None:
        return {}
    try:
        cell = deployed_cell(robot.deployment)
    except DescriptionError:
        return {}
    return {
        "": [each.name for each in cell.things],
        "--to": [each.name for each in cell.places],
        "--camera": list(cell.camera_names),
    }
