"""`gemelo ik` and `gemelo fk`: configurations for a tool pose, and poses of links; nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.frames import Transform
from gemelo.schemas.planning import FkResponse, IkRequest, IkResponse, PlanCode
from gemelo.schemas.reasons import because
from gemelo.tools.cli.bus.request_text import goal_text, joints_text, refusal_error, understood
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.language import columns, sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import SHOWN, angle, length, parse_joints, rotation
from gemelo.tools.cli.motion.move_request import ik_request_from
from gemelo.tools.cli.parser import Choices, Options, Parser, finite_number, json_option, positive_integer

if TYPE_CHECKING:
    from gemelo import Arm, Configurations, Pose, Robot
    from gemelo.libraries.arm.model.description import ArmDescription

XYZ = ("X", "Y", "Z")
IK_EXAMPLES = """examples:
  gemelo ik --to 0.25 0.15 0.10
  gemelo ik --to 0.25 0.15 0.10 --axis 0 0 1 --along 0 0 -1
  gemelo ik --to 0.25 0.15 0.10 --quaternion 1 0 0 0 --turn-tolerance 5deg --solutions 8"""


def ik_options(parser: Parser) -> None:
    """Adds the tool pose, tolerances and output options."""
    parser.epilog = IK_EXAMPLES
    parser.add_argument("--to", nargs=3, type=length, metavar=XYZ, required=True, help="the tool, as 300mm or 0.3")
    turned = parser.add_mutually_exclusive_group()
    turned.add_argument(
        "--quaternion", nargs=4, type=finite_number, metavar=(*XYZ, "W"), default=(), help="orientation of the tool"
    )
    turned.add_argument("--rpy", nargs=3, type=rotation, metavar=("R", "P", "Y"), help="the same, as 90deg or 1.57rad")
    turned.add_argument(
        "--axis", nargs=3, type=finite_number, metavar=XYZ, default=(), help="of the tool, to point --along"
    )
    _vector(parser, "--along", "direction in which --axis is to point; it is z")
    _vector(parser, "--free-axis", "of the tool: turning about it does not matter")
    parser.add_argument("--frame", default="", metavar="LINK", help="in which all this is given; the base, if none")
    parser.add_argument("--tolerance", type=length, metavar="DISTANCE", help="of the position, as 2mm")
    parser.add_argument("--turn-tolerance", type=angle, metavar="ANGLE", help="of the orientation, as 5deg")
    parser.add_argument(
        "--near",
        nargs="+",
        default=[],
        metavar="JOINT=VALUE",
        help="the configuration to be near to, as 30deg or 40mm; where the arm is, if none",
    )
    parser.add_argument("--solutions", type=positive_integer, default=1, help="at most so many, the nearest first")
    parser.add_argument("--touching", action="store_true", help="those at which links touch as well")
    json_option(parser)


def _vector(parser: Parser, name: str, about: str) -> None:
    parser.add_argument(name, nargs=3, type=finite_number, metavar=XYZ, default=(), help=about)


def run_ik(options: Options) -> ExitCode:
    """Asks the planner for configurations and prints them."""
    robot = load_robot()
    request = ik_request_from(options, robot.description)
    if not options.json:
        text = goal_text(request.goal, robot.description)
        if request.near:
            near = joints_text(request.near.name, request.near.position, robot.description)
            text = sentence(because("understood.near", text=text, joints=near))
        print(understood(text), flush=True)
    with connect_arm(robot) as arm:
        return ik(arm, request, options.json)


def ik_choices(robot: Robot | None) -> Choices:
    """The joints after --near, the links after --frame."""
    if robot is None:
        return {}
    return {
        "--near": [f"{joint.name}=" for joint in robot.description.joints],
        "--frame": robot.description.model.link_names,
    }


def fk_options(parser: Parser) -> None:
    """Adds joint values, links and --json."""
    parser.add_argument(
        "joints", nargs="*", metavar="JOINT=VALUE", help="30deg, 40mm, ...; the others stand where they are now"
    )
    parser.add_argument("--links", nargs="+", default=[], metavar="LINK", help="the tool, if none is named")
    json_option(parser)


def run_fk(options: Options) -> ExitCode:
    """Asks the planner for the poses of links and prints them."""
    robot = load_robot()
    values = parse_joints(options.joints, robot.description.joints)
    if values and not options.json:
        print(understood(joints_text(values, values.values(), robot.description)), flush=True)
    with connect_arm(robot) as arm:
        return fk(arm, values, options.links, options.json)


def fk_choices(robot: Robot | None) -> Choices:
    """Joints to set, and links after --links."""
    if robot is None:
        return {}
    return {"": [f"{joint.name}=" for joint in robot.description.joints], "--links": robot.description.model.link_names}


def ik(arm: Arm, request: IkRequest, as_json: bool) -> ExitCode:
    """Prints the configurations, the nearest first; raises `CommandError` with the planner's reason and remedy."""
    try:
        found = arm.ik(request)
    except gemelo.Refused as error:
        raise refusal_error(error, request.goal, arm.description) from error
    print(as_text(found.response) if as_json else configurations_text(arm.description, found))
    return ExitCode.OK


def fk(arm: Arm, joints: dict[str, float], links: Sequence[str], as_json: bool) -> ExitCode:
    """Prints the poses of the links, or of the tool, in the base frame for joint values [rad] or [m]."""
    poses = arm.link_poses(joints or None, links or [arm.tool_frame])
    print(as_text(_response_of(poses)) if as_json else poses_text(poses))
    return ExitCode.OK


def _response_of(poses: dict[str, Pose]) -> FkResponse:
    """The planner's message of the poses, for JSON."""
    transforms = (Transform(translation=pose.position, rotation=pose.orientation) for pose in poses.values())
    return FkResponse(code=PlanCode.SUCCESS, links=tuple(poses), poses=tuple(transforms))


def as_text(response: IkResponse | FkResponse) -> str:
    """The response as JSON, in SI units."""
    return msgspec.json.encode(response).decode()


def configurations_text(arm: ArmDescription, found: Configurations) -> str:
    """A table with a row for each configuration."""
    units = [SHOWN[joint.unit] for joint in map(arm.joint, found.response.name)]
    headings = [f"{name} [{unit}]" for name, (unit, _) in zip(found.response.name, units, strict=True)]
    rows = [
        [*(f"{v * factor:z.4f}" for v, (_, factor) in zip(joints.values(), units, strict=True)), f"{distance:.3f}"]
        for joints, distance in zip(found, found.distances, strict=True)
    ]
    return table([*headings, *columns("away [s]")], rows)


def poses_text(poses: dict[str, Pose]) -> str:
    """A table with a row for each link: position and unit quaternion in the base frame."""
    headings = [*columns("link"), "x [m]", "y [m]", "z [m]", "qx", "qy", "qz", "qw"]
    rows = [[link, *(f"{value:z.6f}" for value in (*pose.position, *pose.orientation))] for link, pose in poses.items()]
    return table(headings, rows)
