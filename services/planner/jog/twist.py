"""Joint velocities for a twist of the tool: damped least squares.

The damping is that of Nakamura and Hanafusa (1986), by the manipulability. The columns are scaled by the joints'
velocity limits, so that every singular value is a speed [m/s] that the tool can have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SAMPLES = 64  # configurations that tell what is much for this arm
RANK = 1e-6  # [m/s] below which a direction is none; chosen: far above rounding of the Jacobian
NEAR = 0.1  # share of the largest manipulability below which a singularity is near
DAMPING = 0.2  # at a singularity: share of the smallest singular value that the arm usually has
STRAIGHT, CROOKED = 0.99, 0.90  # cosines to the commanded twist: full speed, and none
LOOK_AHEAD = 0.02  # [s] chosen: one period of the jog
NOISE = 1e-6  # of the near manipulability, which is no approach; chosen: above rounding of the singular values
LEAST = 0.1  # of the near manipulability, at which the tool stops on its way to a singularity
PLACES = np.linspace(0.25, 1.0, 4)[:, None]  # of a path to rest that are looked at


@dataclass(frozen=True)
class ToolMotion:
    """(n,) [rad/s] or [m/s], already slowed by `scale`; 1 far from singularities.

    `regularity` is the manipulability as a share of the one at which slowing begins.
    """

    velocity: Array
    scale: float
    regularity: float


class TwistSolver:
    """For one arm; an arm that cannot turn its tool as it likes has the linear part only."""

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        joints = kinematics.arm.joints
        self._speeds = np.array([joint.velocity for joint in joints])
        lower = np.array([max(joint.lower, -np.pi) for joint in joints])
        upper = np.array([min(joint.upper, np.pi + max(joint.lower, -np.pi)) for joint in joints])
        configurations = np.random.default_rng(1).uniform(lower, np.maximum(lower, upper), (SAMPLES, len(joints)))
        self._length = self._tool_arm(configurations)
        self._rows = 6
        if len(joints) < 6 or self._values(configurations)[:, -1].max() < RANK:
            self._rows = 3
        values = self._values(configurations)
        self._near = NEAR * max(float(values.prod(axis=1).max()), RANK**self._rows)
        self._damping = DAMPING * float(np.median(values[:, -1]))

    @property
    def turns(self) -> bool:
        """True if the angular part counts."""
        return self._rows == 6

    def manipulability(self, positions: Array) -> float:
        """Yoshikawa's (1985) at joint values (n,) [rad] or [m]: the square root of det(J J^T), of the rows that count,
        without weights."""
        jacobian = self._kinematics.jacobian(positions)[: self._rows]
        return float(np.sqrt(max(0.0, np.linalg.det(jacobian @ jacobian.T))))

    def solve(self, positions: Array, twist: Array) -> ToolMotion:
        """`twist` (6,) [m/s] and [rad/s] of the tool along the base's axes."""
        wanted = self._weighed(twist)
        left, values, right = np.linalg.svd(self._scaled(positions), full_matrices=False)
        share = float(values.prod()) / self._near
        damping = self._damping * max(0.0, 1.0 - share)
        shares = values / (values * values + damping * damping + 1e-18)
        motion = right.T @ (shares * (left.T @ wanted))
        velocity = self._speeds * motion
        if share >= 1.0:
            return ToolMotion(velocity, 1.0, share)
        scale = _straightness(wanted, left @ (values * (right @ motion)))
        reached = velocity * min(1.0, 1.0 / max(1e-9, float(np.max(np.abs(motion)))))
        ahead = float(self._values([positions + LOOK_AHEAD * reached])[0].prod()) / self._near
        if ahead < share - NOISE:
            scale *= share
        return ToolMotion(scale * velocity, scale, share)

    def singularity_on(self, positions: Array, displacement: Array) -> float | None:
        """The regularity where the arm is, if a path (n,) [rad] or [m] comes too near to a singularity, else None.

        Going along one or away is allowed.
        """
        shares = self._signed(np.vstack((positions, positions + PLACES * displacement))) / self._near
        shares = np.abs(shares) if abs(shares[0]) <= NOISE else shares * np.sign(shares[0])
        return None if shares[1:].min() >= min(LEAST, shares[0] - NOISE) else abs(float(shares[0]))

    def _signed(self, configurations: Array) -> Array:
        """(m,) manipulabilities; of a square Jacobian with the sign, which is another beyond a singularity."""
        if len(self._speeds) == self._rows:
            determinants: Array = np.linalg.det(
                np.array([self._scaled(configuration) for configuration in configurations])
            )
            return determinants
        volumes: Array = self._values(configurations).prod(axis=1)
        return volumes

    def _weighed(self, twist: Array) -> Array:
        weighed = twist[: self._rows].copy()
        weighed[3:] *= self._length
        return weighed

    def _scaled(self, positions: Array) -> Array:
        jacobian: Array = self._kinematics.jacobian(positions)[: self._rows] * self._speeds
        jacobian[3:] *= self._length
        return jacobian

    def _values(self, configurations: Sequence[Array] | Array) -> Array:
        """(m, rows) singular values, the largest first."""
        values: Array = np.linalg.svd(
            np.array([self._scaled(configuration) for configuration in configurations]), compute_uv=False
        )
        return values

    def _tool_arm(self, configurations: Array) -> float:
        """[m] by which a turn weighs as much as a path: half of how far the tool gets from the base."""
        return 0.5 * max(
            float(np.linalg.norm(self._kinematics.tool(configuration).position)) for configuration in configurations
        )


def _straightness(wanted: Array, gotten: Array) -> float:
    """1 where the tool goes where it is to go, 0 where it would stray."""
    sizes = float(np.linalg.norm(wanted) * np.linalg.norm(gotten))
    if sizes < 1e-15:
        return 0.0
    return min(1.0, max(0.0, (float(wanted @ gotten) / sizes - CROOKED) / (STRAIGHT - CROOKED)))
