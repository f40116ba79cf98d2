"""Self-motion of a redundant arm: its joints go towards the middles of their ranges, the tool stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.kinematics.descent import Descent
from gemelo.services.planner.kinematics.targets import ToolTarget

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
STEPS = 6  # chosen: each is a step of Gauss and Newton, which the later ones hardly move on
LARGEST_STEP = 0.5  # [rad] or [m] chosen: the null space turns with the arm, so it is followed in short steps
LEAST_GAIN = 1e-3  # share of the eccentricity by which a step must improve
RANK = 1e-6  # share of the largest singular value below which a direction of the tool is none


class Centring:
    """Moves solutions of one arm within what leaves the tool where it is to be."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, descent: Descent) -> None:
        self._kinematics = kinematics
        self._descent = descent
        spans = [(joint.lower, joint.upper) for joint in arm.joints]
        is_limited = [bool(np.isfinite(upper - lower)) for lower, upper in spans]
        self._middle = np.array(
            [0.5 * sum(span) if limited else 0.0 for span, limited in zip(spans, is_limited, strict=True)]
        )
        self._weight = np.array([2.0 / (upper - lower) for lower, upper in spans])  # 0 without limits

    def is_redundant(self, target: ToolTarget, solution: Array, idle: int = 0) -> bool:
        """True if the joints can move at `solution` (n,) [rad] or [m] without the tool leaving its target, other than
        those `idle` ones that never move it."""
        return len(self._free_motions(target, solution)) > idle

    def centred(self, target: ToolTarget, solution: Array) -> Array | None:
        """Joint values (n,) [rad] or [m] nearer to the middles of their ranges, reached from `solution` (n,) by
        self-motion; `solution` itself where no self-motion brings them nearer, None where there is none."""
        if self._descent.knows_centring(target):
            return self._descent.centred(target, solution, self._middle, self._weight)
        return self.centred_in_python(target, solution)

    def centred_in_python(self, target: ToolTarget, solution: Array) -> Array | None:
        """`centred` of `solution` (n,) [rad] or [m] where the core is not built or does not know the target."""
        for step_number in range(STEPS):
            motions = self._free_motions(target, solution)
            if not len(motions):
                return solution if step_number else None
            offset = (solution - self._middle) * self._weight
            amounts = np.linalg.lstsq((motions * self._weight).T, -offset, rcond=None)[0]
            step = amounts @ motions
            step *= min(1.0, LARGEST_STEP / max(float(np.abs(step).max()), LARGEST_STEP))
            attempt = self._descent.descend(target, solution + step)
            gained = self.eccentricity(attempt.positions) < (1.0 - LEAST_GAIN) * self.eccentricity(solution)
            if not (attempt.is_solution and gained):
                break
            solution = attempt.positions
        return solution

    def drawn(self, target: ToolTarget, solution: Array, near: Array) -> Array:
        """Joint values (n,) [rad] or [m]: `solution` (n,), moved towards `near` (n,) along its self-motion, which is
        taken as straight."""
        motions = self._free_motions(target, solution)
        moved: Array = solution + (motions @ (near - solution)) @ motions
        return moved

    def eccentricity(self, positions: Array) -> float:
        """Distance of the joint values (n,) [rad] or [m] from the middles of their ranges: a dimensionless sum of
        squares, to which a joint at a limit adds 1 and a joint without limits 0."""
        return float(np.sum(((positions - self._middle) * self._weight) ** 2))

    def _free_motions(self, target: ToolTarget, positions: Array) -> Array:
        """(k, n) orthonormal motions of the joints that leave the tool as it is to be."""
        _, jacobian = target.error_and_jacobian(self._kinematics, positions)
        _, values, rows = np.linalg.svd(jacobian)
        rank = int(np.sum(values > RANK * float(values[0])))
        motions: Array = rows[rank:]
        return motions
