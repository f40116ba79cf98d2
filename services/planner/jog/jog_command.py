"""Joint velocities for a jog command, within the joints' velocity limits alone; where the jog begins."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.control import ControlState
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand, JogLimit
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.jog.jog_limits import no_command, singularity, speed_limit
from gemelo.services.planner.jog.twist import TwistSolver
from gemelo.services.planner.request.refusals import PlanRefused
from gemelo.services.planner.request.start_state import resolve_start

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
FASTEST_TWIST = 1e3  # [m/s] and [rad/s]: more is as absurd, and loses its digits


class BadJog(ReasonedError, ValueError):
    """A command that cannot be followed; the reason names the thing and the remedy."""


@dataclass(frozen=True)
class DesiredVelocity:
    """(n,) [rad/s] or [m/s] within the limits, the share of the commanded speed that it is, and what took the rest."""

    velocity: Array
    scale: float = 1.0
    limits: tuple[JogLimit, ...] = ()
    is_twist: bool = False


class JogInterpreter:
    """Reads the commands for one arm."""

    def __init__(self, kinematics: Kinematics) -> None:
        self._arm = kinematics.arm
        self._kinematics = kinematics
        self.twists = TwistSolver(kinematics)
        self._speeds = np.array([joint.velocity for joint in self._arm.joints])

    def wanted(self, command: JogCommand, positions: Array) -> DesiredVelocity:
        """The joint velocities [rad/s] or [m/s] of the command, for the arm at `positions` (n,) [rad] or [m]; raises
        `BadJog`."""
        has_twist = bool(command.linear or command.angular)
        if command.name and has_twist:
            raise BadJog(because("jog.command.both", remedy("one_of_both")))
        return self._of_twist(command, positions) if has_twist else self._of_joints(command)

    def _of_joints(self, command: JogCommand) -> DesiredVelocity:
        names = self._arm.joint_names
        if len(command.name) != len(command.velocity):
            counts = {"joints": len(command.name), "velocities": len(command.velocity)}
            raise BadJog(because("jog.command.count", **counts))
        velocity = np.zeros(len(names))
        for name, value in zip(command.name, command.velocity, strict=True):
            if name not in names:
                raise BadJog(because("jog.command.unknown", nearest(name, names), robot=self._arm.name, joint=name))
            if command.name.count(name) > 1:
                raise BadJog(because("jog.command.twice", joint=name))
            velocity[names.index(name)] = value
        return self._clamped(velocity, 1.0, ())

    def _of_twist(self, command: JogCommand, positions: Array) -> DesiredVelocity:
        twist = self._in_base(command, positions)
        notes: tuple[JogLimit, ...] = ()
        if not self.twists.turns and np.any(twist[3:]):
            notes = (no_command(because("jog.command.no_turn", robot=self._arm.name)),)
            twist[3:] = 0.0
        if not np.any(twist):
            return DesiredVelocity(np.zeros(len(self._speeds)), limits=notes)
        motion = self.twists.solve(positions, twist)
        if motion.scale < 1.0:
            notes = (*notes, singularity(motion.regularity))
        return replace(self._clamped(motion.velocity, motion.scale, notes), is_twist=True)

    def _in_base(self, command: JogCommand, positions: Array) -> Array:
        """(6,) along the base's axes."""
        for part, values in (("linear", command.linear), ("angular", command.angular)):
            if len(values) not in (0, 3):
                raise BadJog(because("jog.command.values", part=part, count=len(values)))
        twist = np.array([*(command.linear or (0.0,) * 3), *(command.angular or (0.0,) * 3)])
        twist *= min(1.0, FASTEST_TWIST / max(FASTEST_TWIST, float(np.max(np.abs(twist)))))
        frames = (self._arm.base_frame, self._arm.tool_frame)
        if command.frame in ("", self._arm.base_frame):
            return twist
        if command.frame != self._arm.tool_frame:
            raise BadJog(because("jog.command.frame", remedy("use_one_of", names=frames), frame=command.frame))
        rotation = self._kinematics.tool(positions).rotation
        return np.concatenate((rotation @ twist[:3], rotation @ twist[3:]))

    def _clamped(self, velocity: Array, scale: float, notes: tuple[JogLimit, ...]) -> DesiredVelocity:
        """All joints slowed together until the last one keeps its limit."""
        shares = np.abs(velocity) / self._speeds
        worst = int(np.argmax(shares))
        most = float(shares[worst])
        if most <= 1.0:
            return DesiredVelocity(velocity, scale, notes)
        limit = speed_limit(self._arm.joints[worst], float(velocity[worst]))
        return DesiredVelocity(velocity / most, scale / most, (*notes, limit))


class JogRefused(ReasonedError, ValueError):
    """The arm cannot be jogged now; the reason says why and what would do."""


def standing_position(arm: ArmDescription, present: JointState | None, age: float) -> tuple[float, ...]:
    """[rad] or [m] in the arm's order, of an arm that stands; raises `JogRefused`."""
    try:
        return resolve_start(arm, None, present, age)
    except PlanRefused as refused:
        raise JogRefused(refused.refusal.why or refused.refusal.message) from refused


def objection(control: ControlState | None, writer: str) -> Reason | None:
    """Why `writer` may not move the arm by hand; None if it may."""
    if control is None or not control.held or writer in control.members:
        return None
    holder = {"name": control.name, "node": control.node, "host": control.host}
    return because("jog.control", remedy("who_holds"), **holder)
