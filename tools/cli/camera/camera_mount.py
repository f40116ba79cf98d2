"""`gemelo camera mount`: where a camera stands, from points of a printed board that the arm's tool has touched.

A camera that rides on a link, or one before which a link carries tags, is `camera_poses`'s.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

import gemelo
from gemelo.libraries.arm.frames.transforms import compose
from gemelo.libraries.vision.boards import Sighting
from gemelo.libraries.vision.calibration.shots import one_of
from gemelo.libraries.vision.calibration.touches import FEWEST_TOUCHES, TouchFit, fit_touches, spread_points
from gemelo.libraries.vision.camera_model import CameraModel, model_of
from gemelo.libraries.vision.other_boards import other_board, remedy
from gemelo.libraries.vision.rigid import Array
from gemelo.tools.cli.camera import camera_poses
from gemelo.tools.cli.camera.camera_boards import bar_option, tag_board
from gemelo.tools.cli.camera.camera_images import from_bus, info_of, subject
from gemelo.tools.cli.camera.camera_tip import ask_offset, step_floor, tip_length, tip_option
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.session import connect, connect_arm, load_robot
from gemelo.tools.cli.parser import Options, Parser, positive_integer

if TYPE_CHECKING:
    from gemelo import Arm

LARGEST_HELD_OUT = 0.002  # [m] above which the touches are not believed
TOUCHES = 9  # unless a person wants fewer; measured (`mount_touch_mm`): 4 leave half as much again
IMAGES = 10  # whose mean is taken of those that show enough of the board
ENOUGH_TAGS = 4
COARSE = 0.0004  # [m] chosen: with larger steps a person is told that the tip cannot be led nearer


def add_options(parser: Parser) -> None:
    """Adds the camera, the printed scale, how many points, and the tip that touches."""
    parser.add_argument("camera", metavar="CAMERA", nargs="?", default="", help="of the cell file; its first one")
    bar_option(parser)
    parser.add_argument(
        "--points", type=positive_integer, default=TOUCHES, metavar="N", help="corners to touch, 4 to 36 (9)"
    )
    tip_option(parser)
    camera_poses.add_options(parser)


def run(options: Options) -> ExitCode:
    """Goes to poses by itself, or asks for one touch after the other; looks at the board, and writes camera.toml."""
    camera, board = subject(options.camera), tag_board(options.bar)
    if camera.record.parent or options.on:
        return camera_poses.run(options, camera)
    points = board.points()
    if not FEWEST_TOUCHES <= options.points <= len(points):
        raise usage(f"--points {options.points} is not {FEWEST_TOUCHES} to {len(points)}")
    robot = load_robot()
    tip = tip_length(options.tip, robot)
    chosen = spread_points(list(points), options.points)
    names = [board.corner_name(index) for index in chosen]
    print("lay the board flat where the camera sees it, within the arm's reach, and do not move it any more;")
    print("upper and lower are as you read the page")
    with connect_arm(robot) as arm:
        touched = np.array([_touch(arm, name, tip) for name in names])
    _ask("now lead the arm out of the image")
    with connect(robot) as session:
        model = model_of(info_of(session, camera.name))
        images = [image for _, image in zip(range(IMAGES), from_bus(session, camera.name), strict=False)]
        found = [board.find(image, model) for image in images]
        if not any(found) and (other := other_board(images[-1], board) if images else ""):
            raise CommandError(f"the image shows {other}, and not the board of this command: {remedy(board)}")
    fit = _fit(points[chosen], touched, found, model)
    for index in fit.outliers:
        off = 1e3 * fit.errors[index]
        print(f"the touch of {names[index]} does not agree with the others ({off:.1f} mm), and was left out")
    if fit.held_out > LARGEST_HELD_OUT:
        raise CommandError(
            f"touches are {1e3 * fit.held_out:.1f} mm from where the others put them (at most "
            f"{1e3 * LARGEST_HELD_OUT:g}), and nothing was written: touch the corners again"
        )
    path = camera.write_mount(robot.description.base_frame, fit.base_from_camera, fit.held_out)
    x, y, z = (1e3 * value for value in fit.base_from_camera[:3, 3])
    print(f"{camera.name} stands at {x:.0f} {y:.0f} {z:.0f} mm; touches left out are {1e3 * fit.held_out:.2f} mm off")
    print(f"written to {path}")
    return ExitCode.OK


def _touch(arm: Arm, corner: str, tip: float) -> tuple[float, float, float]:
    """Where [m] the corner is, by where the tip was when the person said that it touches."""
    print(f"bring the tip onto {corner} (`gemelo jog`, or the page)")
    beside = ask_offset(
        "Enter when it is there; or, where the arm's steps end beside it, how far the tip is beside it along "
        "x and y of the base: `1.5mm -0.4mm`"
    )
    try:
        pose, floor = arm.pose(), step_floor(arm)
    except gemelo.Error as error:
        raise CommandError(error) from error
    x, y, z = compose((pose.position, pose.orientation), ((0.0, 0.0, tip), (0.0, 0.0, 0.0, 1.0)))[0]
    point = x - beside[0], y - beside[1], z
    coarse = f"; the arm's steps end up to {1e3 * floor:.1f} mm beside" if floor > COARSE and not any(beside) else ""
    print(f"  {1e3 * point[0]:.1f} {1e3 * point[1]:.1f} {1e3 * point[2]:.1f} mm{coarse}")
    return point


def _ask(text: str) -> None:
    print(f"{text}, then Enter", flush=True)
    if not sys.stdin.readline():
        raise CommandError("there is nobody to touch the board: this command asks a person; nothing was written")


def _fit(points: Array, touched: Array, found: Sequence[Sighting | None], model: CameraModel) -> TouchFit:
    enough = [each for each in found if each is not None and len(each.points) >= 4 * ENOUGH_TAGS]
    if not enough:
        seen = max((len(each.points) // 4 for each in found if each is not None), default=0)
        raise CommandError(
            f"the camera sees {seen} tags of the board, at least {ENOUGH_TAGS} are needed; nothing was written"
        )
    try:
        return fit_touches(points, touched, one_of(enough, 4 * ENOUGH_TAGS), model)
    except ValueError as error:
        raise CommandError(f"{error}; nothing was written") from error
