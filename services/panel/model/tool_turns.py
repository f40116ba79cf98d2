"""Along and about which of its own axes an arm's tool can be moved: the arrows and the rings of the gizmo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import rotate
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription

Array = NDArray[np.float64]
Rings = tuple[bool, bool, bool]  # about the tool's x, y and z

NO_RINGS: Rings = (False, False, False)
ALL_RINGS: Rings = (True, True, True)
# Tuning constants: chosen, where a line does not say measured or standard.
SAMPLES = 8  # configurations; those at a stretch do not hide what others can
STEP = 1e-5  # [rad] or [m] of the finite differences
RANK = 1e-4  # share of the largest singular value below which a direction is none: above the differences' error
MISSED = 0.01  # of a twist of length one: what is missed of a direction that cannot be is several times that


@dataclass(frozen=True)
class ToolTurns:
    """What the gizmo may offer of an arm's tool."""

    rings: Rings
    keeps_orientation: (
        bool  # along every axis the tool can be moved without being turned; else arrows lead its place only
    )
    arrows: Rings = ALL_RINGS  # along the tool's x, y and z, however it is turned meanwhile
    along_base: Rings = ALL_RINGS  # along the base's


def tool_turns(arm: ArmDescription) -> ToolTurns:
    """A ring about each of the tool's axes about which it can be turned wherever it is, while its place stays: all
    three with six joints, the last joint's own with five, the vertical one of a SCARA with a wrist.

    An arrow along each axis along which it can be moved: all three but for arms in one plane. An arm with none, as one
    of two joints that tilts and pans, gets all of them, and its person the nearest that can.
    """
    lower = [max(joint.lower, -np.pi) for joint in arm.joints]
    upper = [min(joint.upper, np.pi) for joint in arm.joints]
    samples = np.random.default_rng(1).uniform(lower, upper, (SAMPLES, len(arm.joints)))
    jacobians = [_jacobian(arm, configuration) for configuration in samples]
    axes = [_tool(arm, configuration)[:, :3] for configuration in samples]
    pairs = list(zip(jacobians, axes, strict=True))
    x, y, z = (
        all(_can(jacobian, np.concatenate([np.zeros(3), tool[:, axis]])) for jacobian, tool in pairs)
        for axis in range(3)
    )
    keeps = all(_can(jacobian, direction) for jacobian in jacobians for direction in np.eye(6)[:3])
    arrows = _arrows([(jacobian, tool) for jacobian, tool in pairs])
    return ToolTurns((x, y, z), keeps, arrows, _arrows([(jacobian, np.eye(3)) for jacobian in jacobians]))


def _arrows(samples: list[tuple[Array, Array]]) -> Rings:
    """Along which of its axes (3, 3), the columns, each of the Jacobians can move the tool."""
    x, y, z = (all(_can(jacobian[:3], axes[:, axis]) for jacobian, axes in samples) for axis in range(3))
    return (x, y, z) if x or y or z else ALL_RINGS


def _can(jacobian: Array, twist: Array) -> bool:
    """True if some joint velocities give the tool this twist (6,), [m/s] above [rad/s], or this velocity (3,)."""
    velocities = np.linalg.lstsq(jacobian, twist, rcond=RANK)[0]
    return float(np.linalg.norm(jacobian @ velocities - twist)) < MISSED


def _jacobian(arm: ArmDescription, configuration: Array) -> Array:
    """(6, n): the tool's velocity [m/s] above its angular velocity [rad/s], by central differences."""
    columns = []
    for joint in range(len(configuration)):
        offset = STEP * np.eye(len(configuration))[joint]
        ahead, behind = _tool(arm, configuration + offset), _tool(arm, configuration - offset)
        spin = ahead[:, :3] @ behind[:, :3].T
        turn = (spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1])
        columns.append([*(ahead[:, 3] - behind[:, 3]) / (2 * STEP), *np.array(turn) / (4 * STEP)])
    return np.array(columns).T


def _tool(arm: ArmDescription, configuration: Array) -> Array:
    """(3, 4) the tool's axes and its point [m] in the URDF's root."""
    positions = dict(zip(arm.joint_names, configuration.tolist(), strict=True))
    point, turn = link_transforms(arm.model, positions)[arm.tool_frame]
    axes = [rotate(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    return np.array([*axes, point]).T
