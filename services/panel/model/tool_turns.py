"""About which of its own axes an arm's tool can be turned while it stays where it is: the rings of the gizmo."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.arm.frames.transforms import rotate
from services.arm.kinematics.chain import link_transforms
from services.arm.model.description import Arm

Array = NDArray[np.float64]
Rings = tuple[bool, bool, bool]  # about the tool's x, y and z

NO_RINGS: Rings = (False, False, False)
ALL_RINGS: Rings = (True, True, True)
# Tuning constants: chosen, where a line does not say measured or standard.
SAMPLES = 8  # configurations; those at a stretch do not hide what others can
STEP = 1e-5  # [rad] or [m] of the finite differences
RANK = 1e-4  # singular value [m] or [rad] per joint below which a direction is none: above the differences' error
ALONG = 0.999  # cosine from which the axis is one of the tool's own


def tool_rings(arm: Arm) -> Rings:
    """All where every orientation can be chosen beside a position; one where the tool turns about one direction only
    and the angle can be chosen (a SCARA with a wrist); else none: the orientation follows from the position."""
    lower = [max(joint.lower, -np.pi) for joint in arm.joints]
    upper = [min(joint.upper, np.pi) for joint in arm.joints]
    configurations = np.random.default_rng(1).uniform(lower, upper, (SAMPLES, len(arm.joints)))
    jacobians = [_jacobian(arm, configuration) for configuration in configurations]
    chosen = max(_rank(jacobian) - _rank(jacobian[:3]) for jacobian in jacobians)
    if chosen == 3:
        return ALL_RINGS
    _, values, rows = np.linalg.svd(np.hstack([jacobian[3:] for jacobian in jacobians]).T)
    if chosen != 1 or int(np.sum(values > RANK)) != 1:
        return NO_RINGS
    in_tool = np.abs(_tool(arm, configurations[0])[:, :3].T @ rows[0])
    x, y, z = (in_tool > ALONG).tolist()
    return x, y, z


def _jacobian(arm: Arm, configuration: Array) -> Array:
    """(6, n): the tool's velocity [m/s] above its angular velocity [rad/s], by central differences."""
    columns = []
    for joint in range(len(configuration)):
        offset = STEP * np.eye(len(configuration))[joint]
        ahead, behind = _tool(arm, configuration + offset), _tool(arm, configuration - offset)
        spin = ahead[:, :3] @ behind[:, :3].T
        turn = (spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1])
        columns.append([*(ahead[:, 3] - behind[:, 3]) / (2 * STEP), *np.array(turn) / (4 * STEP)])
    return np.array(columns).T


def _tool(arm: Arm, configuration: Array) -> Array:
    """(3, 4) the tool's axes and its point [m] in the URDF's root."""
    positions = dict(zip(arm.joint_names, configuration.tolist(), strict=True))
    point, turn = link_transforms(arm.model, positions)[arm.tool_frame]
    axes = [rotate(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    return np.array([*axes, point]).T


def _rank(jacobian: Array) -> int:
    return int(np.linalg.matrix_rank(jacobian, tol=RANK))
