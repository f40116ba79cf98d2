"""The pose at which a gripper grasps a thing: the height of the tool, and the turn of the jaws. Pure."""

from __future__ import annotations

import math

from gemelo.api.errors import Refused
from gemelo.api.seeing import Seen, body_of
from gemelo.api.units import Point, Pose
from gemelo.libraries.arm.frames.transforms import IDENTITY, Quaternion, Rigid, compose, from_axis_angle, rotate
from gemelo.libraries.arm.model.jaws import jaw_edges
from gemelo.schemas.cell import Thing
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.reasons import because

GAP = 0.003  # [m] between the thing's top and the tool, and between the jaws' tips and the table
OVERLAP = 0.004  # [m] of the jaws' length that must be beside the thing


def grasp_point(thing: Thing, seen: Seen) -> Point:
    """Where [m] the point between the jaws is to come."""
    return compose((seen.pose.position, seen.pose.orientation), (thing.grasp_offset, IDENTITY[1]))[0]


def lift_above(thing: Thing, gripper: Gripper, seen: Seen) -> float:
    """[m] of the tool above the grasp point; raises `Refused` where the jaws do not reach beside the thing."""
    (_, _, height), center = body_of(thing)
    middle = compose((seen.pose.position, seen.pose.orientation), center)[0][2]
    top, bottom, grasp = middle + height / 2.0, middle - height / 2.0, grasp_point(thing, seen)[2]
    beyond = jaw_edges(gripper)[2]
    tool = max(grasp + beyond / 2.0, top + GAP, bottom + GAP + beyond)
    beside = top - (tool - beyond)
    if beside < OVERLAP:
        raise Refused(
            because(
                "pick.flat", thing=thing.name, height=1e3 * height, long=1e3 * beyond,
                beside=1e3 * max(beside, 0.0), least=1e3 * OVERLAP,
            ),
            check="grasp", subject=thing.name, value=beside, limit=OVERLAP,
        )  # fmt: skip
    return tool - grasp


def turn_between(tool: Pose, body: Rigid, size: Point) -> tuple[float, float]:
    """[rad] from the thing's nearest side to the way of the jaws, and the edge [m] that is then between them."""
    x, y, _ = rotate(tool.orientation, (0.0, 1.0, 0.0))
    off = math.atan2(y, x) - yaw_of(body[1])  # from the thing's x to the way of the jaws
    quarters = round(off / (math.pi / 2.0))
    return off - quarters * math.pi / 2.0, size[0] if quarters % 2 == 0 else size[1]


def looking_down(yaw: float) -> Quaternion:
    """A tool whose z looks down, and whose jaws move along `yaw` [rad] + 90 degrees of the base."""
    half_turn = from_axis_angle((1.0, 0.0, 0.0), math.pi)
    return compose((IDENTITY[0], from_axis_angle((0.0, 0.0, 1.0), yaw)), (IDENTITY[0], half_turn))[1]


def yaw_of(turn: Quaternion) -> float:
    """[rad] of the frame's x axis about the base's z."""
    x, y, _ = rotate(turn, (1.0, 0.0, 0.0))
    return math.atan2(y, x)
