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
from gemelo.libraries.vision.other_boards import other_board, remedy
from gemelo.libraries.vision.rigid import Array, from_transform, rigid, to_transform
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.reasons import because
from gemelo.tools.cli.bus.request_text import joints_text
from gemelo.tools.cli.camera.camera_boards import tag_board
from gemelo.tools.cli.camera.camera_images import Eye, Subject
from gemelo.tools.cli.common.errors import CommandError, ExitCode, text_of, unknown, usage
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
        raise usage(f"--poses {options.poses} is not {FEWEST_POSES} to {MOST_POSES}")
    if camera.record.parent and options.on:
        raise usage(f'camera "{camera.name}" rides on {camera.record.parent}: lay the board down, without --on')
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
    print(
        f"{camera.name} is at {x:.1f} {y:.1f} {z:.1f} mm in {task.parent(arm.base_frame)}; poses that took no part are "
        f"{1e3 * fit.held_out:.2f} mm off, and what is known least has a standard deviation of {1e3 * fit.sigma:.1f} mm"
    )
    print(f"written to {path}")
    return ExitCode.OK


def measure(arm: Arm, eye: Eye, task: Task, is_agreed: bool) -> MountFit:
    """Where the camera stands; raises `CommandError` with what is missing."""
    start = _standing(arm)
    link_at = link_pose(arm.description, task.link)
    try:
        first = BoardView(link_at(start), _look(eye, task))
    except ValueError as error:
        raise CommandError(
            f"{error} where the arm stands now: bring it to where {task.camera.name} sees them (`gemelo jog`, or the "
            "page), and say this again; nothing was written"
        ) from error
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
        raise CommandError(
            f'camera "{info.name}" is told to be carried by {info.parent}, and cell.toml says {parent}: take its '
            "[camera.mount] out of camera.toml, and start `camera` again"
        )
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
        print(f"the height of the tags is taken as {1e3 * task.fallback:.1f} mm, as cell.toml says")
        chosen = choose(belief)
    if len(chosen.joints) + 1 < FEWEST_POSES:
        raise CommandError(
            f"the arm can show the tags to {task.camera.name} in {len(chosen.joints)} poses beside this one, at least "
            f"{FEWEST_POSES - 1} are needed: bring it to where the tags are in the middle of the image, and take away "
            "what stands in its way; nothing has moved, nothing was written"
        )
    if chosen.undetermined:
        raise CommandError(f"{'; '.join(chosen.undetermined)}; nothing has moved, nothing was written")
    return belief, chosen


def _show(arm: Arm, task: Task, chosen: Chosen) -> None:
    for number, joints in enumerate(chosen.joints, 1):
        print(f"{number:3}: {joints_text(arm.joint_names, joints.tolist(), arm.description)}")
    nearest, farthest = (1e3 * value for value in chosen.distances)
    turns = ", ".join(f"{np.degrees(value):.0f}" for value in chosen.turns)
    print(f"{len(chosen.joints)} poses: the tags {nearest:.0f} to {farthest:.0f} mm away, turned by {turns} deg (RMS)")
    if task.carrier is Carrier.CAMERA:
        print("plans do not know of the camera on the arm unless the scene has it (`gemelo scene`)")


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
            print(f"plans do not keep clear of the tags on the arm, since these would touch already: {error.reason}")
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
            print(f"pose {number} is left out: {text_of(refused)}", flush=True)
            continue
        except ValueError as error:
            print(f"pose {number} is left out: {error}", flush=True)
            continue
        print(f"pose {number}: {len(sighting.points) // 4} tags", flush=True)
        views.append(BoardView(link_at(_standing(arm)), sighting))
        numbers.append(number)
    return views, numbers


def _look(eye: Eye, task: Task) -> Sighting:
    """The board as it is seen from here; ValueError where it is not."""
    model = model_of(eye.info)
    images = list(eye.images(IMAGES))
    found = [task.board.find(image, model) for image in images]
    if not any(found) and (other := other_board(images[-1], task.board) if images else ""):
        raise ValueError(f"the image shows {other}, and not the board of this command ({remedy(task.board)}),")
    seen = one_of(found, task.fewest)
    return without_hidden(seen, model)


def solved(views: list[BoardView], numbers: Sequence[int], belief: Belief) -> MountFit:
    """The camera's place from views of the poses `numbers`, 0 being the first one; raises `CommandError`."""
    try:
        fit = fit_mount(views, belief.model, belief.carrier, belief.height)
    except ValueError as error:
        raise CommandError(f"{error}; nothing was written") from error
    for index in fit.outliers:
        where = f"pose {numbers[index]}" if numbers[index] else "the first image"
        off = 1e3 * fit.errors[index]
        print(f"{where} does not agree with the others ({off:.1f} mm), and was left out: was something touched?")
    if fit.faults:
        raise CommandError(f"{'; '.join(fit.faults)}; nothing was written")
    if fit.held_out > LARGEST_HELD_OUT:
        raise CommandError(
            f"poses are {1e3 * fit.held_out:.1f} mm from where the others put them (at most "
            f"{1e3 * LARGEST_HELD_OUT:g}), and nothing was written: the board or the camera is loose or was touched, "
            "or the arm has lost steps (`gemelo verify`)"
        )
    return fit


def _standing(arm: Arm) -> Array:
    joints = arm.joints
    return np.array([joints[name] for name in arm.joint_names])


def _named(arm: Arm, joints: Array) -> dict[str, float]:
    return dict(zip(arm.joint_names, joints.tolist(), strict=True))
