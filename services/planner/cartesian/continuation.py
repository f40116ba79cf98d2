"""Joint values along a path of the tool, each from the one before; where they end, and why they go no further."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.cartesian.tool_path import ToolPath
from gemelo.services.planner.cartesian.tool_solver import ToolSolver
from gemelo.services.planner.path.path_curve import CubicSpline
from gemelo.services.planner.request.deadline import Deadline

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SPACING = 0.02  # of length between configurations; halved until the spline between them is exact enough
LEAST_CONFIGURATIONS = 12  # chosen: a spline through fewer says little about how exact it is
FINEST = 2e-5  # of length: nearer configurations are not tried, and a place is not told more exactly
MOST_CONFIGURATIONS = 5000  # chosen: a second or so of solving; more is a mistake in max_step
JUMP = 0.3  # [rad] or [m] a joint may move between two configurations, before shorter steps are tried
CLOSE = 1e-5  # [m] by which the spline between configurations may be off the path
NEARLY = 0.98  # of the path to a limit, as it seems from before it
LEAST = 0.05  # of a step is tried, where it seems to be none of it
ROUNDING = 1e-9  # [rad] or [m] beyond a limit that is put back onto it
SAME = 1e-6  # [rad] or [m] by which configurations differ that are meant to be one
ROUNDS = 8  # chosen: each halves the spacing where needed, so 1/256 of it at last
LOOKS = 8  # at the joints' limits between two configurations; chosen: a spline bends little between them
ORDER = 4  # configurations by which the next one is guessed; chosen: more extrapolate noise


@dataclass(frozen=True)
class StopReason:
    """What is in the way of the next configuration; `subject` is a joint, a link pair or the tool.

    About `share` of the step to it can be gone.
    """

    check: str
    subject: str
    value: float
    limit: float
    why: Reason
    share: float = 0.5


@dataclass(frozen=True)
class FollowedPath:
    """Configurations (m, n) at lengths (m,) of a path, from its start, the spline through them with the tool's position
    (3,) behind the joints, and why there are no more."""

    lengths: Array
    configurations: Array
    curve: CubicSpline
    stop: StopReason | None


class Continuation:
    """Follows paths of the tool with one arm; of an arm that cannot turn its tool freely only the position is held."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, holds_turn: bool) -> None:
        self._arm, self._kinematics = arm, kinematics
        self.solver = ToolSolver(kinematics, holds_turn)
        self._lower = np.array([joint.lower for joint in arm.joints])
        self._upper = np.array([joint.upper for joint in arm.joints])

    def follow(
        self, path: ToolPath, start: Array, max_step: float, jump: float, deadline: Deadline
    ) -> FollowedPath | StopReason:
        """Joint values along `path` from `start` (n,) [rad] or [m] at its beginning, up to the first `StopReason`.

        `max_step` [m] of path length and `jump` [rad] or [m] of a joint between two configurations: 0 for the defaults.
        The result is a `StopReason` where the path can be followed for less than four of the finest spacings.
        """
        spacing = min(max_step or SPACING, path.length / LEAST_CONFIGURATIONS)
        if path.length / spacing > MOST_CONFIGURATIONS:
            why = because("plan.tool.max_step", remedy("leave_zero"), value=max_step, most=MOST_CONFIGURATIONS)
            return StopReason("max_step", "max_step", max_step, path.length / MOST_CONFIGURATIONS, why)
        lengths, configurations, stop = self._march(path, start, spacing, jump, deadline)
        if stop is not None and lengths[-1] < 4 * FINEST:
            return stop
        if len(lengths) < 4:
            lengths, configurations = self._four(path, lengths, configurations)
        return self._refined(path, lengths, configurations, stop, deadline)

    def shortened(
        self, path: ToolPath, followed: FollowedPath, length: float, stop: StopReason, deadline: Deadline
    ) -> FollowedPath | StopReason:
        """The followed path up to `length` [m] from its start, with `stop` as the reason for its end."""
        kept = int(np.searchsorted(followed.lengths, length - FINEST))
        guess = followed.curve.at(np.array([length])).value[0, : followed.configurations.shape[1]]
        last = self.solver.solve(path.at(length), guess)
        lengths = [*followed.lengths[:kept].tolist(), length]
        configurations = [*followed.configurations[:kept], self._clipped(guess if last is None else last)]
        if len(lengths) < 4:
            lengths, configurations = self._four(path, lengths, configurations)
        return self._refined(path, lengths, configurations, stop, deadline)

    def ending(self, followed: FollowedPath, end: Array) -> FollowedPath:
        """The same path, with `end` (n,) [rad] or [m] as its last configuration if it leads there but for rounding."""
        if not is_same(followed.configurations[-1], end):
            return followed
        configurations = np.vstack((followed.configurations[:-1], end))
        curve = self._spline(followed.lengths.tolist(), list(configurations))
        return FollowedPath(followed.lengths, configurations, curve, followed.stop)

    def _march(
        self, path: ToolPath, start: Array, spacing: float, jump: float, deadline: Deadline
    ) -> tuple[list[float], list[Array], StopReason | None]:
        lengths, configurations, step, marks = [0.0], [start], spacing, [*path.marks, path.length]
        while lengths[-1] < path.length:
            deadline.check()
            ahead = lengths[-1] + step
            mark = next(mark for mark in marks if mark > lengths[-1] + FINEST or mark == path.length)
            ahead = mark if ahead > mark - 0.1 * step else ahead
            guess = _extrapolated(lengths, configurations, ahead)
            found = self._next(path.at(ahead), configurations[-1], guess, jump or math.inf)
            if not isinstance(found, StopReason) and len(lengths) < MOST_CONFIGURATIONS:
                lengths.append(ahead)
                configurations.append(found)
                step = min(2.0 * step, spacing)
            elif step > FINEST and len(lengths) < MOST_CONFIGURATIONS and not _is_jump(found):
                share = found.share if isinstance(found, StopReason) else 0.5
                step = max(0.999 * FINEST, min(0.9 * step, share * (ahead - lengths[-1])))
            else:
                return (
                    lengths,
                    configurations,
                    found if isinstance(found, StopReason) else self._lost(configurations[-1]),
                )
        return lengths, configurations, None

    def _next(self, pose: FramePose, last: Array, guess: Array, jump: float) -> Array | StopReason:
        found = self.solver.solve(pose, guess)
        if found is None:
            return self._lost(last)
        excess = np.maximum(found - self._upper, self._lower - found)
        worst = int(np.argmax(excess))
        if excess[worst] > ROUNDING:
            return self._beyond(worst, last, found)
        farthest = float(np.abs(found - last).max())
        if farthest > jump:
            return self._jump("jump", last, found, jump)
        return self._jump("singularity", last, found, JUMP) if farthest > JUMP else self._clipped(found)

    def _four(
        self, path: ToolPath, lengths: list[float], configurations: list[Array]
    ) -> tuple[list[float], list[Array]]:
        """What a cubic spline needs."""
        wanted = np.linspace(0.0, lengths[-1], 4).tolist()
        guesses = np.array([np.interp(wanted, lengths, column) for column in np.array(configurations).T]).T
        between = [
            self.solver.solve(path.at(along), guess) for along, guess in zip(wanted[1:3], guesses[1:3], strict=True)
        ]
        found = [guess if row is None else self._clipped(row) for row, guess in zip(between, guesses[1:3], strict=True)]
        return wanted, [configurations[0], *found, configurations[-1]]

    def _refined(
        self,
        path: ToolPath,
        lengths: list[float],
        configurations: list[Array],
        stop: StopReason | None,
        deadline: Deadline,
    ) -> FollowedPath | StopReason:
        """With configurations between, wherever the spline is off the path; it ends where even those do not help."""
        for _ in range(ROUNDS):
            deadline.check()
            curve = self._spline(lengths, configurations)
            middles = self._off(path, curve)
            if not middles:
                followed = FollowedPath(np.array(lengths), np.array(configurations), curve, stop)
                return self._within_limits(path, followed, deadline)
            # The spline may have strayed to where another branch is nearer; a mean of the neighbours has not.
            guesses = np.array([np.interp(middles, lengths, column) for column in np.array(configurations).T]).T
            solved = [self.solver.solve(path.at(middle), guess) for middle, guess in zip(middles, guesses, strict=True)]
            new = {middle: self._clipped(row) for middle, row in zip(middles, solved, strict=True) if row is not None}
            merged = dict(zip(lengths, configurations, strict=True)) | new
            lengths = sorted(merged)
            configurations = [merged[length] for length in lengths]
        kept = sum(length < middles[0] for length in lengths)
        stop = stop or self._lost(configurations[kept - 1])
        return stop if kept < 4 else self._refined(path, lengths[:kept], configurations[:kept], stop, deadline)

    def _within_limits(self, path: ToolPath, followed: FollowedPath, deadline: Deadline) -> FollowedPath | StopReason:
        """Only as far as no joint is beyond its limit between two configurations that are within it."""
        knots = np.arange(len(followed.lengths))
        looked = np.interp(np.linspace(0, knots[-1], LOOKS * int(knots[-1]) + 1), knots, followed.lengths)
        rows = followed.curve.at(looked).value[:, : len(self._lower)]
        excess = np.maximum(rows - self._upper, self._lower - rows)
        beyond = np.flatnonzero(excess.max(axis=1) > ROUNDING)
        if not len(beyond):
            return followed
        first = int(beyond[0])
        last = max(0, first - 1)
        stop = self._beyond(int(np.argmax(excess[first])), rows[last], rows[first])
        within = float(looked[last])
        return stop if within < 4 * FINEST else self.shortened(path, followed, within, stop, deadline)

    def _off(self, path: ToolPath, curve: CubicSpline) -> list[float]:
        """The middles between knots at which the spline is off the path."""
        middles = 0.5 * (curve.knots[:-1] + curve.knots[1:])
        rows = curve.at(middles).value[:, : len(self._lower)]
        pairs = zip(middles.tolist(), rows, strict=True)
        return [middle for middle, row in pairs if self.solver.error(path.at(middle), row) > CLOSE]

    def _spline(self, lengths: list[float], configurations: list[Array]) -> CubicSpline:
        tools = [self._kinematics.tool(configuration).position for configuration in configurations]
        return CubicSpline(np.array(lengths), np.hstack((configurations, tools)))

    def _clipped(self, configuration: Array) -> Array:
        clipped: Array = np.minimum(np.maximum(configuration, self._lower), self._upper)
        return clipped

    def _beyond(self, index: int, last: Array, found: Array) -> StopReason:
        joint, value = self._arm.joints[index], float(found[index])
        limit = joint.clamp(value)
        side = "upper" if value > joint.upper else "lower"
        share = max(LEAST, NEARLY * float((self._clipped(found) - last)[index] / (found - last)[index]))
        would_do = remedy("via_another"), remedy("end_before")
        why = because("plan.tool.at_limit", *would_do, joint=joint.name, side=side, limit=limit, unit=joint.unit)
        return StopReason("joint limit", joint.name, value, limit, why, share)

    def _lost(self, last: Array) -> StopReason:
        value = self.solver.manipulability(last)
        would_do = remedy("keep_away"), remedy("go_freely")
        why = because("plan.tool.singular", *would_do, manipulability=value)
        return StopReason("singularity", self._arm.tool_frame, value, 0.0, why)

    def _jump(self, check: str, last: Array, found: Array, jump: float) -> StopReason:
        index = int(np.argmax(np.abs(found - last)))
        joint, value = self._arm.joints[index], float(abs(found[index] - last[index]))
        why = because(
            "plan.tool.jump",
            remedy("keep_away"),
            remedy("go_freely"),
            joint=joint.name,
            value=value,
            limit=jump,
            unit=joint.unit,
            manipulability=self.solver.manipulability(last),
        )
        return StopReason(check, joint.name, value, jump, why)


def is_same(one: Sequence[float] | Array, other: Sequence[float] | Array) -> bool:
    """True if two configurations (n,) [rad] or [m] differ by no more than rounding."""
    return float(np.abs(np.subtract(one, other)).max()) <= SAME


def _is_jump(found: Array | StopReason) -> bool:
    """Beyond the threshold that was asked for: shorter steps would only hide it."""
    return isinstance(found, StopReason) and found.check == "jump"


def _extrapolated(lengths: list[float], configurations: list[Array], ahead: float) -> Array:
    """By the polynomial through the last few configurations (Lagrange); nearby, lest it strays to another branch."""
    knots = np.array(lengths[-ORDER:])
    apart = knots[:, None] - knots + np.eye(len(knots))
    gaps = (ahead - knots) / apart
    np.fill_diagonal(gaps, 1.0)
    guess: Array = gaps.prod(axis=1) @ np.array(configurations[-ORDER:])
    near = 0.5 * JUMP
    return np.clip(guess, configurations[-1] - near, configurations[-1] + near)
