"""Commands that compute and move nothing: ik and fk."""

from __future__ import annotations

import math

from services.cli.exits import ExitCode
from services.cli.parser import (
    Command,
    Options,
    Parser,
    Words,
    finite_number,
    json_option,
    length,
    positive_integer,
    turn,
)

XYZ = ("X", "Y", "Z")
IK_EXAMPLES = """examples:
  gemelo ik --to 0.25 0.15 0.10
  gemelo ik --to 0.25 0.15 0.10 --axis 0 0 1 --along 0 0 -1
  gemelo ik --to 0.25 0.15 0.10 --quaternion 1 0 0 0 --turn-tolerance 5 --solutions 8"""


def ik_options(parser: Parser) -> None:
    parser.epilog = IK_EXAMPLES
    parser.add_argument("--to", nargs=3, type=length, metavar=XYZ, required=True, help="the tool, as 300mm or 0.3")
    turned = parser.add_mutually_exclusive_group()
    turned.add_argument(
        "--quaternion", nargs=4, type=finite_number, metavar=(*XYZ, "W"), default=(), help="orientation of the tool"
    )
    turned.add_argument(
        "--rpy",
        nargs=3,
        type=turn,
        metavar=("R", "P", "Y"),
        help="the same as roll, pitch, yaw: 90deg, 1.57rad or 90",
    )
    turned.add_argument(
        "--axis", nargs=3, type=finite_number, metavar=XYZ, default=(), help="of the tool, to point --along"
    )
    vector(parser, "--along", "direction in which --axis is to point")
    vector(parser, "--free-axis", "of the tool: turning about it does not matter")
    parser.add_argument("--frame", default="", metavar="LINK", help="in which all this is given; the base, if none")
    parser.add_argument("--tolerance", type=finite_number, default=0.0, metavar="MM", help="of the position")
    parser.add_argument("--turn-tolerance", type=finite_number, default=0.0, metavar="DEG", help="of the orientation")
    parser.add_argument(
        "--near",
        nargs="+",
        default=[],
        metavar="JOINT=VALUE",
        help="the configuration to be near to; where the arm is, if none",
    )
    parser.add_argument("--solutions", type=positive_integer, default=1, help="at most so many, the nearest first")
    parser.add_argument("--touching", action="store_true", help="those at which links touch as well")
    json_option(parser)


def vector(parser: Parser, name: str, about: str) -> None:
    parser.add_argument(name, nargs=3, type=finite_number, metavar=XYZ, default=(), help=about)


def ik(options: Options) -> ExitCode:
    from schemas.joints import JointState
    from schemas.planning import IkRequest, PoseGoal
    from services.arm.transforms import from_rpy
    from services.cli.kinematics import ik
    from services.cli.session import connect, load
    from services.cli.units import parse_joints

    near = parse_joints(options.near, load()[1].joints)
    orientation = options.quaternion
    if options.rpy is not None:
        orientation = from_rpy(*options.rpy)
    goal = PoseGoal(
        position=tuple(options.to),
        orientation=tuple(orientation),
        frame=options.frame,
        free_axis=tuple(options.free_axis),
        tool_axis=tuple(options.axis),
        direction=tuple(options.along),
        position_tolerance=options.tolerance / 1000.0,
        orientation_tolerance=math.radians(options.turn_tolerance),
    )
    request = IkRequest(
        goal=goal,
        near=JointState(name=tuple(near), position=tuple(near.values())) if near else None,
        solutions=options.solutions,
        avoid_collisions=not options.touching,
    )
    with connect() as session:
        return ik(session, request, options.json)


def fk_options(parser: Parser) -> None:
    parser.add_argument(
        "joints", nargs="*", metavar="JOINT=VALUE", help="30deg, 40mm, ...; the others stand where they are now"
    )
    parser.add_argument("--links", nargs="+", default=[], metavar="LINK", help="the tool, if none is named")
    json_option(parser)


def fk(options: Options) -> ExitCode:
    from schemas.planning import FkRequest
    from services.cli.kinematics import fk
    from services.cli.session import connect, load
    from services.cli.units import parse_joints

    values = parse_joints(options.joints, load()[1].joints)
    request = FkRequest(name=tuple(values), position=tuple(values.values()), links=tuple(options.links))
    with connect() as session:
        return fk(session, request, options.json)


def link_words() -> Words:
    """Joints to set, and links after their option."""
    from services.cli.device_words import arm

    known = arm()
    if known is None:
        return {}
    return {"": [f"{joint.name}=" for joint in known.joints], "--links": known.model.link_names}


COMMANDS = (
    Command(("ik",), "joint values for a tool pose; nothing moves", ik, ik_options),
    Command(("fk",), "poses of links for joint values; nothing moves", fk, fk_options,
            "gemelo fk brazo_joint=30deg --links antebrazo_link efector_link", link_words),
)  # fmt: skip
