"""Streamed targets: the newest one is approached within the limits, by ruckig one knot at a time."""

from __future__ import annotations

from ruckig import ControlInterface, InputParameter, OutputParameter, Result, Ruckig, Synchronization

from gemelo.schemas.message import Vector
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits

AT_REST = 1e-9  # [rad/s] or [m/s] below which ruckig's own rounding is rest


class TargetTracker:
    """One online generator for all joints, each as fast as it can on its own."""

    def __init__(self, limits: Limits, dt: float, start: Knot) -> None:
        self.dt = dt  # [s] between knots
        self._limits = limits
        self._generator = Ruckig(len(start.position), dt)
        self._input = InputParameter(len(start.position))
        self._output = OutputParameter(len(start.position))
        self._input.synchronization = Synchronization.No
        self._knot = start
        self.target: Vector = start.position
        self.is_braking = False

    @property
    def knot(self) -> Knot:
        """The newest knot."""
        return self._knot

    def follow(self, target: Vector) -> None:
        """Go for `target` [rad] or [m] from now on; within the joint limits, which the caller has checked."""
        self.target = target
        self.is_braking = False

    def brake(self) -> None:
        """Come to rest as soon as the limits allow."""
        self.is_braking = True

    def step(self) -> Knot:
        """The knot after the newest one."""
        limits = self._limits.raised_to(self._knot)
        problem = self._input
        problem.current_position, problem.current_velocity, problem.current_acceleration = self._knot
        problem.max_velocity, problem.max_acceleration, problem.max_jerk = limits
        zeros = (0.0,) * len(self.target)
        problem.target_velocity, problem.target_acceleration = zeros, zeros
        problem.control_interface = ControlInterface.Velocity if self.is_braking else ControlInterface.Position
        problem.target_position = self.target
        result = self._generator.update(problem, self._output)
        if result not in (Result.Working, Result.Finished):
            raise RuntimeError(f"ruckig finds no way from {self._knot} to {self.target}: {result}")
        output = self._output
        self._knot = _settled(
            Knot(tuple(output.new_position), tuple(output.new_velocity), tuple(output.new_acceleration))
        )
        return self._knot


def _settled(knot: Knot) -> Knot:
    """Rest is rest to the last bit, so that a stream can end on it."""
    if any(abs(v) > AT_REST for v in knot.velocity) or any(abs(a) > 1e-6 for a in knot.acceleration):
        return knot
    return Knot.at_rest(knot.position)
