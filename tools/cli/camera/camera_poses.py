"""`gemelo camera mount` by itself: the arm goes to poses in which the camera sees tags, and that tells where it is.

The camera rides on a link and the board lies on the table, or the camera stands and a link carries the board or a tag.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import gemelo
from gemelo.libraries.arm.cell.camera_file import MOUNT_BOARD
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.libraries.vision.boards import Sighting, TagBoard
from gemelo.libraries.vision.calibration.link_pose import link_pose
from gemelo.libraries.vision.calibration.mount import FEWEST_POSES, MountFit, fit_mount
from gemelo.libraries.vision.calibration.poses import Belief, Chosen, choose_poses
from gemelo.libraries.vision.calibration.reprojection import BoardView, Carrier
from gemelo.libraries.vision.calibration.shots import one_of, without_hidden
from gemelo.libraries.vision.camera_model import model_of
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.other_boards import other_board
from gemelo.libraries.vision.rigid import Array, from_transform, rigid, to_transform
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.reasons import because
from gemelo.tools.cli.bus.request_text import joints_text
from gemelo.tools.cli.camera.camera_boards import tag_board
from gemelo.tools.cli.camera.camera_images import Eye, Subject
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.terminal import confirm
from gemelo.tools.cli.common.units import LENGTH, parse_quantity
from gemelo.tools.cli.parser import Options, Parser, positive_integer

if TYPE_CHECKING:
    from gemelo import Arm
    from gemelo.libraries.arm.model.description import ArmDescription

POSES, MOST_POSES = 15, 60
IMAGES = 3  # of each pose
FEWEST_TAGS = 4  # of a board that must be seen; of fewer all
SPEED = 0.5  # share of the joints' limits
LARGEST_HELD_OUT = 0.002  # [m] above which the poses are not believed
ROOM = 0.01  # [m] around a board that the arm carries
PLATE = 0.004  # [m] its thickness


@dataclass(frozen=True)
class Task:
    """What is measured, with what."""

    camera: Subject
    carrier: Carrier
    link: str  # that carries the camera or the board
    board: TagBoard
    height: float | None  # [m] of the board along z of what carries it, as given by the person
    fallback: float | None  # [m] the same as far as cell.toml says it, for an arm that cannot do without
    count: int

    def parent(self, base_frame: str) -> str:
        """The frame in which the camera's place is looked for."""
        return self.link if self.carrier is Carrier.CAMERA else base_frame

    @property
    def fewest(self) -> int:
        """Points that must be seen."""
        return 4 * min(FEWEST_TAGS, len(self.board.centres()))


def add_options(parser: Parser) -> None:
    """Adds what carries the tags, how many poses, the tags' height, and --yes."""
    said = "the camera stands and LINK carries the board, or a [[tag]] of cell.toml: the arm shows it by itself"
    parser.add_argument("--on", metavar="LINK", default="", help=said)
    parser.add_argument("--poses", type=positive_integer, default=POSES, metavar="N", help=f"to go to ({POSES})")
    said = "of the tags along z of what carries them (LINK, or the base): for an arm that cannot tilt its tool"
    parser.add_argument("--tag-height", metavar="LENGTH", default="", help=said)
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask before the arm goes")


def task_of(options: Options, camera: Subject, arm: ArmDescription) -> Task:
    """What the options and cell.toml ask for; raises `CommandError`."""
    if not FEWEST_POSES <= options.poses <= MOST_POSES:
        raise usage(because("camera.poses.count", count=options.poses, least=FEWEST_POSES, most=MOST_POSES))
    if camera.record.parent and options.on:
        raise usage(because("camera.poses.rides", camera=camera.name, link=camera.record.parent))
    link = options.on or camera.record.parent
    if link not in arm.model.link_names:
        raise unknown("link", link, arm.model.link_names)
    height = parse_quantity(options.tag_height, LENGTH, "--tag-height") if options.tag_height else None
    board, fallback = tag_board(options.bar), camera.cell.table
    if options.on:
        board, fallback = _carried(camera, link, board)
    carrier = Carrier.BOARD if options.on else Carrier.CAMERA
    return Task(camera, carrier, link, board, height, fallback, options.poses)


def _carried(camera: Subject, link: str, board: TagBoard) -> tuple[TagBoard, float | None]:
    """The tag that cell.toml has on the link and its height there, or else the printed board."""
    for tag in camera.cell.tags:
        if tag.parent == link and tag.id not in board.centres():
            height = tag.position[2] if any(tag.position) else None
            return TagBoard(columns=1, rows=1, tag=tag.size, first=tag.id, family=tag.family), height
    return board, None


def run(options: Options, camera: Subject) -> ExitCode:
    """Goes to poses, looks, and writes camera.toml; raises `CommandError` where that tells too little."""
    robot = load_robot()
    task = task_of(options, camera, robot.description)
    with connect_arm(robot) as arm:
        fit = measure(arm, Eye(arm, camera.name), task, options.yes)
    path = camera.write_mount(task.parent(arm.base_frame), fit.parent_from_camera, fit.held_out)
    x, y, z = (1e3 * value for value in fit.parent_from_camera[:3, 3])
    at = {"camera": camera.name, "x": x, "y": y, "z": z, "frame": task.parent(arm.base_frame)}
    print(sentence(because("camera.poses.done", off=1e3 * fit.held_out, sigma=1e3 * fit.sigma, **at)))
    print(sentence(because("camera.written", file=str(path))))
    return ExitCode.OK


def measure(arm: Arm, eye: Eye, task: Task, is_agreed: bool) -> MountFit:
    """Where the camera stands; raises `CommandError` with what is missing."""
    start = _standing(arm)
    link_at = link_pose(arm.description, task.link)
    try:
        first = BoardView(link_at(start), _look(eye, task))
    except NotMeasured as error:
        raise CommandError(because("camera.poses.not_here", error.reason, camera=task.camera.name)) from error
    belief = belief_of(eye.info, task, arm.base_frame).seeing(first.base_from_link, first.sighting)
    with _carrying(arm, task, belief):
        belief, chosen = _choose(arm, task, belief, start)
        _show(arm, task, chosen)
        confirm(because("camera.poses.ask"), is_agreed)
        views, numbers = drive(arm, eye, task, chosen.joints)
        arm.move(joints=_named(arm, start), speed=SPEED)
    return solved([first, *views], [0, *numbers], belief)


def belief_of(info: CameraInfo, task: Task, base_frame: str) -> Belief:
    """What is believed of the camera until now; the board is not known yet."""
    parent = task.parent(base_frame)
    if info.parent != parent:
        raise CommandError(because("camera.poses.parent", camera=info.name, parent=info.parent, wanted=parent))
    camera = from_transform(info.parent_from_camera)
    return Belief(model_of(info), task.carrier, camera, np.eye(4), task.board.points(), task.height)


def _choose(arm: Arm, task: Task, belief: Belief, start: Array) -> tuple[Belief, Chosen]:
    """Poses that tell all, and what is taken as known for that; raises `CommandError` where there are none."""
    limits = tuple(np.array([getattr(joint, side) for joint in arm.description.joints]) for side in ("lower", "upper"))

    def may_stand(joints: Array) -> bool:
        try:
            arm.check(_named(arm, joints))
        except gemelo.Refused:
            return False
        return True

    def choose(believed: Belief) -> Chosen:
        link_at = link_pose(arm.description, task.link)
        return choose_poses(believed, link_at, (limits[0], limits[1]), start, may_stand, task.count)

    chosen = choose(belief)
    if chosen.undetermined and belief.height is None and task.fallback is not None:
        belief = replace(belief, height=task.fallback)
        print(sentence(because("camera.poses.height", height=1e3 * task.fallback)))
        chosen = choose(belief)
    if len(chosen.joints) + 1 < FEWEST_POSES:
        count = len(chosen.joints)
        few = because("camera.poses.few", camera=task.camera.name, count=count, least=FEWEST_POSES - 1)
        raise CommandError(because("camera.nothing_moved", few))
    if chosen.undetermined:
        raise CommandError(because("camera.nothing_moved", *chosen.undetermined))
    return belief, chosen


def _show(arm: Arm, task: Task, chosen: Chosen) -> None:
    for number, joints in enumerate(chosen.joints, 1):
        print(f"{number:3}: {joints_text(arm.joint_names, joints.tolist(), arm.description)}")
    nearest, farthest = (1e3 * value for value in chosen.distances)
    turns = ", ".join(f"{np.degrees(value):.0f}" for value in chosen.turns)
    count = len(chosen.joints)
    print(sentence(because("camera.poses.chosen", count=count, nearest=nearest, farthest=farthest, turns=turns)))
    if task.carrier is Carrier.CAMERA:
        print(sentence(because("camera.poses.not_in_scene")))


@contextmanager
def _carrying(arm: Arm, task: Task, belief: Belief) -> Iterator[None]:
    """While the block lasts the plans have the board as a part of the arm, where that is possible as the arm stands."""
    if task.carrier is Carrier.CAMERA:
        yield
        return
    width, height = (edge + ROOM for edge in task.board.size)
    pose = to_transform(belief.board @ rigid(np.zeros(3), np.array([0.0, 0.0, -PLATE / 2.0])))
    arm.scene.add_box(
        MOUNT_BOARD, (width, height, PLATE), at=pose.translation, orientation=pose.rotation, frame=task.link,
        attach=True, touch=_rigid_links(arm.description, task.link),
    )  # fmt: skip
    is_there = True
    try:
        try:
            arm.check(arm.joints)
        except gemelo.Refused as error:
            arm.scene.remove(MOUNT_BOARD)
            is_there = False
            print(sentence(because("camera.poses.touching", error.reason)))
        yield
    finally:
        if is_there:
            arm.scene.remove(MOUNT_BOARD)


def _rigid_links(arm: ArmDescription, link: str) -> list[str]:
    """The links that are fixed to `link`, itself included."""
    found = {link}
    fixed = [joint for joint in arm.model.joints if joint.kind is JointKind.FIXED]
    for _ in fixed:
        for joint in fixed:
            if found & {joint.parent, joint.child}:
                found |= {joint.parent, joint.child}
    return sorted(found)


def drive(arm: Arm, eye: Eye, task: Task, poses: Sequence[Array]) -> tuple[list[BoardView], list[int]]:
    """What is seen from each pose, joint values (n,) [rad] or [m], and which poses those are, counted from 1; the
    others are named."""
    link_at = link_pose(arm.description, task.link)
    views: list[BoardView] = []
    numbers: list[int] = []
    for number, joints in enumerate(poses, 1):
        try:
            arm.move(joints=_named(arm, joints), speed=SPEED)
            sighting = _look(eye, task)
        except gemelo.Refused as refused:
            print(sentence(because("camera.poses.left_out", refused.message, pose=number)), flush=True)
            continue
        except NotMeasured as error:
            print(sentence(because("camera.poses.left_out", error.reason, pose=number)), flush=True)
            continue
        print(sentence(because("camera.poses.seen", pose=number, count=len(sighting.points) // 4)), flush=True)
        views.append(BoardView(link_at(_standing(arm)), sighting))
        numbers.append(number)
    return views, numbers


def _look(eye: Eye, task: Task) -> Sighting:
    """The board as it is seen from here; NotMeasured where it is not."""
    model = model_of(eye.info)
    images = list(eye.images(IMAGES))
    found = [task.board.find(image, model) for image in images]
    if not any(found) and images and (other := other_board(images[-1], task.board)) is not None:
        raise NotMeasured(other)
    seen = one_of(found, task.fewest)
    return without_hidden(seen, model)


def solved(views: list[BoardView], numbers: Sequence[int], belief: Belief) -> MountFit:
    """The camera's place from views of the poses `numbers`, 0 being the first one; raises `CommandError`."""
    try:
        fit = fit_mount(views, belief.model, belief.carrier, belief.height)
    except NotMeasured as error:
        raise CommandError(because("camera.nothing_written", error.reason)) from error
    for index in fit.outliers:
        off = 1e3 * fit.errors[index]
        if numbers[index]:
            print(sentence(because("camera.poses.disagrees", pose=numbers[index], off=off)))
        else:
            print(sentence(because("camera.poses.disagrees.first", off=off)))
    if fit.faults:
        raise CommandError(because("camera.nothing_written", *fit.faults))
    if fit.held_out > LARGEST_HELD_OUT:
        raise CommandError(because("camera.poses.off", off=1e3 * fit.held_out, most=1e3 * LARGEST_HELD_OUT))
    return fit


def _standing(arm: Arm) -> Array:
    joints = arm.joints
    return np.array([joints[name] for name in arm.joint_names])


def _named(arm: Arm, joints: Array) -> dict[str, float]:
    return dict(zip(arm.joint_names, joints.tolist(), strict=True))
