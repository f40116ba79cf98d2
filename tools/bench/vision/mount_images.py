"""Mounting a camera as the wizard does it, on rendered images: poses are chosen, looked from, and solved.

The virtual camera renders the arm with its tags from exact poses; what is believed of the camera at first is off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gemelo.libraries.arm.cell.camera_model import exact_info
from gemelo.libraries.arm.cell.cell_file import Cell
from gemelo.libraries.arm.frames.transforms import from_rpy, to_message
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.vision.boards import Sighting, TagBoard
from gemelo.libraries.vision.calibration.link_pose import link_pose
from gemelo.libraries.vision.calibration.poses import Belief, Chosen, choose_poses
from gemelo.libraries.vision.calibration.reprojection import BoardView, Carrier
from gemelo.libraries.vision.calibration.shots import one_of, without_hidden
from gemelo.libraries.vision.camera_model import CameraModel, model_of
from gemelo.libraries.vision.rigid import Array, from_transform, step
from gemelo.libraries.vision.tags import GreyImage
from gemelo.schemas.cell import CameraRecord, TagRecord, VirtualSource
from gemelo.schemas.joints import JointState
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera
from gemelo.services.camera.virtual.world import CameraWorld

FIRST = 200  # id of the board's first tag
OFF = np.array([0.06, -0.05, 0.04, 0.015, -0.02, 0.01])  # [rad], [m] of what is believed of the camera at first
CLEARANCE, LOWEST = 0.004, 0.04  # [m] between links, and of the tool above the table
POSES = 15


@dataclass(frozen=True)
class Setup:
    """An arm, a camera and tags, of which one moves."""

    arm: ArmDescription
    carrier: Carrier
    link: str
    camera: CameraRecord
    board: TagBoard
    tags: tuple[TagRecord, ...]
    carrier_from_board: Array  # (4, 4)
    start: tuple[float, ...]  # where the board is seen at first

    @property
    def height(self) -> float:
        """[m] of the board along z of what carries it."""
        return float(self.carrier_from_board[2, 3])


def camera_on_link(arm: ArmDescription) -> Setup:
    """parol6 with a camera beside its gripper, and the board on the table."""
    source = VirtualSource(distortion=(0.08, -0.16, 0.0008, -0.0005, 0.02))
    camera = CameraRecord(
        name="wrist", source=source, parent="link_6", position=(-0.045, 0.06, -0.03), look_at=(-0.045, 0.02, -0.3),
        field_of_view=1.15,
    )  # fmt: skip
    return _setup(
        arm, Carrier.CAMERA, "link_6", camera, TagBoard(first=FIRST), (0.26, 0.0, 0.0), (0.0, 0.0, 0.3), "ready"
    )


def board_on_tool(arm: ArmDescription) -> Setup:
    """parol6 with the board beyond its gripper, and a camera beside the table."""
    camera = CameraRecord(
        name="side", source=VirtualSource(), position=(0.72, 0.16, 0.5), look_at=(0.33, 0.0, 0.3), field_of_view=1.15
    )
    board = TagBoard(first=FIRST)
    return _setup(arm, Carrier.BOARD, "tool_link", camera, board, (0.0, 0.0, 0.07), (0.0, 0.0, 0.2), "forward")


def tag_on_level_tool(arm: ArmDescription) -> Setup:
    """rm1, which cannot tilt its tool, with one tag that looks up from it, and a camera above the table."""
    camera = CameraRecord(
        name="overhead",
        source=VirtualSource(),
        position=(0.54, 0.0, 0.62),
        look_at=(0.27, 0.0, 0.1),
        field_of_view=1.15,
    )
    board = TagBoard(columns=1, rows=1, tag=0.05, first=FIRST)
    at, turned = (0.03, 0.055, -0.03), (np.pi, 0.0, 0.4)
    return _setup(arm, Carrier.BOARD, "efector_link", camera, board, at, turned, "ready")


def _setup(
    arm: ArmDescription, carrier: Carrier, link: str, camera: CameraRecord, board: TagBoard,
    at: tuple[float, float, float], rpy: tuple[float, float, float], start: str,
) -> Setup:  # fmt: skip
    pose = from_transform(to_message((at, from_rpy(*rpy))))
    parent = link if carrier is Carrier.BOARD else ""
    tags = []
    for number, centre in board.centres().items():
        x, y, z = (pose[:3, :3] @ centre + pose[:3, 3]).tolist()
        tags.append(TagRecord(id=number, size=board.tag, parent=parent, position=(x, y, z), rpy=rpy))
    return Setup(arm, carrier, link, camera, board, tuple(tags), pose, arm.named_states[start])


class Sight:
    """The camera's images of the arm in any configuration."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self._world = CameraWorld(setup.arm, Cell(Path(), cameras=(setup.camera,), tags=setup.tags))
        self.info = exact_info(setup.camera, setup.arm.base_frame)
        self.model: CameraModel = model_of(self.info)
        assert isinstance(setup.camera.source, VirtualSource)
        self._camera = VirtualCamera(setup.camera, setup.camera.source, self.info, self._world.snapshot)

    @property
    def truth(self) -> Array:
        """parent_from_camera (4, 4)."""
        return from_transform(self.info.parent_from_camera)

    def image(self, joints: Array) -> GreyImage:
        """One image of the arm at joints [rad] or [m]."""
        state = JointState(stamp=1, name=self.setup.arm.joint_names, position=tuple(joints.tolist()))
        self._world.on_joint_state(state)
        image = self._camera.image(self._world.snapshot())
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), dtype=np.uint8)

    def sighting(self, joints: Array, images: int = 1) -> Sighting:
        """The board from joints [rad] or [m]; ValueError where it is not seen."""
        board = self.setup.board
        fewest = 4 * min(4, len(board.centres()))
        return without_hidden(
            one_of([board.find(self.image(joints), self.model) for _ in range(images)], fewest), self.model
        )


@dataclass(frozen=True)
class Taken:
    """What was seen, and what had been believed."""

    belief: Belief
    chosen: Chosen
    views: tuple[BoardView, ...]
    unseen: tuple[int, ...]  # of the chosen poses, counted from 0


def take(sight: Sight, height: float | None = None, count: int = POSES, seed: int = 0) -> Taken:
    """Looks from the start, chooses poses by that, with the board at `height` [m], and looks from them."""
    setup = sight.setup
    at = link_pose(setup.arm, setup.link)
    start = np.array(setup.start)
    first = BoardView(at(start), sight.sighting(start))
    camera = sight.truth @ step(OFF)
    belief = Belief(sight.model, setup.carrier, camera, np.eye(4), setup.board.points(), height)
    belief = belief.seeing(first.base_from_link, first.sighting)
    chosen = choose_poses(belief, at, limits_of(setup.arm), start, standing(setup.arm), count, seed)
    views, unseen = [first], []
    for index, joints in enumerate(chosen.joints):
        try:
            views.append(BoardView(at(joints), sight.sighting(joints)))
        except ValueError:
            unseen.append(index)
    return Taken(belief, chosen, tuple(views), tuple(unseen))


def limits_of(arm: ArmDescription) -> tuple[Array, Array]:
    """The joints' lower and upper values (n,)."""
    return np.array([joint.lower for joint in arm.joints]), np.array([joint.upper for joint in arm.joints])


def standing(arm: ArmDescription) -> Callable[[Array], bool]:
    """Whether the arm may stand at joint values [rad] or [m], by its links alone and the height of its tool."""
    kinematics = Kinematics(arm)

    def may_stand(joints: Array) -> bool:
        low = kinematics.tool(joints).position[2] < LOWEST and arm.name != "rm1"
        return not low and not kinematics.self_collisions(joints, CLEARANCE)

    return may_stand
