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
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.other_boards import other_board
from gemelo.libraries.vision.rigid import Array
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.camera import camera_poses
from gemelo.tools.cli.camera.camera_boards import bar_option, tag_board
from gemelo.tools.cli.camera.camera_images import from_bus, info_of, subject
from gemelo.tools.cli.camera.camera_tip import ask_offset, step_floor, tip_length, tip_option
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
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
        raise usage(because("camera.mount.points", count=options.points, least=FEWEST_TOUCHES, most=len(points)))
    robot = load_robot()
    tip = tip_length(options.tip, robot)
    chosen = spread_points(list(points), options.points)
    names = [board.corner_name(index) for index in chosen]
    print(sentence(because("camera.mount.lay")))
    with connect_arm(robot) as arm:
        touched = np.array([_touch(arm, name, tip) for name in names])
    _ask_out_of_the_way()
    with connect(robot) as session:
        model = model_of(info_of(session, camera.name))
        images = [image for _, image in zip(range(IMAGES), from_bus(session, camera.name), strict=False)]
        found = [board.find(image, model) for image in images]
        if not any(found) and images and (other := other_board(images[-1], board)) is not None:
            raise CommandError(other)
    fit = _fit(points[chosen], touched, found, model)
    for index in fit.outliers:
        print(sentence(because("camera.mount.left_out", names[index], off=1e3 * fit.errors[index])))
    if fit.held_out > LARGEST_HELD_OUT:
        raise CommandError(because("camera.mount.off", off=1e3 * fit.held_out, most=1e3 * LARGEST_HELD_OUT))
    path = camera.write_mount(robot.description.base_frame, fit.base_from_camera, fit.held_out)
    x, y, z = (1e3 * value for value in fit.base_from_camera[:3, 3])
    print(sentence(because("camera.mount.done", camera=camera.name, x=x, y=y, z=z, off=1e3 * fit.held_out)))
    print(sentence(because("camera.written", file=str(path))))
    return ExitCode.OK


def _touch(arm: Arm, corner: Reason, tip: float) -> tuple[float, float, float]:
    """Where [m] the corner is, by where the tip was when the person said that it touches."""
    print(sentence(because("camera.mount.bring", corner)))
    beside = ask_offset(because("camera.mount.ask"))
    try:
        pose, floor = arm.pose(), step_floor(arm)
    except gemelo.Error as error:
        raise CommandError(error) from error
    x, y, z = compose((pose.position, pose.orientation), ((0.0, 0.0, tip), (0.0, 0.0, 0.0, 1.0)))[0]
    point = x - beside[0], y - beside[1], z
    print(f"  {1e3 * point[0]:.1f} {1e3 * point[1]:.1f} {1e3 * point[2]:.1f} mm")
    if floor > COARSE and not any(beside):
        print(f"  {sentence(because('camera.mount.coarse', floor=1e3 * floor))}")
    return point


def _ask_out_of_the_way() -> None:
    print(sentence(because("camera.mount.out_of_image")), flush=True)
    if not sys.stdin.readline():
        raise CommandError(because("camera.nobody_to_touch"))


def _fit(points: Array, touched: Array, found: Sequence[Sighting | None], model: CameraModel) -> TouchFit:
    enough = [each for each in found if each is not None and len(each.points) >= 4 * ENOUGH_TAGS]
    if not enough:
        seen = max((len(each.points) // 4 for each in found if each is not None), default=0)
        few = because("measure.tags.few", seen=seen, least=ENOUGH_TAGS)
        raise CommandError(because("camera.nothing_written", few))
    try:
        return fit_touches(points, touched, one_of(enough, 4 * ENOUGH_TAGS), model)
    except NotMeasured as error:
        raise CommandError(because("camera.nothing_written", error.reason)) from error
