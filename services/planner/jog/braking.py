"""Limits on the change of all joint velocities together, and the configuration in which the arm comes to rest.

Braking is as gentle as the gateway's jerk limit: a joint slows by `speed / (d'(speed) + dt)` at most, where d is its
jerk-limited path to rest. Then the place where it would come to rest never moves back from one period to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
# The gateway tracks a target at the full acceleration: what asks for a little less is followed, not chased.
ACCELERATION_SHARE = 0.8
LAST = 0.05  # of the rate that the jerk limit reaches in a period
PIECES = 16  # of the integral over the speeds between now and rest


class Braking:
    """The limits of one arm, in periods of `dt` [s]; velocities are (n,) or (m, n) [rad/s] or [m/s]."""

    def __init__(self, arm: ArmDescription, dt: float) -> None:
        self.dt = dt
        self.velocity: Array = np.array([joint.velocity for joint in arm.joints])
        self.acceleration: Array = ACCELERATION_SHARE * np.array([joint.acceleration for joint in arm.joints])
        self.lower: Array = np.array([joint.lower for joint in arm.joints])
        self.upper: Array = np.array([joint.upper for joint in arm.joints])
        self._full = np.array([joint.acceleration for joint in arm.joints])
        self._jerk = np.array([joint.jerk for joint in arm.joints])
        self._shares = np.arange(1, PIECES + 1)[:, None] / PIECES

    def towards(self, present: Array, wanted: Array) -> Array:
        """The velocity (n,) or (m, n) [rad/s] or [m/s] after a period on the straight line from `present` to `wanted`.

        All joints change in proportion, so that braking keeps the direction of the motion.
        """
        change = wanted - present
        rates = np.where(change * present < 0.0, self._braking_rates(np.abs(present)), self.acceleration)
        needed = np.max(np.abs(change) / rates, axis=-1, keepdims=True) / self.dt
        after: Array = np.where(needed <= 1.0, wanted, present + change / np.maximum(needed, 1.0))
        return after

    def together(self, velocity: Array) -> Array:
        """[rad] or [m] that braking with `towards` takes at most, all joints at rest at one time.

        With v the share of the velocity that is left and t its time constant, dv/dt = -v/t: the path is the integral of
        t over v from 0 to 1, summed from above.
        """
        speeds = self._shares * np.abs(velocity)[..., None, :]
        constants = self._time_constants(speeds).max(axis=-1)
        displacement: Array = constants.mean(axis=-1, keepdims=True) * velocity
        return displacement

    def displacement_to_rest(self, velocity: Array) -> Array:
        """[rad] or [m] with the period that is about to come."""
        displacement: Array = self.dt * velocity + self.together(velocity)
        return displacement

    def alone(self, velocity: Array) -> Array:
        """(n,) [rad] or [m] until each joint has come to rest as fast as it can: never farther than `together`."""
        speed = np.abs(velocity)
        fast = 0.5 * (speed / self._full + self._full / self._jerk)
        times: Array = np.where(speed > self._full**2 / self._jerk, fast, np.sqrt(speed / self._jerk))
        return times * velocity

    def _time_constants(self, speed: Array) -> Array:
        """[s] each: speed through the rate at which a joint slows."""
        fast = speed / self._full + 0.5 * self._full / self._jerk
        gentle = np.where(speed > self._full**2 / self._jerk, fast, 1.5 * np.sqrt(speed / self._jerk))
        constants: Array = np.maximum(gentle, speed / self.acceleration) + self.dt
        return constants

    def _braking_rates(self, speed: Array) -> Array:
        """[rad/s^2] or [m/s^2]; the last trace of speed is given up at once."""
        rates: Array = np.maximum(speed / self._time_constants(speed), LAST * self._jerk * self.dt)
        return rates
