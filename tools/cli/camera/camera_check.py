"""`gemelo camera check`: points the tool above tags that a camera has located, and says where an error comes from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import gemelo
from gemelo.api.targets import FULL
from gemelo.libraries.vision.calibration.accuracy import Accuracy, Budget, Cause, judge
from gemelo.schemas.reasons import because, plain
from gemelo.tools.cli.camera.camera_images import Subject, subject
from gemelo.tools.cli.camera.camera_tip import ask_offset, step_floor, tip_length, tip_option
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.units import LENGTH, parse_quantity
from gemelo.tools.cli.parser import Options, Parser, positive_integer

if TYPE_CHECKING:
    from gemelo import Arm, Seen

ABOVE = "10mm"
MOST_TAGS = 6
REMEDIES = {
    Cause.UNKNOWN: "camera.check.more_tags",
    Cause.MOUNT: "camera.check.mount",
    Cause.SCALE: "camera.check.scale",
    Cause.ZERO: "camera.check.zero",
    Cause.ARM: "camera.check.arm",
}
DOWN = (0.0, 0.0, -1.0)


class TagPointing(NamedTuple):
    """One tag that was pointed at."""

    seen: Seen
    offset: tuple[float, float]  # [m] x and y of the base, tip minus tag
    floor: float  # [m] how far the tool may be off by half a step of every joint


def add_options(parser: Parser) -> None:
    """Adds the camera, how high, how many, and what points."""
    parser.add_argument("camera", metavar="CAMERA", nargs="?", default="", help="of the cell file; its first one")
    parser.add_argument("--above", metavar="LENGTH", default=ABOVE, help=f"between tip and tag ({ABOVE})")
    parser.add_argument("--tags", type=positive_integer, default=MOST_TAGS, metavar="N", help="at most (6)")
    tip_option(parser)


def run(options: Options) -> ExitCode:
    """Points at one tag after the other, asks, and prints what was found; raises `CommandError`."""
    camera = subject(options.camera)
    above = parse_quantity(options.above, LENGTH, "--above")
    if above < 0.004:
        raise usage(because("camera.check.near", above=str(options.above)))
    robot = load_robot()
    tip = tip_length(options.tip, robot)
    with connect_arm(robot) as arm:
        try:
            pointings = [*_pointings(arm, camera, above + tip, options.tags)]
        except gemelo.Error as error:
            raise CommandError(error) from error
    report(camera, pointings)
    return ExitCode.OK


def _pointings(arm: Arm, camera: Subject, height: float, most: int) -> Iterator[TagPointing]:
    """Looks once, while the arm is out of the way, then points."""
    with _in_scene(arm, camera.name) as seen:
        tags = [each for each in seen if each.kind == "tag" and not each.trouble][:most]
        if not tags:
            trouble = next((each for each in seen if each.trouble), None)
            if trouble is None:
                raise CommandError(because("camera.check.no_tag", camera=camera.name))
            why = because("camera.check.trouble", plain(trouble.trouble), name=trouble.name)
            raise CommandError(because("camera.check.no_tag.why", why, camera=camera.name))
        for each in tags:
            x, y, z = each.pose.position
            if len(arm.joint_names) < FULL:
                arm.move(position=(x, y, z + height))
            else:
                arm.move(position=(x, y, z + height), along=DOWN)
            beside = ask_offset(because("camera.check.ask", name=each.name))
            yield TagPointing(each, beside, step_floor(arm))


@contextmanager
def _in_scene(arm: Arm, camera: str) -> Iterator[tuple[Seen, ...]]:
    """What is seen, as boxes that the arm keeps away from until the block ends."""
    before = set(arm.scene.objects)
    try:
        yield arm.detect(camera=camera, scene=True)
    finally:
        for name in set(arm.scene.objects) - before:
            arm.scene.remove(name)


def report(camera: Subject, pointings: list[TagPointing]) -> Accuracy:
    """Prints each pointing, what was to be expected, and the cause with its remedy."""
    for each in pointings:
        x, y = (1e3 * value for value in each.offset)
        print(sentence(because("camera.check.pointed", name=each.seen.name, x=x, y=y, floor=1e3 * each.floor)))
    mount = camera.measured.mount
    budget = Budget(
        camera=max(each.seen.sigma for each in pointings),
        mount=mount.held_out if mount is not None else 0.0,
        arm=max(each.floor for each in pointings),
    )
    parts = {"camera": 1e3 * budget.camera, "arm": 1e3 * budget.arm}
    if mount is None:
        print(sentence(because("camera.check.expected.unmeasured", **parts)))
    else:
        print(sentence(because("camera.check.expected", mount=1e3 * budget.mount, **parts)))
    points = np.array([each.seen.pose.position[:2] for each in pointings])
    found = judge(points, np.array([each.offset for each in pointings]), budget)
    if found.cause in REMEDIES:
        print(sentence(because("camera.check.found", found.why, because(REMEDIES[found.cause]))))
    else:
        print(sentence(found.why))
    return found
