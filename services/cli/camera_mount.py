"""`gemelo camera mount`: where a camera stands, from points of a printed board that the arm's tool has touched.

A camera that rides on a link, or one before which a link carries tags, is `camera_poses`'s.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

import gemelo
from services.arm.frames.transforms import compose
from services.cli import camera_poses
from services.cli.camera_boards import bar_option, tag_board
from services.cli.camera_images import from_bus, info_of, subject
from services.cli.errors import CommandError, ExitCode, in_commands, usage
from services.cli.parser import Options, Parser, positive_integer
from services.cli.session import connect, connect_arm, load_robot
from services.cli.units import LENGTH, parse_quantity
from services.vision.boards import Sighting, TagBoard
from services.vision.calibration.touches import FEWEST_TOUCHES, TouchFit, fit_touches, spread_points
from services.vision.camera_model import CameraModel, model_of
from services.vision.rigid import Array

if TYPE_CHECKING:
    from gemelo import Arm

LARGEST_HELD_OUT = 0.002  # [m] above which the touches are not believed
IMAGES = 10  # of which the first that shows enough of the board is taken
ENOUGH_TAGS = 4


def add_options(parser: Parser) -> None:
    """Adds the camera, the printed scale, how many points, and the tip that touches."""
    parser.add_argument("camera", metavar="CAMERA", nargs="?", default="", help="of the cell file; its first one")
    bar_option(parser)
    parser.add_argument("--points", type=positive_integer, default=4, metavar="N", help="tags to touch, 4 to 9 (4)")
    said = "of what touches, beyond the tool's frame along its z (the length of the jaws)"
    parser.add_argument("--tip", metavar="LENGTH", default="", help=said)
    camera_poses.add_options(parser)


def run(options: Options) -> ExitCode:
    """Goes to poses by itself, or asks for one touch after the other; looks at the board, and writes camera.toml."""
    camera, board = subject(options.camera), tag_board(options.bar)
    if camera.record.parent or options.on:
        return camera_poses.run(options, camera)
    if not FEWEST_TOUCHES <= options.points <= len(board.centres()):
        raise usage(f"--points {options.points} is not {FEWEST_TOUCHES} to {len(board.centres())}")
    robot = load_robot()
    tip = _tip(options.tip, robot)
    numbers = list(board.centres())
    chosen = [numbers[index] for index in spread_points([board.centres()[each] for each in numbers], options.points)]
    print("lay the board flat where the camera sees it, within the arm's reach, and do not move it any more")
    with connect_arm(robot) as arm:
        touched = np.array([_touch(arm, number, tip) for number in chosen])
    _ask("now lead the arm out of the image")
    with connect(robot) as session:
        model = model_of(info_of(session, camera.name))
        sighting = None
        for _, image in zip(range(IMAGES), from_bus(session, camera.name), strict=False):
            sighting = board.find(image, model)
            if sighting is not None and len(sighting.points) >= 4 * ENOUGH_TAGS:
                break
    fit = _fit(board, chosen, touched, sighting, model)
    for index in fit.outliers:
        off = 1e3 * fit.errors[index]
        print(f"the touch of tag {chosen[index]} does not agree with the others ({off:.1f} mm), and was left out")
    if fit.held_out > LARGEST_HELD_OUT:
        raise CommandError(
            f"touches are {1e3 * fit.held_out:.1f} mm from where the others put them (at most "
            f"{1e3 * LARGEST_HELD_OUT:g}), and nothing was written: touch the middles of the tags again"
        )
    path = camera.write_mount(robot.description.base_frame, fit.base_from_camera, fit.held_out)
    x, y, z = (1e3 * value for value in fit.base_from_camera[:3, 3])
    print(f"{camera.name} stands at {x:.0f} {y:.0f} {z:.0f} mm; touches left out are {1e3 * fit.held_out:.2f} mm off")
    print(f"written to {path}")
    return ExitCode.OK


def _touch(arm: Arm, number: int, tip: float) -> tuple[float, float, float]:
    """Where [m] the tip was when the person said that it touches."""
    _ask(f"bring the tip onto the middle of tag {number} (`gemelo jog`, or the page)")
    try:
        pose = arm.pose()
    except gemelo.Error as error:
        raise CommandError(in_commands(str(error))) from error
    point = compose((pose.position, pose.orientation), ((0.0, 0.0, tip), (0.0, 0.0, 0.0, 1.0)))[0]
    print(f"  {1e3 * point[0]:.1f} {1e3 * point[1]:.1f} {1e3 * point[2]:.1f} mm")
    return point


def _ask(text: str) -> None:
    print(f"{text}, then Enter", flush=True)
    if not sys.stdin.readline():
        raise CommandError("there is nobody to touch the board: this command asks a person; nothing was written")


def _tip(text: str, robot: gemelo.Robot) -> float:
    if text:
        return parse_quantity(text, LENGTH, "--tip")
    gripper = robot.description.gripper
    return gripper.jaw[2] if gripper is not None and gripper.jaw is not None else 0.0


def _fit(board: TagBoard, chosen: list[int], touched: Array, sighting: Sighting | None, model: CameraModel) -> TouchFit:
    if sighting is None or len(sighting.points) < 4 * ENOUGH_TAGS:
        seen = 0 if sighting is None else len(sighting.points) // 4
        raise CommandError(
            f"the camera sees {seen} tags of the board, at least {ENOUGH_TAGS} are needed; nothing was written"
        )
    points = np.array([board.centres()[number] for number in chosen])
    try:
        return fit_touches(points, touched, sighting, model)
    except ValueError as error:
        raise CommandError(f"{error}; nothing was written") from error
