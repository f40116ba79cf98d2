"""Inverse kinematics in closed form for arms that EAIK can decompose (Ostermeier, Külz, Althoff 2025, RA-L 10(10)).

The arm is given to it as the axes of its joints at zero, read from the kinematics, and is held against them.
"""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.kinematics.joint_ranges import FullTurns
from gemelo.services.planner.kinematics.targets import POSITION_TOLERANCE, ROTATION_TOLERANCE, ToolTarget, any_normal

if TYPE_CHECKING:
    from eaik.pybindings.EAIK import Robot

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
JOINTS = 6  # with fewer, EAIK answers positions or pairs of turns only
SAMPLES = 8  # configurations at which EAIK's forward kinematics is held against ours
AGREEMENT = 1e-9  # [m], and per entry of the rotation; chosen: rounding of six joints, a hundred times over
IDENTITY = np.eye(4)

log = logging.getLogger(__name__)


class ClosedForm:
    """All configurations of one arm for a full tool pose; joint values are (n,) [rad] in the arm's order."""

    def __init__(self, arm: ArmDescription, robot: Robot, order: list[int]) -> None:
        self._robot = robot
        self._places = np.argsort(order)  # of the arm's joints, from the base to the tool
        self.turns = FullTurns(arm)

    def configurations(self, position: Array, rotation: Array, near: Array) -> tuple[Array, list[Array]]:
        """Exact solutions (m, n) [rad] within the limits, with every full turn, in no order; and EAIK's least-squares
        ones, (n,) each.

        `position` (3,) [m] and `rotation` (3, 3) are the tool's in the base frame; joints without limits stay near
        `near` (n,). Least-squares solutions are out of reach, or, where axes coincide, lack one turn.
        """
        branches, is_guess = self.branches(position, rotation)
        if not is_guess.any():
            return self.turns.within_limits(branches, near), []
        return self.turns.within_limits(branches[~is_guess], near), [
            *branches[is_guess & np.isfinite(branches).all(axis=1)]
        ]

    def branches(self, position: Array, rotation: Array) -> tuple[Array, NDArray[np.bool_]]:
        """EAIK's solutions (m, n) [rad], whatever the limits, and (m,) True for those that are least squares only.

        `position` (3,) [m] and `rotation` (3, 3) are the tool's in the base frame.
        """
        pose = IDENTITY.copy()
        pose[:3, :3], pose[:3, 3] = rotation, position
        answer = self._robot.calculate_IK(pose)
        branches = answer.Q.take(self._places, axis=1)
        return branches, np.array(answer.is_LS, dtype=bool)


def closed_form(arm: ArmDescription, kinematics: Kinematics) -> ClosedForm | None:
    """The arm's closed form, or None where it has none or EAIK is not there."""
    if len(arm.joints) != JOINTS or any(joint.unit != "rad" for joint in arm.joints):
        return None
    try:
        from eaik.pybindings.EAIK import Robot  # slow to load
    except ImportError as error:
        log.warning(f"no inverse kinematics in closed form, it is searched for instead: {error}")
        return None
    order = chain_order(arm)
    pose, jacobian = kinematics.tool_and_jacobian(np.zeros(JOINTS))
    axes = jacobian[3:, order].T
    if not np.allclose(np.linalg.norm(axes, axis=1), 1.0, atol=AGREEMENT):
        return None  # a mimic turns with one of them
    # With v the tool point's velocity when a joint turns at 1 rad/s: tool + axis x v lies on the joint's axis.
    on_axes = pose.position + np.cross(axes, jacobian[:3, order].T)
    ways = np.diff(np.vstack((np.zeros(3), on_axes, pose.position)), axis=0)
    robot = Robot(axes.T, ways.T, pose.rotation, [], True)
    if not robot.has_known_decomposition() or not _agrees(arm, kinematics, robot, order):
        return None
    return ClosedForm(arm, robot, order)


def turns_about(direction: Array, axis: Array, rotation: Array, count: int) -> list[Array]:
    """`count` rotations (3, 3), evenly spread, that bring the tool's unit `axis` (3,) along the unit `direction` (3,)
    in the base frame.

    The first one keeps the tool's present `rotation` (3, 3) about it as well as it can.
    """
    across = any_normal(axis)
    wanted = rotation @ across
    wanted = wanted - direction * float(direction @ wanted)
    length = float(np.linalg.norm(wanted))
    wanted = any_normal(direction) if length < 1e-6 else wanted / length
    tool = np.column_stack((axis, across, np.cross(axis, across)))
    side = np.cross(direction, wanted)
    turns = (math.tau * index / count for index in range(count))
    firsts = (math.cos(turn) * wanted + math.sin(turn) * side for turn in turns)
    return [np.column_stack((direction, first, np.cross(direction, first))) @ tool.T for first in firsts]


def chain_order(arm: ArmDescription) -> list[int]:
    """The arm's joints as they follow one another from the base to the tool."""
    by_child = {joint.child: joint for joint in arm.model.joints}
    link, names = arm.tool_frame, []
    while link in by_child:
        names.append(by_child[link].name)
        link = by_child[link].parent
    known = {name: index for index, name in enumerate(arm.joint_names)}
    chain = [known[name] for name in reversed(names) if name in known]
    return chain + [index for index in range(len(arm.joints)) if index not in chain]


def _agrees(arm: ArmDescription, kinematics: Kinematics, robot: Robot, order: list[int]) -> bool:
    """True if EAIK's forward kinematics is ours."""
    for values in np.random.default_rng(1).uniform(-math.pi, math.pi, (SAMPLES, JOINTS)):
        ours, theirs = kinematics.tool(values), robot.fwdkin(values[order])
        if max(np.abs(theirs[:3, 3] - ours.position).max(), np.abs(theirs[:3, :3] - ours.rotation).max()) > AGREEMENT:
            return False
    return True


def completed(target: ToolTarget, kinematics: Kinematics, guess: Array) -> list[Array]:
    """Joint values (n,) [rad] or [m]: `guess` (n,) with the missing turn of the tool made by one joint; empty if more
    is missing.

    Each joint that can make it gives one result. A configuration that is out of reach has its orientation right and its
    position wrong, and is rejected first.
    """
    far, away = target.misses(kinematics.tool(guess))
    if away < ROTATION_TOLERANCE:
        return [guess] if far < POSITION_TOLERANCE else []
    pose, jacobian = kinematics.tool_and_jacobian(guess)
    missing = target.turn(pose.rotation)
    found = []
    for joint, axis in enumerate(jacobian[3:].T):
        amount = float(axis @ missing)
        if float(np.linalg.norm(missing - amount * axis)) < ROTATION_TOLERANCE:
            turned = guess.copy()
            turned[joint] += amount
            far, away = target.misses(kinematics.tool(turned))
            if far < POSITION_TOLERANCE and away < ROTATION_TOLERANCE:
                found.append(turned)
    return found
