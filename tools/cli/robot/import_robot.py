"""`gemelo import`: a URDF or a CAD export becomes a robot's folder."""

from __future__ import annotations

import shlex
from argparse import ArgumentTypeError
from pathlib import Path

from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.parser import Options, Parser

EXAMPLES = """examples:
  gemelo import ~/Downloads/my_arm_description
  gemelo import my_arm.urdf --name my_arm --yes
  gemelo import my_arm.urdf --motor "NEMA 17" --driver A4988
  gemelo import my_arm.urdf.xacro --xacro prefix:=left_ --xacro gripper:=true
  gemelo import my_arm.urdf --answers urdf/my_arm/import.toml --force"""


def add_options(parser: Parser) -> None:
    """Adds the source and what is known of the arm."""
    parser.epilog = EXAMPLES
    parser.add_argument("source", type=Path, metavar="FOLDER_OR_URDF", help="an export's folder, a .urdf or a .xacro")
    parser.add_argument("--name", default="", help="of the robot and its folder; else the URDF's")
    parser.add_argument("-y", "--yes", action="store_true", help="take every default: without motors unless --motor")
    parser.add_argument("--answers", type=Path, metavar="FILE", help="answers of an earlier import: its import.toml")
    parser.add_argument("--force", action="store_true", help="replace the robot's folder where it is there already")
    parser.add_argument("--output", type=Path, default=Path("urdf"), metavar="FOLDER", help="of robots; else urdf")
    parser.add_argument("--motor", default="", help="of every joint, as NEMA 17, NEMA 23 or 28BYJ-48")
    parser.add_argument("--driver", default="", help="of every motor, as A4988, DRV8825, TMC2209 or DM542")
    add_xacro(parser)


def add_xacro(parser: Parser) -> None:
    """Adds the arguments of a xacro file."""
    parser.add_argument(
        "--xacro",
        type=xacro_argument,
        action="append",
        default=[],
        metavar="NAME:=VALUE",
        help="for a xacro file; repeat it",
    )


def xacro_argument(text: str) -> tuple[str, str]:
    """Name and value of NAME:=VALUE; raises ArgumentTypeError."""
    name, separator, value = text.partition(":=")
    if not separator or not name:
        raise ArgumentTypeError(sentence(because("cli.xacro", text=text)))
    return name, value


def run(options: Options) -> ExitCode:
    """Imports, and ends with the line that starts the twin."""
    from gemelo.libraries.arm.errors import DescriptionError  # slow to load, with all below
    from gemelo.libraries.robot_import.importing import ImportOptions, import_robot

    wanted = ImportOptions(
        options.source, options.output, options.name, options.yes, options.force,
        options.answers, options.motor, options.driver, dict(options.xacro), sentence,
    )  # fmt: skip
    try:
        folder = import_robot(wanted)
    except (DescriptionError, OSError) as error:
        raise CommandError(error) from error
    print(f"GEMELO_ROBOT={shlex.quote(str(folder))} make up")
    return ExitCode.OK
