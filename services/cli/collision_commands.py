"""Commands about a robot's collision shapes: fit, matrix."""

from __future__ import annotations

from pathlib import Path

from services.cli.exits import ExitCode
from services.cli.parser import Command, Options, Parser, positive_number

GROUPS = {"collision": "a robot's collision shapes: the spheres over them, the pairs that need no check"}


def folder_option(parser: Parser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a robot's folder, as urdf/rm1")


def fit_options(parser: Parser) -> None:
    folder_option(parser)
    parser.add_argument(
        "--bulge", type=positive_number, default=5.0, metavar="MM", help="that a sphere may reach beyond its link"
    )


def fit(options: Options) -> ExitCode:
    from services.cli.collision import fit

    return fit(options.folder, options.bulge)


def matrix_options(parser: Parser) -> None:
    folder_option(parser)
    parser.add_argument("--write", action="store_true", help="change the SRDF; its comments stay")


def matrix(options: Options) -> ExitCode:
    from services.cli.collision import matrix

    return matrix(options.folder, options.write)


COMMANDS = (
    Command(("collision", "fit"), "the spheres that cover each link, and how far they bulge", fit, fit_options,
            "gemelo collision fit urdf/parol6"),
    Command(("collision", "matrix"), "pairs of links that never touch, always do, or are neighbours", matrix,
            matrix_options, "gemelo collision matrix urdf/parol6 --write"),
)  # fmt: skip
