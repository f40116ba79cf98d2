"""Commands about a robot's collision shapes: fit, matrix."""

from __future__ import annotations

from pathlib import Path

from services.cli.exits import ExitCode, usage
from services.cli.parser import Command, Options, Parser, positive_integer, positive_number

GROUPS = {
    "collision": "a robot's collision shapes: from its meshes, the spheres over them, the pairs that need no check"
}
FIT_EXAMPLES = """examples:
  gemelo collision fit urdf/parol6
  gemelo collision fit urdf/my_arm --meshes
  gemelo collision fit urdf/my_arm --meshes --link forearm --most 3 --write"""


def folder_option(parser: Parser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a robot's folder, as urdf/rm1")


def fit_options(parser: Parser) -> None:
    parser.epilog = FIT_EXAMPLES
    folder_option(parser)
    parser.add_argument(
        "--bulge", type=positive_number, default=5.0, metavar="MM", help="that a sphere may reach beyond its link"
    )
    parser.add_argument("--meshes", action="store_true", help="fit boxes, cylinders, plates, capsules and balls")
    parser.add_argument(
        "--most", type=positive_integer, default=6, metavar="N", help="shapes for a link, with --meshes"
    )
    parser.add_argument("--link", nargs="+", default=[], metavar="LINK", help="fit to these alone; the others stay")
    parser.add_argument("--write", action="store_true", help="replace the links' <collision> elements; the rest stays")


def fit(options: Options) -> ExitCode:
    from services.cli.collision import shapes, spheres

    if options.meshes:
        return shapes(options.folder, options.most, options.link, options.write)
    if options.write or options.link:
        raise usage("--write and --link go with --meshes: spheres are the core's own and stand in no file")
    return spheres(options.folder, options.bulge)


def matrix_options(parser: Parser) -> None:
    folder_option(parser)
    parser.add_argument("--write", action="store_true", help="change the SRDF; its comments stay")


def matrix(options: Options) -> ExitCode:
    from services.cli.collision import matrix

    return matrix(options.folder, options.write)


COMMANDS = (
    Command(("collision", "fit"), "shapes from the meshes, or the spheres over them", fit, fit_options),
    Command(("collision", "matrix"), "pairs of links that never touch, always do, or are neighbours", matrix,
            matrix_options, "gemelo collision matrix urdf/parol6 --write"),
)  # fmt: skip
