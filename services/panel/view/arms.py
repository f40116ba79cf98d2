"""The arm as viser draws it, more than once: as it is measured, as the goal, and as the plan plays it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import viser
import yourdfpy
from numpy.typing import NDArray
from viser.extras import ViserUrdf

from gemelo.libraries.arm.frames.transforms import Rigid
from gemelo.libraries.arm.kinematics.chain import complete, joint_transform, link_transforms, origin_of
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.services.panel.model.pace import UNSEEN

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]  # red, green, blue and opacity, each 0 to 1


class JointFrames(ViserUrdf):
    """The drawing of a URDF, whose nodes are known by the link that hangs on them."""

    def by_link(self) -> dict[str, viser.SceneNodeHandle]:
        """The node of each link but the root: its pose is the one in its parent link."""
        pairs = zip(self._joint_map_values, self._joint_frames, strict=True)
        return {joint.child: frame for joint, frame in pairs}


@dataclass
class DrawnJoint:
    """One joint that moves, and its node."""

    joint: UrdfJoint
    origin: Rigid
    node: viser.SceneNodeHandle
    shown: float | None = None  # [rad] or [m]


class DrawnArm:
    """One arm under the scene's node `name`; `color` paints all of it, else it has the URDF's colours."""

    def __init__(self, server: viser.ViserServer, arm: ArmDescription, name: str, color: Color | None = None) -> None:
        self._model, self._name = arm.model, name
        self._root = server.scene.add_frame(name, show_axes=False)
        drawn = JointFrames(server, load_model(arm.urdf_path), root_node_name=name, mesh_color_override=color)
        drawn.update_cfg(np.zeros(len(drawn.get_actuated_joint_names())))  # what is fixed is placed here only
        self.nodes = drawn.by_link()  # the pose of each is the one in its parent link
        self.joints = [  # with what each is drawn at
            DrawnJoint(joint, origin_of(joint), self.nodes[joint.child])
            for joint in arm.model.joints
            if joint.kind is not JointKind.FIXED
        ]
        self._positions: Mapping[str, float] = {}

    @property
    def is_visible(self) -> bool:
        return bool(self._root.visible)

    @is_visible.setter
    def is_visible(self, visible: bool) -> None:
        if self._root.visible != visible:
            self._root.visible = visible

    def show(self, joints: Mapping[str, float]) -> bool:
        """Joint values [rad] or [m] by name; False where it stands so already.

        Only the nodes of joints that have moved are sent, and of each only what a joint of its kind changes.
        """
        positions = complete(self._model, joints)
        moved = False
        for drawn in self.joints:
            at = positions.get(drawn.joint.name, 0.0)
            if drawn.shown is not None and abs(at - drawn.shown) < UNSEEN:
                continue
            drawn.shown, moved = at, True
            point, (x, y, z, w) = joint_transform(drawn.joint, at, drawn.origin)
            if drawn.joint.kind is JointKind.PRISMATIC:
                drawn.node.position = point
            else:
                drawn.node.wxyz = (w, x, y, z)
        if moved:
            self._positions = positions
        return moved

    def pose(self, link: str) -> Rigid:
        """Where `link` is in the root link's frame, as the arm is drawn."""
        return link_transforms(self._model, self._positions)[link]

    def node_of(self, link: str) -> str:
        """The scene's node that moves with `link`: what hangs on it needs not be sent while the arm moves."""
        node = self.nodes.get(link)
        return f"{self._name}/visual" if node is None else str(node.name)


def load_model(path: Path) -> yourdfpy.URDF:
    """The URDF with the meshes that lie beside it."""
    handler = partial(yourdfpy.filename_handler_magic, dir=str(path.parent))
    return yourdfpy.URDF.load(str(path), filename_handler=handler)
