"""Inverse kinematics for any arm: damped least squares within the joint limits, from many deterministic starts.

One descent is Levenberg and Marquardt's, with the joints that press against a limit left out of the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm, Joint
from services.arm.kinematics import Kinematics
from services.planner.targets import Target

Array = NDArray[np.float64]

STARTS = 24  # beside the present posture
BATCH = 4  # starts that are tried together before their solutions are handed out
ITERATIONS = 40
STALL = 1e-5  # share of the squared error by which an iteration must improve
LARGEST_STEP = 0.8  # [rad] or [m] a joint may move in one iteration
SAME = 1e-4  # [s] at full speed: solutions nearer than that are one
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19)


@dataclass(frozen=True)
class Attempt:
    """Where one descent ended: joint values (n,), and how far the tool is from its target."""

    positions: Array
    error: float  # [m], turns weighted in
    is_solution: bool


class InverseKinematics:
    """Joint values for tool targets."""

    def __init__(self, arm: Arm, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self._lower, self._upper = np.array([_one_turn(joint) for joint in arm.joints]).T
        self._bounds = np.array([[j.lower for j in arm.joints], [j.upper for j in arm.joints]])
        self._speed = np.array([joint.velocity for joint in arm.joints])
        self._identity = np.eye(len(arm.joints))
        self._starts = [self._spread(index) for index in range(1, STARTS + 1)]

    def solutions(self, target: Target, near: Array, is_late: Callable[[], bool]) -> Iterator[Array]:
        """Distinct joint values that meet the target: what `near` leads to, then batches, each nearest first."""
        first = self.descend(target, near)
        found = [first.positions] if first.is_solution else []
        yield from found
        attempts = self._attempts(target, near, is_late)
        while batch := list(islice(attempts, BATCH)):
            new: list[Array] = []
            for attempt in batch:
                if attempt.is_solution and all(self.travel(attempt.positions, other) > SAME for other in found):
                    found.append(attempt.positions)
                    new.append(attempt.positions)
            yield from sorted(new, key=lambda positions: self.travel(near, positions))

    def nearest(self, target: Target, near: Array, is_late: Callable[[], bool]) -> list[Array]:
        """Postures that bring the tool as near to the target as their start allows, the best one first."""
        attempts = [self.descend(target, near), *self._attempts(target, near, is_late)]
        return [attempt.positions for attempt in sorted(attempts, key=lambda attempt: attempt.error)]

    def travel(self, first: Array, second: Array) -> float:
        """[s] that the slowest joint takes between two postures at full speed: the distance that counts."""
        return float(np.max(np.abs(first - second) / self._speed))

    def descend(self, target: Target, start: Array) -> Attempt:
        """The nearest local optimum from `start`."""
        positions = np.clip(start, self._bounds[0], self._bounds[1])
        error, jacobian = target.error_and_jacobian(self._kinematics, positions)
        cost, damping = float(error @ error), 1e-6
        for _ in range(ITERATIONS):
            if target.is_met(error):
                break
            pull = error @ jacobian
            free = self._is_free(positions, pull)
            if not free.any() or float(np.abs(pull[free]).max()) < 1e-10:
                break
            trial = self._step(positions, jacobian, pull, free, damping)
            trial_error, trial_jacobian = target.error_and_jacobian(self._kinematics, trial)
            trial_cost = float(trial_error @ trial_error)
            if trial_cost < cost:
                has_stalled = trial_cost > cost * (1.0 - STALL)
                positions, error, jacobian, cost = trial, trial_error, trial_jacobian, trial_cost
                damping = max(damping * 0.1, 1e-12)
                if has_stalled:
                    break
            else:
                damping *= 10.0
                if damping > 1e4:
                    break
        return Attempt(positions, math.sqrt(cost), target.is_met(error))

    def _is_free(self, positions: Array, pull: Array) -> NDArray[np.bool_]:
        """The joints that no limit holds back."""
        above, below = positions > self._bounds[0], positions < self._bounds[1]
        free: NDArray[np.bool_] = (above | (pull > 0.0)) & (below | (pull < 0.0))
        return free

    def _step(self, positions: Array, jacobian: Array, pull: Array, free: NDArray[np.bool_], damping: float) -> Array:
        active = jacobian if free.all() else jacobian * free
        step = np.linalg.solve(active.T @ active + damping * self._identity, pull * free)
        longest = float(np.abs(step).max())
        if longest > LARGEST_STEP:
            step *= LARGEST_STEP / longest
        trial: Array = np.minimum(np.maximum(positions + step, self._bounds[0]), self._bounds[1])
        return trial

    def _attempts(self, target: Target, near: Array, is_late: Callable[[], bool]) -> Iterator[Attempt]:
        """Descents from starts spread over the limits; the first few lie around `near`."""
        for index, spread in enumerate(self._starts):
            if is_late():
                return
            start = near + 0.25 * (spread - 0.5 * (self._lower + self._upper)) if index < 4 else spread
            yield self.descend(target, start)

    def _spread(self, index: int) -> Array:
        """The index-th point of Halton's sequence within the limits."""
        share = np.array([_radical_inverse(index, _PRIMES[i % len(_PRIMES)]) for i in range(len(self._lower))])
        point: Array = self._lower + share * (self._upper - self._lower)
        return point


def _one_turn(joint: Joint) -> tuple[float, float]:
    """Where starts are spread [rad] or [m]: the limits, or the turn nearest to zero within wider ones."""
    if joint.upper - joint.lower <= math.tau:
        return joint.lower, joint.upper
    middle = min(max(0.0, joint.lower + math.pi), joint.upper - math.pi)
    return middle - math.pi, middle + math.pi


def _radical_inverse(index: int, base: int) -> float:
    """The digits of `index` in `base`, mirrored at the point (van der Corput)."""
    value, weight = 0.0, 1.0 / base
    while index:
        index, digit = divmod(index, base)
        value += digit * weight
        weight /= base
    return value
