"""Forward kinematics, Jacobian and self-collisions of the arm, by pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import wrong_file
from gemelo.libraries.arm.kinematics.joint_mapping import JointMapping
from gemelo.libraries.arm.kinematics.self_collisions import SelfCollisionChecker
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because

Array = NDArray[np.float64]
Positions = Sequence[float] | Array


class FramePose(NamedTuple):
    """`position` (3,) [m] and `rotation` (3, 3) in the base frame."""

    position: Array
    rotation: Array


def frame_of_link(model: pin.Model, link: str) -> int:
    """The index of a link's frame; a joint may have the same name."""
    return int(model.getFrameId(link, pin.FrameType.BODY))


class Kinematics:
    """The arm's geometry; joint values are (n,) [rad] or [m] in the arm's order, poses in its base frame."""

    def __init__(self, arm: ArmDescription) -> None:
        self.arm = arm
        self._model = pin.buildModelFromUrdf(str(arm.urdf_path))
        self._data = self._model.createData()
        self._configuration = JointMapping(arm, self._model)
        self._tool = frame_of_link(self._model, arm.tool_frame)
        self._base = self._fixed_base()
        self._base_is_root = self._base.isIdentity()
        self._links = {name: frame_of_link(self._model, name) for name in arm.model.link_names}
        self.collisions = SelfCollisionChecker(arm, self._model, self._configuration)

    @property
    def model(self) -> pin.Model:
        """The arm as pinocchio has it; not to be changed."""
        return self._model

    @property
    def configuration(self) -> JointMapping:
        """From the arm's joints to pinocchio's."""
        return self._configuration

    @property
    def base(self) -> pin.SE3:
        """The base frame in pinocchio's world."""
        return self._base.copy()

    def tool(self, positions: Positions) -> FramePose:
        """The tool's pose in the base frame at joint values (n,) [rad] or [m]."""
        pin.forwardKinematics(self._model, self._data, self._configuration.to_pinocchio(positions))
        placement = self._in_base(pin.updateFramePlacement(self._model, self._data, self._tool))
        return FramePose(placement.translation.copy(), placement.rotation.copy())

    def jacobian(self, positions: Positions) -> Array:
        """(6, n): the tool point's velocity [m/s] above its angular velocity [rad/s], along the base's axes."""
        return self.tool_and_jacobian(positions)[1]

    def tool_and_jacobian(self, positions: Positions) -> tuple[FramePose, Array]:
        """The tool's pose in the base frame and the Jacobian (6, n) as of `jacobian`, at joint values (n,) [rad] or
        [m]; one computation gives both."""
        q = self._configuration.to_pinocchio(positions)
        jacobian = pin.computeFrameJacobian(self._model, self._data, q, self._tool, pin.LOCAL_WORLD_ALIGNED)
        jacobian = jacobian.reshape(6, -1)  # of a single column pinocchio makes (6,)
        placement = self._in_base(pin.updateFramePlacement(self._model, self._data, self._tool))
        jacobian = self._configuration.fold(jacobian)
        if not self._base_is_root:
            turn = self._base.rotation.T
            jacobian = np.vstack((turn @ jacobian[:3], turn @ jacobian[3:]))
        return FramePose(placement.translation.copy(), placement.rotation.copy()), jacobian

    def link_poses(self, positions: Positions) -> dict[str, Transform]:
        """Every link's pose in the base frame at joint values (n,) [rad] or [m]."""
        pin.framesForwardKinematics(self._model, self._data, self._configuration.to_pinocchio(positions))
        return {name: _message(self._in_base(self._data.oMf[index])) for name, index in self._links.items()}

    def self_collisions(self, positions: Positions, margin: float = 0.0) -> list[tuple[str, str]]:
        """The pairs of links that are nearer than `margin` [m] and are not allowed to be."""
        return self.collisions.pairs_within(positions, margin)

    def _in_base(self, placement: pin.SE3) -> pin.SE3:
        return placement if self._base_is_root else self._base.actInv(placement)

    def _fixed_base(self) -> pin.SE3:
        frame = self._model.frames[frame_of_link(self._model, self.arm.base_frame)]
        if frame.parentJoint != 0:
            raise wrong_file(self.arm.robot_path, because("robot.frame.moves", frame=self.arm.base_frame))
        return frame.placement.copy()


def _message(placement: pin.SE3) -> Transform:
    rotation = pin.Quaternion(placement.rotation)
    return Transform(
        translation=tuple(placement.translation.tolist()),
        rotation=(rotation.x, rotation.y, rotation.z, rotation.w),
    )
